//! A vector of non-negative numbers that knows which of them are not 0.

/// Dense values and the list of their support, of fixed capacity.
#[derive(Debug, Clone)]
pub(crate) struct Weights {
    values: Vec<f64>,
    /// The first `count` are the support, each once. One place more than values: a candidate is
    /// written before it is known whether it counts.
    list: Vec<u32>,
    count: usize,
}

impl Weights {
    /// So many zeros.
    pub(crate) fn new(length: usize) -> Self {
        Self {
            values: vec![0.0; length],
            list: vec![0; length + 1],
            count: 0,
        }
    }

    /// All values.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Indices of what is not 0.
    pub(crate) fn support(&self) -> &[u32] {
        &self.list[..self.count]
    }

    /// One value.
    pub(crate) fn at(&self, index: u32) -> f64 {
        self.values[index as usize]
    }

    /// Adds to one value. What is not a normal positive number (0, negative, below 2.2e-308, NaN)
    /// is left out: subnormal numbers are slow and worth nothing.
    #[inline]
    pub(crate) fn add(&mut self, index: u32, weight: f64) {
        if weight >= f64::MIN_POSITIVE {
            let slot = &mut self.values[index as usize];
            // Without a branch: whether a state comes up for the first time is hard to foresee.
            self.list[self.count] = index;
            self.count += usize::from(*slot == 0.0);
            *slot += weight;
        }
    }

    /// Sum of all values.
    pub(crate) fn sum(&self) -> f64 {
        // Four sums at a time: one alone waits for itself.
        let (fours, rest) = self.support().as_chunks::<4>();
        let mut sums = [0.0; 4];
        for four in fours {
            for (sum, index) in sums.iter_mut().zip(four) {
                *sum += self.values[*index as usize];
            }
        }
        let rest: f64 = rest.iter().map(|&index| self.at(index)).sum();
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
    }

    /// Sets everything to 0.
    pub(crate) fn clear(&mut self) {
        for &index in &self.list[..self.count] {
            self.values[index as usize] = 0.0;
        }
        self.count = 0;
    }

    /// Replaces everything; missing values are 0, others than normal positive ones too.
    pub(crate) fn set(&mut self, values: impl Iterator<Item = f64>) {
        self.clear();
        for (index, value) in (0..self.values.len() as u32).zip(values) {
            self.add(index, value);
        }
    }

    /// Gives away how many values are not 0, then their indices and values, in the order of the
    /// support.
    pub(crate) fn keep(&self, put: &mut dyn FnMut(f64)) {
        put(self.count as f64);
        for &index in self.support() {
            put(f64::from(index));
            put(self.at(index));
        }
    }

    /// Takes what [`Self::keep`] gave away; what cannot be is left out.
    pub(crate) fn resume(&mut self, take: &mut dyn FnMut() -> f64) {
        self.clear();
        let count = (take() as usize).min(self.values.len());
        for _ in 0..count {
            let (index, value) = (take() as usize, take());
            if index < self.values.len() && self.values[index] == 0.0 {
                self.add(index as u32, value);
            }
        }
    }

    /// Takes all of `other`, times `factor`; `other` is 0 afterwards. `self` must be 0.
    pub(crate) fn take_scaled(&mut self, other: &mut Self, factor: f64) {
        for &index in &other.list[..other.count] {
            let slot = &mut other.values[index as usize];
            let value = *slot * factor;
            *slot = 0.0;
            let is_normal = value >= f64::MIN_POSITIVE;
            self.values[index as usize] = if is_normal { value } else { 0.0 };
            self.list[self.count] = index;
            self.count += usize::from(is_normal);
        }
        other.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_support_is_what_is_not_zero() {
        let mut weights = Weights::new(3);
        for (index, weight) in [
            (2, 0.5),
            (0, 0.0),
            (1, f64::NAN),
            (2, 0.25),
            (0, 1e-310),
            (1, -1.0),
        ] {
            weights.add(index, weight);
        }
        assert_eq!(
            (weights.values(), weights.support()),
            (&[0.0, 0.0, 0.75][..], &[2][..])
        );
        weights.add(0, 2.0);
        weights.add(1, 3.0);
        assert_eq!((weights.support(), weights.sum()), (&[2, 0, 1][..], 5.75));
        let mut other = Weights::new(3);
        other.take_scaled(&mut weights, 2.0);
        assert_eq!(other.values(), [4.0, 6.0, 1.5]);
        assert_eq!(
            (weights.values(), weights.support()),
            (&[0.0; 3][..], &[][..])
        );
        other.set([1.0, 0.0].into_iter());
        assert_eq!(
            (other.values(), other.support()),
            (&[1.0, 0.0, 0.0][..], &[0][..])
        );
    }
}

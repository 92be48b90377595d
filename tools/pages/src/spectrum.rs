//! How many values lie in each step of a logarithmic axis.

use std::collections::BTreeMap;

use crate::columns::Column;

/// Steps for a factor of ten.
const STEPS: f64 = 20.0;

/// Counts of positive values, step by step of a logarithmic axis.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Spectrum {
    counts: BTreeMap<i32, u64>,
    total: u64,
}

impl Spectrum {
    /// Adds `count` values that are alike; none of what is no positive number.
    pub fn add(&mut self, value: f64, count: u64) {
        if value.is_finite() && value > 0.0 && count > 0 {
            let step = (value.log10() * STEPS).floor() as i32;
            *self.counts.entry(step).or_default() += count;
            self.total += count;
        }
    }

    /// How many values there are.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.total
    }

    /// The share of the values in a step.
    #[must_use]
    pub fn share(&self, step: i32) -> f64 {
        let count = self.counts.get(&step).copied().unwrap_or(0);
        count as f64 / self.total.max(1) as f64
    }

    /// The first and the last step in which a value lies.
    #[must_use]
    pub fn steps(&self) -> Option<[i32; 2]> {
        let [first, last] = [self.counts.keys().next(), self.counts.keys().next_back()];
        Some([*first?, *last?])
    }
}

impl FromIterator<f64> for Spectrum {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut spectrum = Self::default();
        values.into_iter().for_each(|value| spectrum.add(value, 1));
        spectrum
    }
}

impl Column for Spectrum {
    fn join(&mut self, next: Self) {
        for (step, count) in next.counts {
            *self.counts.entry(step).or_default() += count;
        }
        self.total += next.total;
    }
}

/// The first and the last step in which a value of any of them lies.
pub fn steps<'a>(all: impl IntoIterator<Item = &'a Spectrum>) -> Option<[i32; 2]> {
    let steps = all.into_iter().filter_map(Spectrum::steps);
    steps.reduce(|ends, more| [ends[0].min(more[0]), ends[1].max(more[1])])
}

/// Where a step begins on a logarithmic axis, in powers of ten.
#[must_use]
pub fn begin(step: i32) -> f64 {
    f64::from(step) / STEPS
}

/// The values between which all of them lie.
pub fn ends<'a>(all: impl IntoIterator<Item = &'a Spectrum>) -> Option<[f64; 2]> {
    let [first, last] = steps(all)?;
    Some([first, last + 1].map(|step| 10.0_f64.powf(begin(step))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_counted_in_their_steps_and_what_is_no_value_is_not() {
        let values = [1.0, 1.05, 10.0, 0.0, -1.0, f64::NAN, f64::INFINITY];
        let mut spectrum: Spectrum = values.into_iter().collect();
        assert_eq!((spectrum.total(), spectrum.steps()), (3, Some([0, 20])));
        assert_eq!(
            [0, 1, 20].map(|step| spectrum.share(step)),
            [2.0 / 3.0, 0.0, 1.0 / 3.0]
        );
        spectrum.join([0.1].into_iter().collect());
        assert_eq!((spectrum.total(), spectrum.share(-20)), (4, 0.25));
        let found = ends([&spectrum, &Spectrum::default()]).unwrap();
        assert!((found[0] - 0.1).abs() < 1e-9 && (found[1] - 11.22).abs() < 0.01);
        assert_eq!(Spectrum::default().share(0), 0.0);
        assert_eq!(steps([&Spectrum::default()]), None);
    }
}

//! Likelihoods of a window under several changes, without a logarithm of each.

use super::{FREEDOM, Law};

/// How much more likely a window is with each of several changes than without any.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likelihoods<const N: usize> {
    /// Logarithm of what they are multiples of.
    pub log_unit: f64,
    /// The multiples.
    pub multiples: [f64; N],
}

impl<const N: usize> Likelihoods<N> {
    /// Natural logarithm of the mean over changes that are equally probable.
    #[must_use]
    pub fn log_mean(&self) -> f64 {
        let sum: f64 = self.multiples.iter().sum();
        self.log_unit + (sum / N as f64).ln()
    }

    /// The change with which the window is likeliest.
    #[must_use]
    pub fn likeliest(&self) -> usize {
        let mut best = 0;
        for (i, multiple) in self.multiples.iter().enumerate() {
            if *multiple > self.multiples[best] {
                best = i;
            }
        }
        best
    }
}

impl Law {
    /// How much more likely the window is with changes of which each lessens its square by `less`
    /// and its density by the factor `density`.
    #[must_use]
    pub fn likelihoods<const N: usize>(&self, less: [f64; N], density: [f64; N]) -> Likelihoods<N> {
        // A change of which no number says what it leaves is impossible.
        let left = less.map(|less| self.square - less.max(f64::NEG_INFINITY).min(self.square));
        let least = left.into_iter().fold(f64::INFINITY, f64::min);
        if !least.is_finite() {
            return Likelihoods {
                log_unit: f64::NEG_INFINITY,
                multiples: [1.0; N],
            };
        }
        // Of a change that leaves least, but for its density.
        let roots = left.map(|left| ((FREEDOM + least) / (FREEDOM + left)).sqrt());
        let mut multiples = powers(roots, FREEDOM as usize + self.values());
        let parts = multiples.iter_mut().zip(density);
        parts.for_each(|(multiple, density)| *multiple *= density);
        Likelihoods {
            log_unit: self.log_ratio_at(self.square, self.square - least),
            multiples,
        }
    }
}

/// Powers of all values to one exponent.
fn powers<const N: usize>(mut values: [f64; N], exponent: usize) -> [f64; N] {
    let mut out = [1.0; N];
    let mut bits = exponent;
    while bits > 0 {
        if bits & 1 == 1 {
            out.iter_mut()
                .zip(values)
                .for_each(|(out, value)| *out *= value);
        }
        values = values.map(|value| value * value);
        bits >>= 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_those_of_each_value() {
        for exponent in [0, 1, 2, 30, 127, 254] {
            let values = [1.0, 0.9, 0.999_9, 1e-3, 0.0];
            for (found, value) in powers(values, exponent).into_iter().zip(values) {
                let wanted = value.powi(exponent as i32);
                assert!((found - wanted).abs() <= 1e-12 * wanted, "{found} {wanted}");
            }
        }
    }
}

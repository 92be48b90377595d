//! What one channel read in one observation.

use vigil_checkpoint::CheckpointValue;

/// Samples of one channel in one observation: those that differ from their predecessor, and how
/// many repeated it exactly.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct Reading {
    /// Samples that differ from their predecessor.
    pub plain: u32,
    /// Mean of the plain samples.
    pub mean: f64,
    /// Sum of squared deviations of the plain samples from their mean.
    pub squares: f64,
    /// Samples equal to their predecessor, bit for bit.
    pub repeats: u32,
    /// Samples that are exactly 0, repeats included.
    pub zeros: u32,
    /// Mean of the plain samples of the observation before, and how many, if there were any.
    pub before: Option<(f64, u32)>,
}

impl Reading {
    /// Samples in all.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.plain + self.repeats
    }

    /// An empty reading that follows this one.
    #[must_use]
    pub const fn next(&self) -> Self {
        Self {
            plain: 0,
            mean: 0.0,
            squares: 0.0,
            repeats: 0,
            zeros: 0,
            before: match self.plain {
                0 => None,
                plain => Some((self.mean, plain)),
            },
        }
    }

    /// Adds a sample, given its predecessor.
    pub fn push(&mut self, value: f64, before: Option<f64>) {
        if value == 0.0 {
            self.zeros += 1;
        }
        if before.is_some_and(|before| before.to_bits() == value.to_bits()) {
            self.repeats += 1;
            return;
        }
        self.plain += 1;
        let apart = value - self.mean;
        self.mean += apart / f64::from(self.plain);
        self.squares += apart * (value - self.mean);
    }
}

#[cfg(test)]
mod tests {
    use super::Reading;

    #[test]
    fn repeats_and_zeros_are_told_from_plain_samples() {
        let (mut reading, mut before) = (Reading::default(), None);
        for value in [1.0, 3.0, 3.0, 0.0, 0.0] {
            reading.push(value, before);
            before = Some(value);
        }
        let Reading {
            plain,
            mean,
            squares,
            repeats,
            zeros,
            ..
        } = reading;
        assert_eq!((plain, repeats, zeros, reading.count()), (3, 2, 2, 5));
        assert!((mean - 4.0 / 3.0).abs() < 1e-12);
        assert!((squares - 42.0 / 9.0).abs() < 1e-12);
    }

    #[test]
    fn the_next_reading_remembers_the_last_mean() {
        let mut reading = Reading::default();
        assert_eq!(reading.next().before, None);
        reading.push(2.0, None);
        reading.push(4.0, Some(2.0));
        let next = reading.next();
        assert_eq!((next.before, next.count()), (Some((3.0, 2)), 0));
        // What is older than an observation says nothing.
        assert_eq!(next.next().before, None);
    }
}

//! What counts as a distribution: one rule for files, models in code and learned models.
//!
//! A probability is a number from 0 to 1, a row's sum is 1. Public files are written with six
//! digits, so that a row whose sum differs from 1 by at most 1e-5 is taken for one that was
//! rounded: it is divided by its sum, with a warning. A sum within 1e-9 of 1 is a double's own
//! rounding: the row stays as it is, so that a model which is written and read again is the same.
//! Beyond 1e-5 the row is refused. It holds for T, Z and the start belief alike.

/// Largest difference of a sum from 1 that is mended.
const MENDED_MAX: f64 = 1e-5;
/// Largest difference of a sum from 1 that is left as it is.
pub(crate) const SUM_TOLERANCE: f64 = 1e-9;

/// What a row's sum says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RowSum {
    /// It is 1.
    One,
    /// The row is to be divided by this.
    Off(f64),
}

impl RowSum {
    /// Judges a sum.
    ///
    /// # Errors
    /// What was found and what is allowed, if it is no distribution's.
    pub(crate) fn new(sum: f64) -> Result<Self, String> {
        let off = (sum - 1.0).abs();
        if off <= SUM_TOLERANCE {
            Ok(Self::One)
        } else if off <= MENDED_MAX {
            Ok(Self::Off(sum))
        } else {
            Err(format!(
                "sums to {sum}, not to 1; allowed is 1 within {MENDED_MAX}"
            ))
        }
    }

    /// What the author may want to mend, if anything.
    pub(crate) fn warning(self) -> Option<String> {
        match self {
            Self::One => None,
            Self::Off(sum) => Some(format!("sums to {sum}, not to 1; it was divided by that")),
        }
    }

    /// The factor that makes the sum 1.
    pub(crate) fn factor(self) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Off(sum) => 1.0 / sum,
        }
    }
}

/// Refuses what is no probability. A 1 may be rounded as a row is.
///
/// # Errors
/// What was found and what is allowed.
pub(crate) fn check_probability(p: f64) -> Result<(), String> {
    if (0.0..=1.0 + MENDED_MAX).contains(&p) {
        Ok(())
    } else {
        Err(format!("{p} is no probability, allowed is 0 to 1"))
    }
}

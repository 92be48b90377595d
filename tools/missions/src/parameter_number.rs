//! Numbers of parameter files that mean nothing.

/// A number that means nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NumberError {
    /// It is out of range.
    #[error("{key}: {found} is out of range: allowed is {allowed}")]
    Range {
        /// Key in the file.
        key: String,
        /// What was found.
        found: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Chances of which one at most comes true add up to more than 1.
    #[error("{key}: the chances add up to {sum}; allowed is up to 1")]
    Sum {
        /// Keys in the file.
        key: String,
        /// Their sum.
        sum: f64,
    },
}

/// The error of a number that is out of range.
pub fn out_of_range(key: &str, found: f64, allowed: &'static str) -> NumberError {
    NumberError::Range {
        key: key.to_owned(),
        found,
        allowed,
    }
}

/// Refuses a sum of chances beyond 1; `rounding` is what it may be off.
pub fn at_most_one(key: &str, sum: f64, rounding: f64) -> Result<(), NumberError> {
    if sum > 1.0 + rounding {
        return Err(NumberError::Sum {
            key: key.to_owned(),
            sum,
        });
    }
    Ok(())
}

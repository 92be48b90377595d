//! What the faults of the bank leave unexplained.

use super::Bank;

impl Bank {
    /// What is said of faults that are none of these, if no deviation is more than twice as large.
    #[must_use]
    pub fn unknown_bounded(&self) -> f64 {
        self.law().log_ratio_larger(self.law().square(), 2.0)
    }

    /// What is said of further faults if those that make the window so much more likely are there;
    /// and the logarithm of what is unusual then over what is usual with them alone.
    #[must_use]
    pub fn unknown_beside(&self, log_ratio: f64) -> (f64, f64) {
        let (law, values) = (self.law(), self.law().values() as f64);
        let left = law.left(log_ratio);
        let explained = (law.square() - left).max(1e-9);
        let doubt = ((left - values).max(1e-9) / explained).ln();
        (law.log_ratio_unknown(left), doubt)
    }
}

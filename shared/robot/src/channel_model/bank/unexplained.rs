//! What the faults of the bank leave unexplained.

use super::Bank;

/// Share of what a fault explains that it may leave because its effect is not quite as described:
/// known to a fifth. Chosen.
const MISFIT: f64 = 0.04;
/// The same, of one block, because it began within one: the blocks tell more of each other than of
/// what comes and goes, so that as much as one explains may be left. Chosen.
const PARTLY: f64 = 1.0;

impl Bank {
    /// How much more likely the window may be with a fault that makes it so much more likely as it
    /// is described, and has been there for so long at most.
    #[must_use]
    pub fn at_best(&self, log_ratio: f64, age_s: f64) -> f64 {
        let law = self.law();
        let left = law.left(log_ratio);
        let whole_blocks = (age_s / self.window.block_s() - 1.0).max(1.0);
        let misfit = MISFIT.max(PARTLY / whole_blocks) * (law.square() - left);
        let least = (left - misfit).max(law.values() as f64).min(left);
        log_ratio + law.log_ratio_at(left, left - least)
    }

    /// What is said of faults that are none of these, if all deviations are twice as large: large
    /// ones say hardly more than small ones.
    #[must_use]
    pub fn unknown_bounded(&self) -> f64 {
        self.law().log_ratio_larger(self.law().square(), 2.0)
    }

    /// What is said of further faults, there throughout the window, if those that make it so much
    /// more likely are there;
    /// and the logarithm of what is unusual then over what is usual with them alone.
    #[must_use]
    pub fn unknown_beside(&self, log_ratio: f64) -> (f64, f64) {
        let (law, values) = (self.law(), self.law().values() as f64);
        let left = law.left(log_ratio);
        let explained = (law.square() - left).max(1e-9);
        let doubt = ((left - values).max(1e-9) / explained).ln();
        (law.log_ratio_unknown(left, &[]), doubt)
    }
}

//! The paper's detection filter (Verma, Fernandez, Simmons 2002): nominal is modelled, the fault
//! state has a constant likelihood. With the whitened nominal residual r the constant is
//! `peak · exp(-τ²/2)`, so that each step adds `(|r|² - τ²) / 2` to the log-odds: a CUSUM.

use crate::logspace::log_add;

/// Bound of the log-odds: with a constant likelihood they fall only slowly after a fault has gone.
const LOG_ODDS_MAX: f64 = 40.0;

/// Two states, nominal and fault, with a constant likelihood in the fault state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    log_odds: f64,
}

impl Default for Constant {
    fn default() -> Self {
        Self {
            log_odds: f64::NEG_INFINITY,
        }
    }
}

impl Constant {
    /// Natural log-odds of the fault state.
    #[must_use]
    pub const fn log_odds(&self) -> f64 {
        self.log_odds
    }

    /// One step with the squared norm of the whitened residual, the constant's `tau_squared` (above
    /// the residual's dimension, or nominal steps count as evidence), and the probabilities of a
    /// fault's appearing and vanishing in this step.
    pub fn step(&mut self, norm_squared: f64, tau_squared: f64, birth: f64, death: f64) {
        if !norm_squared.is_finite() {
            return;
        }
        let stays = log_add(self.log_odds + (1.0 - death).ln(), birth.ln());
        let leaves = log_add((1.0 - birth).ln(), self.log_odds + death.ln());
        self.log_odds = (stays - leaves + 0.5 * (norm_squared - tau_squared)).min(LOG_ODDS_MAX);
    }
}

#[cfg(test)]
mod tests {
    use super::Constant;

    #[test]
    fn the_recursion_is_the_two_state_bayes_filter() {
        // By hand: prior (1, 0), birth .1, death .2, likelihood ratio e^((9-5)/2).
        let mut filter = Constant::default();
        filter.step(9.0, 5.0, 0.1, 0.2);
        let ratio = 2.0_f64.exp();
        let odds = 0.1 / 0.9 * ratio;
        assert!((filter.log_odds() - odds.ln()).abs() < 1e-12);
        filter.step(9.0, 5.0, 0.1, 0.2);
        let odds = (odds * 0.8 + 0.1) / (0.9 + odds * 0.2) * ratio;
        assert!((filter.log_odds() - odds.ln()).abs() < 1e-12);
    }

    #[test]
    fn hostile_residuals_leave_finite_odds() {
        let mut filter = Constant::default();
        for norm in [f64::NAN, f64::INFINITY, 1e308, 0.0] {
            filter.step(norm, 5.0, 1e-6, 1e-6);
            assert!(!filter.log_odds().is_nan() && filter.log_odds() <= 40.0);
        }
    }
}

//! How what speaks for a class of faults is divided among the components that may have them.

use vigil_inference::logspace::log_sum_exp;

use super::IMPOSSIBLE;
use crate::channel_model::COMPONENTS_MAX;

/// Of two faults at once, and of none of the components, there is one each besides.
const SHARES_MAX: usize = COMPONENTS_MAX + 2;

/// Log-odds by component, without those that are impossible.
pub struct Shares {
    components: [usize; SHARES_MAX],
    log_odds: [f64; SHARES_MAX],
    count: usize,
}

impl Shares {
    /// Of log-odds in the order of the components.
    pub fn new(log_odds: impl Iterator<Item = f64>) -> Self {
        let mut shares = Self {
            components: [0; SHARES_MAX],
            log_odds: [0.0; SHARES_MAX],
            count: 0,
        };
        let possible = log_odds.enumerate().filter(|(_, one)| *one > IMPOSSIBLE);
        for (component, log_odds) in possible.take(SHARES_MAX) {
            shares.components[shares.count] = component;
            shares.log_odds[shares.count] = log_odds;
            shares.count += 1;
        }
        shares
    }

    /// Log-odds of any.
    pub fn total(&self) -> f64 {
        log_sum_exp(&self.log_odds[..self.count]).max(IMPOSSIBLE)
    }

    /// Divides `total` by the shares to the power of `slope`: components, with what is theirs.
    pub fn divide(&mut self, slope: f64, total: f64) -> impl Iterator<Item = (usize, f64)> {
        let all = &mut self.log_odds[..self.count];
        all.iter_mut().for_each(|one| *one *= slope);
        let change = total - log_sum_exp(all);
        let shares = self.components.iter().zip(all);
        shares.map(move |(component, log_odds)| (*component, *log_odds + change))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_total_is_divided_by_powers_of_the_shares() {
        let ln = f64::ln;
        let given = [IMPOSSIBLE, ln(1.0), IMPOSSIBLE, ln(4.0), ln(4.0)];
        let mut shares = Shares::new(given.into_iter());
        assert!((shares.total() - ln(9.0)).abs() < 1e-12);
        let found: Vec<_> = shares.divide(0.5, ln(10.0)).collect();
        let wanted = [(1, ln(2.0)), (3, ln(4.0)), (4, ln(4.0))];
        for ((component, log_odds), (wanted, of_wanted)) in found.into_iter().zip(wanted) {
            assert_eq!(component, wanted);
            assert!((log_odds - of_wanted).abs() < 1e-12);
        }
        assert_eq!(Shares::new([IMPOSSIBLE].into_iter()).total(), IMPOSSIBLE);
        assert_eq!(Shares::new([].into_iter()).divide(1.0, 0.0).count(), 0);
    }
}

//! Which steering angles are as commanded, in the unknown where wheels and steering may do anything.

use vigil_blocks::WHEELS;
use vigil_robot::learned::wheel_evidence::ANYTHING;

/// Of each steered wheel: probability that its angle may be anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angles {
    p_anything: [f64; WHEELS],
}

impl Default for Angles {
    /// As the unknown begins.
    fn default() -> Self {
        Self {
            p_anything: [ANYTHING; WHEELS],
        }
    }
}

impl Angles {
    /// Takes the log-density of each angle that was read, if it may be anything, over that of one
    /// as commanded; each begins or ceases to be so with the probability `changes`. Returns that of
    /// them all over angles as commanded.
    pub fn step(&mut self, log_ratios: &[Option<f64>; WHEELS], changes: f64) -> f64 {
        let mut gained = 0.0;
        for (p, log_ratio) in self.p_anything.iter_mut().zip(log_ratios) {
            let Some(log_ratio) = log_ratio else { continue };
            let before = *p + changes * (1.0 - 2.0 * *p);
            let anything = before * log_ratio.exp();
            let total = anything + 1.0 - before;
            *p = anything / total;
            gained += total.ln();
        }
        gained
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANGES: f64 = 1e-5;

    /// What so many readings of one angle gain.
    fn gained(angles: &mut Angles, log_ratio: f64, count: usize) -> f64 {
        let mut readings = [None; WHEELS];
        readings[0] = Some(log_ratio);
        (0..count).map(|_| angles.step(&readings, CHANGES)).sum()
    }

    #[test]
    fn angles_as_commanded_cost_the_unknown_once_however_long_it_lasts() {
        let mut angles = Angles::default();
        let cost = gained(&mut angles, -3.0, 10_000);
        assert!((cost - (1.0 - ANYTHING).ln()).abs() < 0.2, "{cost}");
    }

    #[test]
    fn an_angle_that_is_off_costs_its_prior_once() {
        let mut angles = Angles::default();
        let gain = gained(&mut angles, 5.0, 100);
        assert!((gain - 500.0 - ANYTHING.ln()).abs() < 0.2, "{gain}");
        // .. and is believed to be as commanded again some readings after it is.
        let cost = gained(&mut angles, -3.0, 10_000);
        assert!((-20.0..-10.0).contains(&cost), "{cost}");
    }
}

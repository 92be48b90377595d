//! How often faults come and go, before anything is read.

use super::Mover;

/// Wheels that stick at once, or turn again at once, do so from one cause, whichever they are: how
/// often, beside one wheel. Chosen: one cause in ten, 2.3 nats.
const AT_ONCE: f64 = 0.1;

/// How often faults come and go, per second of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultRates {
    /// Rate at which one modelled fault appears, 1/s.
    pub fault_1_s: f64,
    /// Rate at which something unknown happens, 1/s.
    pub unknown_1_s: f64,
    /// Rate of a further fault of a robot that has one, over that of the first.
    pub further: f64,
    /// Rate at which a fault vanishes, 1/s.
    pub death_1_s: f64,
}

impl FaultRates {
    /// Factor on the rates of faults in a robot that moves like this, and has another fault
    /// besides with this probability: 1 if there is none.
    #[must_use]
    pub fn factor(&self, from: Mover, p_other: f64) -> f64 {
        if from == Mover::Nominal {
            1.0 - p_other * (1.0 - self.further)
        } else {
            self.further
        }
    }

    /// Rate at which `from`, beside which there is another fault with the probability `p_other`,
    /// becomes `to`, 1/s; 0 if it takes several steps.
    #[must_use]
    pub fn rate_1_s(&self, from: Mover, to: Mover, p_other: f64) -> f64 {
        let (before, after) = (from.stuck(), to.stuck());
        let (more, fewer) = (
            (after & !before).count_ones(),
            (before & !after).count_ones(),
        );
        let at_once = if more.max(fewer) > 1 { AT_ONCE } else { 1.0 };
        let factor = self.factor(from, p_other);
        match to {
            _ if from == to => 0.0,
            // Half for each of the two kinds of unknown.
            Mover::Unknown | Mover::UnknownAny => 0.5 * self.unknown_1_s * factor,
            // One servo or the pose, of a robot whose wheels turn.
            Mover::Steer(_) | Mover::Pose if before == 0 => self.fault_1_s * factor,
            Mover::Steer(_) | Mover::Pose => 0.0,
            Mover::Stuck(_) if fewer == 0 => self.fault_1_s * at_once * factor,
            // Another wheel instead of the only one.
            Mover::Stuck(_) if before.count_ones() == 1 && after.count_ones() == 1 => {
                self.fault_1_s * factor
            }
            _ if more == 0 => self.death_1_s * at_once,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_is_faults_more_or_less_or_another_one() {
        let rates = FaultRates {
            fault_1_s: 2.0,
            unknown_1_s: 6.0,
            further: 1.0,
            death_1_s: 5.0,
        };
        use Mover::{Nominal, Pose, Steer, Stuck, Unknown, UnknownAny};
        let cases = [
            (Nominal, Nominal, 0.0),
            (Nominal, Stuck(1), 2.0),
            (Nominal, Stuck(3), 2.0 * AT_ONCE),
            (Nominal, UnknownAny, 3.0),
            (Stuck(1), Nominal, 5.0),
            (Nominal, Steer(0), 2.0),
            (Nominal, Pose, 2.0),
            (Steer(0), Nominal, 5.0),
            (Steer(0), Stuck(1), 2.0),
            (Stuck(1), Steer(0), 0.0),
            (Pose, UnknownAny, 3.0),
            (Stuck(1), Stuck(2), 2.0),
            (Stuck(1), Stuck(3), 2.0),
            (Stuck(1), Stuck(7), 2.0 * AT_ONCE),
            (Stuck(4), Stuck(3), 0.0),
            (Stuck(3), Stuck(2), 5.0),
            (Stuck(3), Stuck(4), 0.0),
            (Stuck(3), Stuck(5), 0.0),
            (Stuck(3), Stuck(15), 2.0 * AT_ONCE),
            (Stuck(7), Stuck(2), 5.0 * AT_ONCE),
            (Stuck(3), Nominal, 5.0 * AT_ONCE),
            (Stuck(3), Unknown, 3.0),
            (Unknown, Stuck(2), 2.0),
            (Unknown, Stuck(3), 2.0 * AT_ONCE),
            (Unknown, Nominal, 5.0),
        ];
        for (from, to, expected) in cases {
            let found = rates.rate_1_s(from, to, 0.0);
            assert_eq!(found, expected, "{from:?} to {to:?}");
        }
    }
}

//! From the configuration to a supervisor.

use vigil_setup::Setup;

use vigil_decision::{Compensation, FaultLife, FaultRuleError, Supervisor, SupervisorError};

use crate::steps::{FaultStep, Steps};

/// Why there is nothing to compute with.
#[derive(Debug, thiserror::Error)]
pub enum StepsError {
    /// Decision model, tree, robot and settings do not fit together.
    #[error(transparent)]
    Supervisor(#[from] SupervisorError),
    /// A rule is about a fault that does not exist.
    #[error(transparent)]
    Faults(#[from] FaultRuleError),
}

/// Without any belief the robot stops after this long, ns. Chosen by hand: two observations, in
/// which a robot of 0.2 m/s drives 2 cm.
const BLIND_NS: u64 = 100_000_000;
/// The robot does not stop for want of a belief before so many misses. Chosen by hand: at a low
/// rate, a single late cycle is no loss of a stage.
const BLIND_MISSES_MIN: u64 = 5;
/// An action is valid for this long at least, ns: two cycles at 100 Hz. With less, the jitter of an
/// ordinary kernel would stop a healthy robot.
const VALIDITY_NS_MIN: u64 = 20_000_000;

/// The supervisor that a configuration describes.
///
/// # Errors
/// [`SupervisorError`] if decision model, tree, robot and settings do not fit together.
pub fn assemble(setup: &Setup) -> Result<Supervisor, SupervisorError> {
    let compensation = (0..setup.robot.wheels.len())
        .map(|wheel| {
            let (curvature_gain, curvature_offset_1_m) = setup.model.compensation(wheel);
            Compensation {
                wheel,
                curvature_gain,
                curvature_offset_1_m,
            }
        })
        .collect();
    Supervisor::new(
        setup.decision.clone(),
        setup.policy.as_ref(),
        &setup.tree,
        &setup.robot,
        &setup.file.supervisor,
        compensation,
        (BLIND_NS / setup.period_ns()).max(BLIND_MISSES_MIN) as u32,
    )
}

/// The life of faults that a configuration describes.
///
/// # Errors
/// [`FaultRuleError`] for a rule about what does not exist.
pub fn fault_life(setup: &Setup) -> Result<FaultLife, FaultRuleError> {
    FaultLife::new(&setup.file.faults, &setup.tree)
}

/// All that the supervisor of a configuration computes.
///
/// # Errors
/// As [`assemble`] and [`fault_life`].
pub fn steps(setup: &Setup) -> Result<Steps, StepsError> {
    Ok(Steps {
        supervisor: assemble(setup)?,
        faults: FaultStep::new(fault_life(setup)?, setup.tree.hash()),
    })
}

/// How long an action stays valid, ns: long enough to survive a few lost cycles, short enough to
/// stop a robot whose supervisor is gone.
#[must_use]
pub fn validity_ns(setup: &Setup) -> u64 {
    let periods = setup.file.supervisor.validity_periods;
    let validity_ns = (periods * setup.period_ns() as f64) as u64;
    // No action is published without a valid period, and none is valid for ever.
    let validity_ns = validity_ns.max(VALIDITY_NS_MIN);
    assert!(
        validity_ns < u64::MAX,
        "an action is valid for a limited time: {validity_ns} ns"
    );
    validity_ns
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// The rover's setup, whose actions are valid for so many periods.
    fn setup(validity_periods: f64) -> Setup {
        let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/rover.toml");
        let mut setup = vigil_setup::load_graph(Path::new(config), |_| {}).unwrap();
        setup.file.supervisor.validity_periods = validity_periods;
        setup
    }

    #[test]
    fn an_action_is_valid_for_two_cycles_at_100_hz_at_least() {
        // The rover's period is 10 ms.
        assert_eq!(validity_ns(&setup(1.0)), 20_000_000);
        assert_eq!(validity_ns(&setup(5.0)), 50_000_000);
    }

    #[test]
    #[should_panic(expected = "an action is valid for a limited time: 18446744073709551615 ns")]
    fn an_action_that_is_valid_for_ever_is_caught() {
        let _ = validity_ns(&setup(f64::INFINITY));
    }
}

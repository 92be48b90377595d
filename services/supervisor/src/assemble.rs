//! From the configuration to a supervisor.

use vigil_setup::Setup;

use vigil_decision::{Compensation, Supervisor, SupervisorError};

/// Without any belief the robot stops after this long, ns (two observations, 2 cm at 0.2 m/s), and
/// not before so many misses: a single late cycle at a low rate is none.
const BLIND_NS: u64 = 100_000_000;
const BLIND_MISSES_MIN: u64 = 5;
/// An action is valid for this long at least, ns: two cycles at 100 Hz.
const VALIDITY_NS_MIN: f64 = 20e6;

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

/// How long an action stays valid, ns: long enough to survive a few lost cycles, short enough to
/// stop a robot whose supervisor is gone.
#[must_use]
pub fn validity_ns(setup: &Setup) -> u64 {
    let periods = setup.file.supervisor.validity_periods;
    (periods * setup.period_ns() as f64).max(VALIDITY_NS_MIN) as u64
}

//! Orders of rules as action blocks, and back.

use vigil_blocks::{Action, RecoveryKind, WHEELS};
use vigil_robot::counter_steering;
use vigil_setup::Setup;

use super::rules::RuleOutput;

/// What an action block orders.
#[must_use]
pub fn order(action: &Action) -> RuleOutput {
    RuleOutput {
        kind: RecoveryKind::from_repr(action.kind).unwrap_or(RecoveryKind::None),
        wheels: action.answered(),
    }
}

/// The action block of an order, as the supervisor would write it. A rover that moves and whose
/// order is about stuck wheels steers against them.
#[must_use]
pub fn action_block(setup: &Setup, order: RuleOutput) -> Action {
    let RuleOutput { kind, wheels } = order;
    let steers = matches!(
        kind,
        RecoveryKind::Compensate
            | RecoveryKind::LimpHome
            | RecoveryKind::GoThrough
            | RecoveryKind::MoveAway
    );
    let steered = (0..WHEELS).filter(|wheel| steers && wheels.has_stuck(*wheel));
    let lines = steered.map(|wheel| setup.model.compensation(wheel));
    let (gain, offset) = counter_steering(lines);
    Action {
        decision_seq: 1,
        kind: kind as u32,
        stuck_wheels: wheels.stuck,
        broken_encoders: wheels.encoders,
        speed_scale: order.speed_scale(),
        curvature_gain: gain,
        curvature_offset: offset,
        valid_until_ns: u64::MAX,
        ..Action::default()
    }
}

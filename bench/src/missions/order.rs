//! Orders of rules as action blocks, and back.

use vigil_blocks::{Action, RecoveryKind};
use vigil_setup::Setup;

use super::rules::RuleOutput;

/// What an action block orders.
#[must_use]
pub fn order(action: &Action) -> RuleOutput {
    RuleOutput {
        kind: RecoveryKind::from_repr(action.kind).unwrap_or(RecoveryKind::None),
        wheel: (action.wheel != u32::MAX).then_some(action.wheel as usize),
    }
}

/// The action block of an order, as the supervisor would write it. A rover that moves and whose
/// order is about a stuck wheel steers against it.
#[must_use]
pub fn action_block(setup: &Setup, order: RuleOutput) -> Action {
    let RuleOutput { kind, wheel } = order;
    let steers = matches!(
        kind,
        RecoveryKind::Compensate | RecoveryKind::GoThrough | RecoveryKind::MoveAway
    );
    let steered = wheel.filter(|_| steers);
    let (gain, offset) = steered.map_or((1.0, 0.0), |w| setup.model.compensation(w));
    Action {
        decision_seq: 1,
        kind: kind as u32,
        wheel: wheel.map_or(u32::MAX, |wheel| wheel as u32),
        speed_scale: order.speed_scale(),
        curvature_gain: gain,
        curvature_offset: offset,
        valid_until_ns: u64::MAX,
        ..Action::default()
    }
}

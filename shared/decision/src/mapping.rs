//! From the decision model's actions to the robot.

use std::collections::BTreeMap;

use crate::error::SupervisorError;
use crate::settings::RecoveryAction;
use crate::states::{Leaf, LeafKind};
use vigil_blocks::{DECISION_ACTIONS, DECISION_STATES, RecoveryKind};
use vigil_pomdp::Pomdp;

/// Counter-steering that lets a robot with a stuck wheel drive the commanded curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensation {
    /// Index of the stuck wheel.
    pub wheel: usize,
    /// The curvature to command is `curvature_gain * curvature + curvature_offset_1_m`.
    pub curvature_gain: f64,
    /// See `curvature_gain`; 1/m.
    pub curvature_offset_1_m: f64,
}

/// Checks that a block can carry the model's belief and values.
pub(crate) fn check_size(model: &Pomdp) -> Result<(), SupervisorError> {
    let (states, actions) = (model.states().len(), model.actions().len());
    if states > DECISION_STATES || actions > DECISION_ACTIONS {
        return Err(SupervisorError::Size { states, actions });
    }
    Ok(())
}

/// What an action of the decision model makes the robot do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ActionMeaning {
    pub kind: RecoveryKind,
    pub speed_scale: f64,
    /// What a robot does and then has done.
    pub has_end: bool,
    /// The longest epoch, ns, where it is not that of the others.
    pub epoch_ns: Option<u64>,
}

/// Meaning of every action, in the model's order.
pub(crate) fn actions(
    model: &Pomdp,
    settings: &BTreeMap<String, RecoveryAction>,
) -> Result<Vec<ActionMeaning>, SupervisorError> {
    if let Some(foreign) = settings.keys().find(|name| !model.actions().contains(name)) {
        return Err(SupervisorError::ForeignAction(foreign.clone()));
    }
    model
        .actions()
        .iter()
        .map(|name| {
            let action = settings
                .get(name)
                .ok_or_else(|| SupervisorError::NoAction(name.clone()))?;
            let kind = RecoveryKind::from(action.kind);
            let speed_scale = action
                .speed_scale
                .unwrap_or_else(|| usual_speed_scale(kind));
            Ok(ActionMeaning {
                kind,
                speed_scale,
                has_end: action.has_end.unwrap_or_else(|| usually_has_end(kind)),
                epoch_ns: action.epoch_ms.map(|ms| (ms * 1e6) as u64),
            })
        })
        .collect()
}

/// Factor of the speed where the settings name none. Chosen by hand, as the configurations in
/// `config/` have them: half the speed halves what a wrong diagnosis costs and still shows faults;
/// a robot that compensates keeps more of it, as its fault is known.
const fn usual_speed_scale(kind: RecoveryKind) -> f64 {
    match kind {
        RecoveryKind::None
        | RecoveryKind::Stop
        | RecoveryKind::CallForHelp
        | RecoveryKind::NewPath
        | RecoveryKind::Relocalise
        | RecoveryKind::GiveUp
        | RecoveryKind::Own => 0.0,
        RecoveryKind::SlowDown => 0.5,
        RecoveryKind::Compensate | RecoveryKind::LimpHome => 0.7,
        RecoveryKind::GoOn
        | RecoveryKind::IgnoreEncoder
        | RecoveryKind::GoThrough
        | RecoveryKind::MoveAway => 1.0,
    }
}

const fn usually_has_end(kind: RecoveryKind) -> bool {
    use RecoveryKind as R;
    match kind {
        R::NewPath
        | R::Relocalise
        | R::GoThrough
        | R::MoveAway
        | R::CallForHelp
        | R::GiveUp
        | R::Own => true,
        R::None
        | R::GoOn
        | R::SlowDown
        | R::Stop
        | R::Compensate
        | R::IgnoreEncoder
        | R::LimpHome => false,
    }
}

/// Checks that every wheel that may be stuck can be compensated, if an action does so.
pub(crate) fn check_compensation(
    model: &Pomdp,
    leaves: &[Leaf],
    actions: &[ActionMeaning],
    compensation: &[Compensation],
) -> Result<(), SupervisorError> {
    let compensates = |meaning: &ActionMeaning| {
        let kinds = [RecoveryKind::Compensate, RecoveryKind::LimpHome];
        kinds.contains(&meaning.kind)
    };
    let Some(action) = actions.iter().position(compensates) else {
        return Ok(());
    };
    let is_usable = |wheel: usize| {
        compensation.iter().any(|c| {
            c.wheel == wheel && c.curvature_gain.is_finite() && c.curvature_offset_1_m.is_finite()
        })
    };
    let stuck = leaves.iter().filter(|leaf| leaf.kind == LeafKind::Stuck);
    match stuck.filter_map(|s| s.wheel).find(|&w| !is_usable(w)) {
        Some(wheel) => Err(SupervisorError::NoCompensation(
            wheel,
            model.actions()[action].clone(),
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_done_standing_has_no_speed_and_what_drives_has_all_of_it() {
        use RecoveryKind as R;
        for (scale, kinds) in [
            (
                0.0,
                &[
                    R::None,
                    R::Stop,
                    R::CallForHelp,
                    R::NewPath,
                    R::Relocalise,
                    R::GiveUp,
                    R::Own,
                ][..],
            ),
            (0.5, &[R::SlowDown]),
            (0.7, &[R::Compensate, R::LimpHome]),
            (1.0, &[R::GoOn, R::IgnoreEncoder, R::GoThrough, R::MoveAway]),
        ] {
            for kind in kinds {
                assert_eq!(usual_speed_scale(*kind), scale, "{kind:?}");
            }
        }
    }

    fn model(states: usize, actions: usize) -> Pomdp {
        let text = format!(
            "discount: 0.9\nvalues: reward\nstates: {states}\nactions: {actions}\nT: * identity\n"
        );
        Pomdp::parse(&text).unwrap()
    }

    #[test]
    fn a_model_is_as_large_as_a_block_can_carry() {
        assert_eq!(
            check_size(&model(DECISION_STATES, DECISION_ACTIONS)),
            Ok(())
        );
        for (states, actions) in [(DECISION_STATES + 1, 1), (1, DECISION_ACTIONS + 1)] {
            let refused = check_size(&model(states, actions));
            assert_eq!(refused, Err(SupervisorError::Size { states, actions }));
        }
    }

    #[test]
    fn each_stuck_wheel_needs_a_finite_compensation_of_its_own() {
        let model = model(2, 1);
        let compensate = ActionMeaning {
            kind: RecoveryKind::Compensate,
            speed_scale: 0.7,
            has_end: false,
            epoch_ns: None,
        };
        let leaves = [(3, LeafKind::Encoder), (4, LeafKind::Stuck)].map(|(wheel, kind)| Leaf {
            node: 1,
            kind,
            wheel: Some(wheel),
        });
        let check = |compensation: &[Compensation], actions: &[ActionMeaning]| {
            check_compensation(&model, &leaves, actions, compensation)
        };
        let of = |wheel, curvature_gain, curvature_offset_1_m| Compensation {
            wheel,
            curvature_gain,
            curvature_offset_1_m,
        };
        let missing = Err(SupervisorError::NoCompensation(4, "0".to_owned()));
        assert_eq!(check(&[of(4, 1.0, 0.0)], &[compensate]), Ok(()));
        assert_eq!(check(&[of(3, 1.0, 0.0)], &[compensate]), missing);
        assert_eq!(check(&[of(4, f64::NAN, 0.0)], &[compensate]), missing);
        assert_eq!(check(&[of(4, 1.0, f64::NAN)], &[compensate]), missing);
        let stop = ActionMeaning {
            kind: RecoveryKind::Stop,
            ..compensate
        };
        assert_eq!(check(&[], &[stop]), Ok(()));
    }
}

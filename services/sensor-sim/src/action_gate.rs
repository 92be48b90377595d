//! The action gate: which of the supervisor's actions the rover executes.

use vigil_blocks::{Action, ActionRejection, RecoveryKind};
use vigil_robot::description::Limits;

use crate::drive::DriveCommand;

/// What the rover executes in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectiveCommand {
    /// Curvature and speed to reach, within the robot's limits.
    pub target: DriveCommand,
    /// Share of the planned speed, 0..1: how fast the drive's own clock runs. 0 when stopping.
    pub progress: f64,
    /// Why the rover is in safe stop: it holds no valid action.
    pub rejection: Option<ActionRejection>,
    /// `decision_seq` of the last action executed; 0 for none.
    pub action_seq: u64,
}

impl EffectiveCommand {
    /// The plan without any action, as for a rover outside the graph.
    #[must_use]
    pub const fn as_planned(planned: DriveCommand) -> Self {
        Self {
            target: planned,
            progress: 1.0,
            rejection: None,
            action_seq: 0,
        }
    }
}

/// Turns actions into commands. Equal calls give equal results; the time is a parameter.
#[derive(Debug, Clone)]
pub struct ActionGate {
    curvature_max_1_m: f64,
    speed_max_m_s: f64,
    action_seq: u64,
}

impl ActionGate {
    /// For a robot with these limits.
    #[must_use]
    pub fn new(limits: &Limits) -> Self {
        Self {
            // A limit that makes no sense (NaN, negative) allows nothing.
            curvature_max_1_m: limits.curvature_1_m.max(0.0),
            speed_max_m_s: limits.speed_m_s.max(0.0),
            action_seq: 0,
        }
    }

    /// The command for this cycle: `planned` as `action` changes it. Without a valid action the
    /// rover stops and keeps its steering: on a path that bends, straight wheels would leave it.
    pub fn apply(
        &mut self,
        planned: DriveCommand,
        action: Option<&Action>,
        now_ns: u64,
    ) -> EffectiveCommand {
        let stop = DriveCommand {
            speed_m_s: 0.0,
            ..planned
        };
        let stop = ScaledDrive {
            target: stop,
            progress: 0.0,
        };
        let (drive, rejection) = match admit(planned, action, now_ns) {
            Ok(admitted) => (self.execute(admitted, now_ns).unwrap_or(stop), None),
            Err(rejection) => (stop, Some(rejection)),
        };
        EffectiveCommand {
            target: self.within_limits(drive.target),
            progress: drive.progress,
            rejection,
            action_seq: self.action_seq,
        }
    }

    /// Takes over an admitted action; the drive that it asks for, `None` to stop.
    fn execute(&mut self, admitted: AdmittedAction, now_ns: u64) -> Option<ScaledDrive> {
        // The pair of the check in `admit`: an expired action says nothing about this cycle.
        assert!(
            now_ns <= admitted.valid_until_ns,
            "the action gate executes no expired action"
        );
        self.action_seq = admitted.decision_seq;
        admitted.drive
    }

    fn within_limits(&self, target: DriveCommand) -> DriveCommand {
        let (curvature, speed) = (self.curvature_max_1_m, self.speed_max_m_s);
        DriveCommand {
            curvature_1_m: target.curvature_1_m.clamp(-curvature, curvature),
            speed_m_s: target.speed_m_s.clamp(-speed, speed),
        }
    }
}

/// True if the rover executes `action` at `now_ns`.
pub(crate) fn is_valid(action: &Action, now_ns: u64) -> bool {
    admit(DriveCommand::default(), Some(action), now_ns).is_ok()
}

/// An action that passed every check.
struct AdmittedAction {
    decision_seq: u64,
    valid_until_ns: u64,
    /// How it drives; `None` if it stops the rover.
    drive: Option<ScaledDrive>,
}

/// A planned command as an action changes it.
struct ScaledDrive {
    target: DriveCommand,
    /// Share of the planned speed.
    progress: f64,
}

fn admit(
    planned: DriveCommand,
    action: Option<&Action>,
    now_ns: u64,
) -> Result<AdmittedAction, ActionRejection> {
    let action = action.ok_or(ActionRejection::Nothing)?;
    if now_ns > action.valid_until_ns {
        return Err(ActionRejection::Expired);
    }
    let kind = RecoveryKind::from_repr(action.kind).ok_or(ActionRejection::UnknownKind)?;
    let (scale, gain) = (action.speed_scale, action.curvature_gain);
    let offset = action.curvature_offset;
    if ![scale, gain, offset].iter().all(|value| value.is_finite()) {
        return Err(ActionRejection::NotFinite);
    }
    if !(0.0..=1.0).contains(&scale) {
        return Err(ActionRejection::OutOfRange);
    }
    let drive = match kind {
        RecoveryKind::None => return Err(ActionRejection::Nothing),
        RecoveryKind::Stop
        | RecoveryKind::CallForHelp
        | RecoveryKind::NewPath
        | RecoveryKind::Relocalise
        | RecoveryKind::GiveUp
        | RecoveryKind::Own => None,
        RecoveryKind::GoOn
        | RecoveryKind::GoThrough
        | RecoveryKind::MoveAway
        | RecoveryKind::SlowDown
        | RecoveryKind::Compensate
        | RecoveryKind::IgnoreEncoder
        | RecoveryKind::LimpHome => {
            let target = DriveCommand {
                curvature_1_m: gain * planned.curvature_1_m + offset,
                speed_m_s: scale * planned.speed_m_s,
            };
            if !target.curvature_1_m.is_finite() {
                return Err(ActionRejection::OutOfRange);
            }
            Some(ScaledDrive {
                target,
                progress: scale,
            })
        }
    };
    Ok(AdmittedAction {
        decision_seq: action.decision_seq,
        valid_until_ns: action.valid_until_ns,
        drive,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PLANNED: DriveCommand = DriveCommand {
        curvature_1_m: 0.5,
        speed_m_s: 0.2,
    };

    fn limits() -> Limits {
        Limits {
            curvature_1_m: 1.2,
            speed_m_s: 0.5,
            yaw_rate_rad_s: 2.0,
            wheel_rate_rad_s: 40.0,
        }
    }

    fn action(kind: RecoveryKind) -> Action {
        Action {
            kind: kind as u32,
            decision_seq: 7,
            valid_until_ns: 1000,
            speed_scale: 0.5,
            curvature_gain: 1.1,
            curvature_offset: -0.2,
            ..Action::default()
        }
    }

    #[test]
    fn driving_kinds_scale_the_speed_and_bend_the_curvature() {
        use RecoveryKind::{
            Compensate, GoOn, GoThrough, IgnoreEncoder, LimpHome, MoveAway, SlowDown,
        };
        for kind in [
            GoOn,
            LimpHome,
            SlowDown,
            Compensate,
            IgnoreEncoder,
            GoThrough,
            MoveAway,
        ] {
            let mut gate = ActionGate::new(&limits());
            let found = gate.apply(PLANNED, Some(&action(kind)), 1000);
            assert!(
                (found.target.curvature_1_m - 0.35).abs() < 1e-12,
                "{found:?}"
            );
            assert!((found.target.speed_m_s - 0.1).abs() < 1e-12);
            assert_eq!(
                (found.progress, found.rejection, found.action_seq),
                (0.5, None, 7)
            );
        }
    }

    #[test]
    fn what_is_done_standing_stops_without_being_a_safe_stop() {
        use RecoveryKind::{CallForHelp, GiveUp, NewPath, Own, Relocalise, Stop};
        for kind in [Stop, CallForHelp, NewPath, Relocalise, GiveUp, Own] {
            let mut gate = ActionGate::new(&limits());
            let found = gate.apply(PLANNED, Some(&action(kind)), 0);
            assert_eq!((found.target.speed_m_s, found.progress), (0.0, 0.0));
            assert_eq!((found.rejection, found.action_seq), (None, 7));
        }
    }

    #[test]
    fn without_a_valid_action_the_rover_stops_itself_and_says_why() {
        let mut gate = ActionGate::new(&limits());
        let good = action(RecoveryKind::GoOn);
        let rejected: [(ActionRejection, Option<Action>, u64); 7] = [
            (ActionRejection::Nothing, None, 0),
            (
                ActionRejection::Nothing,
                Some(Action { kind: 0, ..good }),
                0,
            ),
            (ActionRejection::Expired, Some(good), 1001),
            (
                ActionRejection::UnknownKind,
                Some(Action { kind: 77, ..good }),
                0,
            ),
            (
                ActionRejection::NotFinite,
                Some(Action {
                    curvature_offset: f64::NAN,
                    ..good
                }),
                0,
            ),
            (
                ActionRejection::OutOfRange,
                Some(Action {
                    speed_scale: 1.01,
                    ..good
                }),
                0,
            ),
            (
                ActionRejection::OutOfRange,
                Some(Action {
                    speed_scale: -0.1,
                    ..good
                }),
                0,
            ),
        ];
        let admitted = gate.apply(PLANNED, Some(&good), 1000);
        assert_eq!(admitted.rejection, None);
        for (reason, action, now_ns) in rejected {
            let found = gate.apply(PLANNED, action.as_ref(), now_ns);
            assert_eq!(found.rejection, Some(reason), "{action:?}");
            assert_eq!((found.target.speed_m_s, found.progress), (0.0, 0.0));
            assert_eq!(
                found.action_seq, 7,
                "the last action executed stays reported"
            );
        }
    }

    #[test]
    fn a_command_beyond_the_limits_is_held_at_them() {
        let mut gate = ActionGate::new(&limits());
        let far = Action {
            curvature_offset: -5.0,
            ..action(RecoveryKind::Compensate)
        };
        let found = gate.apply(PLANNED, Some(&far), 0);
        assert_eq!(found.target.curvature_1_m, -1.2);
    }

    #[test]
    #[should_panic(expected = "the action gate executes no expired action")]
    fn an_expired_action_that_were_admitted_would_end_the_process() {
        let expired = AdmittedAction {
            decision_seq: 1,
            valid_until_ns: 999,
            drive: None,
        };
        ActionGate::new(&limits()).execute(expired, 1000);
    }

    proptest! {
        #[test]
        fn no_block_moves_the_rover_after_its_validity_or_beyond_its_limits(
            bits in any::<[u64; 3]>(), kind in 0_u32..20, valid_until_ns: u64, now_ns: u64,
        ) {
            let [speed_scale, curvature_gain, curvature_offset] = bits.map(f64::from_bits);
            let hostile = Action {
                kind, valid_until_ns, speed_scale, curvature_gain, curvature_offset,
                ..Action::default()
            };
            let found = ActionGate::new(&limits()).apply(PLANNED, Some(&hostile), now_ns);
            prop_assert!(now_ns <= valid_until_ns || found.rejection.is_some());
            prop_assert!(found.rejection.is_none() || found.target.speed_m_s == 0.0);
            prop_assert!(found.target.curvature_1_m.abs() <= limits().curvature_1_m);
            prop_assert!((0.0..=PLANNED.speed_m_s).contains(&found.target.speed_m_s));
        }
    }
}

//! What the rover makes of the supervisor's actions.

use vigil_blocks::{Action, RecoveryKind, Refusal};
use vigil_robot::description::Limits;

use crate::DriveCommand;

/// What the rover is to execute in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectiveCommand {
    /// Curvature and speed to go for, within the robot's limits.
    pub target: DriveCommand,
    /// Share of the planned speed, 0..1: how fast the drive's own clock runs. 0 when stopping.
    pub progress: f64,
    /// Why the rover stops itself: it holds no valid action.
    pub refusal: Option<Refusal>,
    /// `decision_seq` of the last action obeyed; 0 for none.
    pub action_seq: u64,
}

impl EffectiveCommand {
    /// Drives as planned without any action, as a rover outside the graph does.
    #[must_use]
    pub const fn as_planned(planned: DriveCommand) -> Self {
        Self {
            target: planned,
            progress: 1.0,
            refusal: None,
            action_seq: 0,
        }
    }
}

/// Turns actions into commands. Equal calls give equal results; the time is a parameter.
#[derive(Debug, Clone)]
pub struct Obedience {
    curvature_max_1_m: f64,
    speed_max_m_s: f64,
    action_seq: u64,
}

impl Obedience {
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
    /// rover stops itself; its steering stays where the plan wants it.
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
        let (target, progress, refusal) = match obey(planned, action, now_ns) {
            Ok((decision_seq, driving)) => {
                self.action_seq = decision_seq;
                match driving {
                    Some((target, progress)) => (target, progress, None),
                    None => (stop, 0.0, None),
                }
            }
            Err(refusal) => (stop, 0.0, Some(refusal)),
        };
        EffectiveCommand {
            target: self.within_limits(target),
            progress,
            refusal,
            action_seq: self.action_seq,
        }
    }

    fn within_limits(&self, target: DriveCommand) -> DriveCommand {
        let (curvature, speed) = (self.curvature_max_1_m, self.speed_max_m_s);
        DriveCommand {
            curvature_1_m: target.curvature_1_m.clamp(-curvature, curvature),
            speed_m_s: target.speed_m_s.clamp(-speed, speed),
        }
    }
}

/// True if the rover obeys `action` at `now_ns`.
pub(crate) fn is_valid(action: &Action, now_ns: u64) -> bool {
    obey(DriveCommand::default(), Some(action), now_ns).is_ok()
}

/// Decision and, unless it says stop, the command and its share of the planned speed.
type ObeyedCommand = (u64, Option<(DriveCommand, f64)>);

fn obey(
    planned: DriveCommand,
    action: Option<&Action>,
    now_ns: u64,
) -> Result<ObeyedCommand, Refusal> {
    let action = action.ok_or(Refusal::Nothing)?;
    if now_ns > action.valid_until_ns {
        return Err(Refusal::Expired);
    }
    let kind = RecoveryKind::from_wire(action.kind).ok_or(Refusal::UnknownKind)?;
    let (scale, gain) = (action.speed_scale, action.curvature_gain);
    let offset = action.curvature_offset;
    if ![scale, gain, offset].iter().all(|value| value.is_finite()) {
        return Err(Refusal::NotFinite);
    }
    if !(0.0..=1.0).contains(&scale) {
        return Err(Refusal::OutOfRange);
    }
    match kind {
        RecoveryKind::None => Err(Refusal::Nothing),
        RecoveryKind::Stop
        | RecoveryKind::CallForHelp
        | RecoveryKind::NewPath
        | RecoveryKind::Relocalise
        | RecoveryKind::GiveUp => Ok((action.decision_seq, None)),
        RecoveryKind::GoOn
        | RecoveryKind::GoThrough
        | RecoveryKind::MoveAway
        | RecoveryKind::SlowDown
        | RecoveryKind::Compensate
        | RecoveryKind::IgnoreEncoder => {
            let target = DriveCommand {
                curvature_1_m: gain * planned.curvature_1_m + offset,
                speed_m_s: scale * planned.speed_m_s,
            };
            if !target.curvature_1_m.is_finite() {
                return Err(Refusal::OutOfRange);
            }
            Ok((action.decision_seq, Some((target, scale))))
        }
    }
}

#[cfg(test)]
mod tests {
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
        use RecoveryKind::{Compensate, GoOn, GoThrough, IgnoreEncoder, MoveAway, SlowDown};
        for kind in [
            GoOn,
            SlowDown,
            Compensate,
            IgnoreEncoder,
            GoThrough,
            MoveAway,
        ] {
            let mut obedience = Obedience::new(&limits());
            let found = obedience.apply(PLANNED, Some(&action(kind)), 1000);
            assert!(
                (found.target.curvature_1_m - 0.35).abs() < 1e-12,
                "{found:?}"
            );
            assert!((found.target.speed_m_s - 0.1).abs() < 1e-12);
            assert_eq!(
                (found.progress, found.refusal, found.action_seq),
                (0.5, None, 7)
            );
        }
    }

    #[test]
    fn what_is_done_standing_stops_without_being_a_safe_stop() {
        use RecoveryKind::{CallForHelp, GiveUp, NewPath, Relocalise, Stop};
        for kind in [Stop, CallForHelp, NewPath, Relocalise, GiveUp] {
            let mut obedience = Obedience::new(&limits());
            let found = obedience.apply(PLANNED, Some(&action(kind)), 0);
            assert_eq!((found.target.speed_m_s, found.progress), (0.0, 0.0));
            assert_eq!((found.refusal, found.action_seq), (None, 7));
        }
    }

    #[test]
    fn without_a_valid_action_the_rover_stops_itself_and_says_why() {
        let mut obedience = Obedience::new(&limits());
        let good = action(RecoveryKind::GoOn);
        let refused: [(Refusal, Option<Action>, u64); 7] = [
            (Refusal::Nothing, None, 0),
            (Refusal::Nothing, Some(Action { kind: 0, ..good }), 0),
            (Refusal::Expired, Some(good), 1001),
            (Refusal::UnknownKind, Some(Action { kind: 77, ..good }), 0),
            (
                Refusal::NotFinite,
                Some(Action {
                    curvature_offset: f64::NAN,
                    ..good
                }),
                0,
            ),
            (
                Refusal::OutOfRange,
                Some(Action {
                    speed_scale: 1.01,
                    ..good
                }),
                0,
            ),
            (
                Refusal::OutOfRange,
                Some(Action {
                    speed_scale: -0.1,
                    ..good
                }),
                0,
            ),
        ];
        let obeyed = obedience.apply(PLANNED, Some(&good), 1000);
        assert_eq!(obeyed.refusal, None);
        for (reason, action, now_ns) in refused {
            let found = obedience.apply(PLANNED, action.as_ref(), now_ns);
            assert_eq!(found.refusal, Some(reason), "{action:?}");
            assert_eq!((found.target.speed_m_s, found.progress), (0.0, 0.0));
            assert_eq!(found.action_seq, 7, "the last action obeyed stays reported");
        }
    }

    #[test]
    fn a_command_beyond_the_limits_is_held_at_them() {
        let mut obedience = Obedience::new(&limits());
        let far = Action {
            curvature_offset: -5.0,
            ..action(RecoveryKind::Compensate)
        };
        let found = obedience.apply(PLANNED, Some(&far), 0);
        assert_eq!(found.target.curvature_1_m, -1.2);
    }
}

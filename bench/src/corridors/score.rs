//! What a mission in a corridor brought.

use vigil_blocks::{RecoveryKind, SensorFrame};
use vigil_robot::kinematics::wrap_angle;

use super::prices::CorridorPrices;
use crate::missions::{Measure, PresentFault, Prices, RuleOutput, measure, price_1_m};

/// A pose is wrong if it is off by so much, m and rad.
const WRONG_M: f64 = 0.25;
const WRONG_RAD: f64 = 0.1;
/// A robot whose true place is so near to the goal is there, m.
const AT_GOAL_M: f64 = 0.5;

/// A step of a drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<'a> {
    pub faults: &'a [PresentFault],
    pub obeyed: RuleOutput,
    /// Way of the body, m.
    pub moved_m: f64,
    /// Believed less true pose, m, m, rad.
    pub pose_error: [f64; 3],
    pub touches: bool,
    /// Speed that the path is planned with, m/s.
    pub planned_m_s: f64,
    pub dt_s: f64,
}

/// The pose of a frame less the true one, m, m, rad. The channels begin with the pose; where one is
/// not measured, its error is not known.
pub(super) fn pose_error(frame: &SensorFrame, pose: [f64; 3]) -> [f64; 3] {
    let error = |at: usize| frame.channel[at] - pose[at];
    [error(0), error(1), wrap_angle(error(2))]
}

/// What an order does about a fault: a manoeuvre about a wheel is driven with counter-steering.
const fn answer(order: RuleOutput) -> RuleOutput {
    match order.kind {
        RecoveryKind::GoThrough | RecoveryKind::MoveAway if order.wheels.stuck != 0 => RuleOutput {
            kind: RecoveryKind::Compensate,
            ..order
        },
        _ => order,
    }
}

/// What adds up while a mission is driven.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    pub score: CorridorScore,
    touched: bool,
    called: bool,
}

impl Tally {
    pub(super) fn add(&mut self, prices: &CorridorPrices, faults: &Prices, step: &Step<'_>) {
        let score = &mut self.score;
        let count = |is: bool| f64::from(u8::from(is));
        let calling = step.obeyed.kind == RecoveryKind::CallForHelp;
        let (calls, touches) = (calling && !self.called, step.touches && !self.touched);
        let [x_m, y_m, yaw_rad] = step.pose_error;
        let is_lost = x_m.hypot(y_m) > WRONG_M || yaw_rad.abs() > WRONG_RAD;
        let lost_m = count(is_lost) * step.moved_m;
        let speed = (step.moved_m / step.dt_s / step.planned_m_s).min(1.0);
        let price = price_1_m(faults, step.faults, answer(step.obeyed), speed);
        score.time_s += step.dt_s;
        score.calls += count(calls);
        score.touches += count(touches);
        score.lost_m += lost_m;
        score.points -= prices.time_1_s * step.dt_s
            + prices.call * count(calls)
            + prices.touch * count(touches)
            + prices.lost_1_m * lost_m
            + price * step.moved_m;
        (self.touched, self.called) = (step.touches, calling);
    }

    /// The robot holds its mission for done, `off_goal_m` from its true goal.
    pub(super) fn arrive(&mut self, prices: &CorridorPrices, off_goal_m: f64) {
        if off_goal_m <= AT_GOAL_M {
            self.score.done = 1.0;
            self.score.points += prices.goal;
        }
    }
}

/// A mission of one commander, measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CorridorScore {
    /// Points by the prices.
    pub points: f64,
    /// 1 if the robot came to its goal.
    pub done: f64,
    /// Time, s.
    pub time_s: f64,
    /// Calls for help.
    pub calls: f64,
    /// Times that it ran into something.
    pub touches: f64,
    /// Metres with a wrong pose.
    pub lost_m: f64,
}

/// The points, which decide.
pub(super) const POINTS: Measure<CorridorScore> = measure("points", "points", |s| s.points, 1);

/// Calls for help.
pub(super) const CALLS: Measure<CorridorScore> = measure("calls", "calls for help", |s| s.calls, 3);

/// Times that the robot ran into something.
pub(super) const TOUCHES: Measure<CorridorScore> =
    measure("touches", "ran into something", |s| s.touches, 3);

/// What is reported of a mission; the points first.
pub(super) const MEASURES: [Measure<CorridorScore>; 6] = [
    POINTS,
    measure("done", "came to the goal", |s| s.done, 3),
    measure("time_s", "time, s", |s| s.time_s, 1),
    CALLS,
    TOUCHES,
    measure("lost_m", "driven with a wrong pose, m", |s| s.lost_m, 2),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridors::CorridorFile;
    use crate::missions::Cause;
    use crate::missions::MissionFile;

    #[test]
    fn sums_over_a_mission_are_exact() {
        let (prices, faults) = (CorridorFile::read().unwrap(), MissionFile::read().unwrap());
        let mut tally = Tally::default();
        let stuck = [PresentFault {
            cause: Cause::Stuck(1),
            severity: 1.0,
        }];
        let healthy = Step {
            faults: &[],
            obeyed: RuleOutput::plain(RecoveryKind::GoOn),
            moved_m: 0.004,
            pose_error: [0.0; 3],
            touches: false,
            planned_m_s: 0.4,
            dt_s: 0.01,
        };
        let lost = Step {
            pose_error: [0.2, 0.2, 0.0],
            ..healthy
        };
        let touching = Step {
            moved_m: 0.0,
            touches: true,
            ..healthy
        };
        let calling = Step {
            moved_m: 0.0,
            obeyed: RuleOutput::plain(RecoveryKind::CallForHelp),
            ..healthy
        };
        let dragging = Step {
            faults: &stuck,
            ..healthy
        };
        for step in [
            healthy, lost, touching, healthy, touching, calling, dragging,
        ] {
            for _ in 0..100 {
                tally.add(&prices.prices, &faults.prices, &step);
            }
        }
        tally.arrive(&prices.prices, 0.6);
        let score = tally.score;
        assert_eq!((score.calls, score.touches, score.done), (1.0, 2.0, 0.0));
        assert!((score.lost_m - 0.4).abs() < 1e-9 && (score.time_s - 7.0).abs() < 1e-9);
        // 7 s, a call, two touches, 0.4 m lost, 0.4 m with a stuck wheel at full speed.
        let points = -7.0 - 300.0 - 100.0 - 20.0 - 80.0;
        assert!((score.points - points).abs() < 1e-9, "{}", score.points);
        tally.arrive(&prices.prices, 0.4);
        assert!((tally.score.points - points - 400.0).abs() < 1e-9);
    }
}

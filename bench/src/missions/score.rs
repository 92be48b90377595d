//! What a mission brought.

use vigil_blocks::{Action, RecoveryKind};

use super::ShippedGraph;

/// The true state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Truth {
    /// Index in the decision model.
    pub state: usize,
    /// The broken wheel, if the state is about one.
    pub wheel: Option<usize>,
    /// Wheels that are dragged.
    pub dragged: usize,
}

/// What the rover obeys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObeyedOrder {
    /// Index in the decision model.
    pub action: usize,
    /// Its kind.
    pub kind: RecoveryKind,
    /// The wheel that it is about.
    pub wheel: Option<usize>,
}

impl ObeyedOrder {
    /// What an action block says.
    #[must_use]
    pub fn new(action: &Action) -> Self {
        Self {
            action: action.action as usize,
            kind: RecoveryKind::from_repr(action.kind).unwrap_or(RecoveryKind::None),
            wheel: (action.wheel != u32::MAX).then_some(action.wheel as usize),
        }
    }

    /// True if the rover stands under it.
    #[must_use]
    pub const fn stands(&self) -> bool {
        matches!(
            self.kind,
            RecoveryKind::None | RecoveryKind::Stop | RecoveryKind::CallForHelp
        )
    }
}

/// What the decision model pays.
#[derive(Debug, Clone, Copy)]
pub struct Pay<'a> {
    shipped: &'a ShippedGraph,
    go_on: Option<usize>,
    epoch_s: f64,
}

impl<'a> Pay<'a> {
    /// As the shipped model states it, per epoch of the shipped supervisor.
    #[must_use]
    pub fn new(shipped: &'a ShippedGraph) -> Self {
        Self {
            shipped,
            go_on: shipped.action(RecoveryKind::GoOn),
            epoch_s: shipped.setup.file.supervisor.epoch_ms * 1e-3,
        }
    }

    /// Reward of `dt_s` under an action, in epochs' rewards. A remedy for another wheel than the
    /// broken one is worth no more than going on.
    #[must_use]
    pub fn reward(&self, truth: Truth, obeyed: ObeyedOrder, dt_s: f64) -> f64 {
        let model = self.shipped.model();
        let stated = model.reward(truth.state, obeyed.action);
        let is_wrong = |(at, broken): (usize, usize)| at != broken;
        let wheels = obeyed.wheel.zip(truth.wheel);
        let reward = match (wheels.is_some_and(is_wrong), self.go_on) {
            (true, Some(go_on)) => stated.min(model.reward(truth.state, go_on)),
            _ => stated,
        };
        reward * dt_s / self.epoch_s
    }
}

/// What adds up while a mission is driven.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    pub score: Score,
    stood: bool,
    called: bool,
}

/// A step of a drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub truth: Truth,
    pub obeyed: ObeyedOrder,
    /// True if standing is the best that can be done in this state.
    pub may_stand: bool,
    /// Way of the body, m.
    pub moved_m: f64,
    pub dt_s: f64,
}

impl Tally {
    pub(super) fn add(&mut self, pay: &Pay<'_>, step: &Step) {
        let Step { truth, obeyed, .. } = *step;
        let score = &mut self.score;
        score.time_s += step.dt_s;
        score.reward += pay.reward(truth, obeyed, step.dt_s);
        score.dragged_m += step.moved_m * truth.dragged as f64;
        let count = |is: bool| f64::from(u8::from(is));
        let stands = obeyed.stands();
        if stands && !step.may_stand {
            score.unnecessary_stops += count(!self.stood);
            score.unnecessary_s += step.dt_s;
        }
        let calls = obeyed.kind == RecoveryKind::CallForHelp;
        score.calls += count(calls && !self.called);
        (self.stood, self.called) = (stands, calls);
    }
}

/// A mission of one commander, measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Score {
    /// Reward of the decision model, summed over the epochs.
    pub reward: f64,
    /// Metres with a stuck wheel.
    pub dragged_m: f64,
    /// Times the rover stopped though it could have driven on.
    pub unnecessary_stops: f64,
    /// Time it so stood, s.
    pub unnecessary_s: f64,
    /// Calls for help.
    pub calls: f64,
    /// Time, s.
    pub time_s: f64,
    /// 1 if the plan was driven to its end.
    pub done: f64,
}

/// A figure of a mission.
#[derive(Debug, Clone, Copy)]
pub struct Measure {
    /// Name with unit, as in raw data.
    pub key: &'static str,
    /// In words, with unit.
    pub name: &'static str,
    /// Its value.
    pub of: fn(&Score) -> f64,
    /// Decimals shown.
    pub decimals: usize,
}

const fn measure(
    key: &'static str,
    name: &'static str,
    of: fn(&Score) -> f64,
    decimals: usize,
) -> Measure {
    Measure {
        key,
        name,
        of,
        decimals,
    }
}

/// What is reported of a mission; the reward first.
pub const MEASURES: [Measure; 7] = [
    measure("reward", "mission reward", |s| s.reward, 0),
    measure("dragged_m", "wheel dragged, m", |s| s.dragged_m, 2),
    measure(
        "unnecessary_stops",
        "unnecessary stops",
        |s| s.unnecessary_stops,
        3,
    ),
    measure("unnecessary_s", "so stood, s", |s| s.unnecessary_s, 2),
    measure("calls", "calls for help", |s| s.calls, 3),
    measure("time_s", "time, s", |s| s.time_s, 1),
    measure("done", "driven to the end", |s| s.done, 3),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> ShippedGraph {
        ShippedGraph::read(100.0).unwrap()
    }

    fn truth(shipped: &ShippedGraph, name: &str, wheel: Option<usize>) -> Truth {
        let state = shipped
            .model()
            .states()
            .iter()
            .position(|s| s == name)
            .unwrap();
        let dragged = usize::from(name.ends_with("STUCK"));
        Truth {
            state,
            wheel,
            dragged,
        }
    }

    fn obeyed(shipped: &ShippedGraph, kind: RecoveryKind, wheel: Option<usize>) -> ObeyedOrder {
        let action = shipped.action(kind).unwrap();
        ObeyedOrder {
            action,
            kind,
            wheel,
        }
    }

    #[test]
    fn rewards_are_those_of_the_model_per_epoch() {
        use RecoveryKind::{CallForHelp, Compensate, GoOn, IgnoreEncoder, SlowDown, Stop};
        let shipped = shipped();
        let pay = Pay::new(&shipped);
        let cases = [
            ("ND", None, GoOn, None, 1.0),
            ("ND", None, Compensate, Some(3), -2.0),
            ("RM_STUCK", Some(4), GoOn, None, -4.0),
            ("RM_STUCK", Some(4), Compensate, Some(4), 0.5),
            // The wrong wheel: as going on.
            ("RM_STUCK", Some(4), Compensate, Some(1), -4.0),
            ("LF_ENC", Some(0), IgnoreEncoder, Some(0), 0.95),
            ("LF_ENC", Some(0), IgnoreEncoder, Some(5), -1.0),
            ("LF_ENC", Some(0), Compensate, Some(5), -2.0),
            ("LF_ENC", Some(0), SlowDown, None, -0.3),
            ("UNKNOWN", None, Stop, None, -1.2),
            ("UNKNOWN", None, CallForHelp, None, -0.5),
        ];
        for (state, wheel, kind, about, per_epoch) in cases {
            let truth = truth(&shipped, state, wheel);
            let obeyed = obeyed(&shipped, kind, about);
            // An epoch is 0.1 s.
            let found = pay.reward(truth, obeyed, 0.025);
            assert!(
                (found - per_epoch / 4.0).abs() < 1e-12,
                "{state} {kind:?}: {found}"
            );
        }
        assert!(shipped.may_stand(truth(&shipped, "UNKNOWN", None).state));
        for driving in ["ND", "LF_STUCK", "RR_ENC"] {
            assert!(!shipped.may_stand(truth(&shipped, driving, None).state));
        }
    }

    #[test]
    fn sums_over_a_mission_are_exact() {
        use RecoveryKind::{CallForHelp, Compensate, GoOn, Stop};
        let shipped = shipped();
        let pay = Pay::new(&shipped);
        let mut tally = Tally::default();
        let healthy = truth(&shipped, "ND", None);
        let stuck = truth(&shipped, "LM_STUCK", Some(1));
        let unknown = truth(&shipped, "UNKNOWN", None);
        let script = [
            (healthy, GoOn, None, 1.0),
            (healthy, Stop, None, 0.0),
            (stuck, Stop, None, 0.0),
            (stuck, Compensate, Some(1), 1.0),
            (stuck, CallForHelp, None, 0.0),
            (unknown, GoOn, None, 1.0),
            (unknown, CallForHelp, None, 0.0),
        ];
        // Each for 2 s of 0.1 m/s in steps of 20 ms, if it moves.
        for (truth, kind, about, moves) in script {
            let step = Step {
                truth,
                obeyed: obeyed(&shipped, kind, about),
                may_stand: shipped.may_stand(truth.state),
                moved_m: 0.002 * moves,
                dt_s: 0.02,
            };
            (0..100).for_each(|_| tally.add(&pay, &step));
        }
        let score = tally.score;
        let reward = 20.0 * (1.0 - 1.2 - 1.2 + 0.5 - 6.0 - 6.0 - 0.5);
        assert!((score.reward - reward).abs() < 1e-9, "{}", score.reward);
        assert!((score.dragged_m - 0.2).abs() < 1e-9);
        // One stop, healthy and on with a wheel stuck; one call with a named fault. The last call
        // is the best that can be done.
        assert_eq!((score.unnecessary_stops, score.calls), (2.0, 2.0));
        assert!((score.unnecessary_s - 6.0).abs() < 1e-9);
        assert!((score.time_s - 14.0).abs() < 1e-9);
    }
}

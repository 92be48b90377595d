//! Vigil, but at times it tries something else: what is never tried is never learned about.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{Action, ActionOutcome, RecoveryKind, SensorFrame};
use vigil_decision::{SupervisorError, actions_with_outcome};
use vigil_setup::Setup;

/// Actions with an end that are tried in another's place.
const TRIED: [RecoveryKind; 4] = [
    RecoveryKind::NewPath,
    RecoveryKind::Relocalise,
    RecoveryKind::GoThrough,
    RecoveryKind::MoveAway,
];

/// An action of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tried {
    action: u32,
    kind: RecoveryKind,
    reports_outcome: bool,
}

/// Replaces a share of the decisions by one of [`TRIED`], evenly drawn.
#[derive(Debug, Clone)]
pub(super) struct Explorer {
    share: f64,
    rng: Pcg64Mcg,
    actions: Vec<Tried>,
    follow: u32,
    decision_seq: u64,
    step_count: u64,
    /// The supervisor's own action of the present decision, and what is done instead.
    own: u32,
    instead: Option<Tried>,
}

impl Explorer {
    /// # Errors
    /// A decision model whose observations are no sets of symptoms.
    pub(super) fn new(setup: &Setup, share: f64, seed: u64) -> Result<Self, SupervisorError> {
        let supervisor = &setup.file.supervisor;
        let (kinds, own) = (&supervisor.actions, &supervisor.symptoms);
        let reports = actions_with_outcome(&setup.decision, own)?;
        let names = setup.decision.actions().iter().zip(0..).zip(reports);
        let all: Vec<Tried> = names
            .filter_map(|((name, action), reports_outcome)| {
                let kind = RecoveryKind::from(kinds.get(name)?.kind);
                Some(Tried {
                    action,
                    kind,
                    reports_outcome,
                })
            })
            .collect();
        let follow = all.iter().find(|it| it.kind == RecoveryKind::GoOn);
        Ok(Self {
            share,
            rng: Pcg64Mcg::seed_from_u64(seed ^ 0x7e9_1e57),
            follow: follow.map_or(0, |it| it.action),
            actions: all
                .into_iter()
                .filter(|it| TRIED.contains(&it.kind))
                .collect(),
            decision_seq: 0,
            step_count: 0,
            own: 0,
            instead: None,
        })
    }

    /// Changes an action block to what is done, and its last step to what was done.
    pub(super) fn change(&mut self, action: &mut Action, frame: &SensorFrame) {
        let before = std::mem::replace(&mut self.step_count, action.step_count);
        if before != action.step_count
            && let Some(done) = self.instead
        {
            action.step_action = self.step_action(done, action.step_action, frame);
        }
        if std::mem::replace(&mut self.decision_seq, action.decision_seq) != action.decision_seq {
            self.own = action.action;
            let has_end = self.actions.iter().any(|it| it.action == action.action);
            let tries = has_end && self.rng.random_bool(self.share);
            self.instead =
                tries.then(|| self.actions[self.rng.random_range(0..self.actions.len())]);
        }
        if let Some(instead) = self.instead.filter(|_| action.action == self.own) {
            action.action = instead.action;
            action.kind = instead.kind as u32;
            action.speed_scale = 1.0;
        }
    }

    /// As the supervisor counts steps: what was not done is one of following the path, but where
    /// the model expects an outcome, that none came is a step of its own.
    fn step_action(&self, done: Tried, said: u32, frame: &SensorFrame) -> u32 {
        match ActionOutcome::from_repr(frame.action_outcome) {
            Some(ActionOutcome::Succeeded) => done.action,
            Some(ActionOutcome::Failed) if done.reports_outcome => done.action,
            _ if said == self.own => self.follow,
            _ => said,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridors::CorridorGraph;
    use crate::variation::Variation;

    struct Corridor {
        explorer: Explorer,
        names: Vec<String>,
        decisions: u64,
        steps: u64,
    }

    impl Corridor {
        fn new(share: f64) -> Self {
            let setup = CorridorGraph::read(Variation::default(), None)
                .unwrap()
                .setup;
            Self {
                explorer: Explorer::new(&setup, share, 7).unwrap(),
                names: setup.decision.actions().to_vec(),
                decisions: 0,
                steps: 0,
            }
        }

        fn index(&self, name: &str) -> u32 {
            self.names.iter().position(|it| it == name).unwrap() as u32
        }

        /// The supervisor decides on this action, after a step of the one before, of which the
        /// robot says this. What is done, and which step is said to have been made.
        fn decides(&mut self, name: &str, of: &str, outcome: ActionOutcome) -> (String, String) {
            self.decisions += 1;
            self.steps += 1;
            let mut action = Action {
                action: self.index(name),
                decision_seq: self.decisions,
                step_count: self.steps,
                step_action: self.index(of),
                ..Action::default()
            };
            let frame = SensorFrame {
                action_outcome: outcome as u32,
                ..SensorFrame::default()
            };
            self.explorer.change(&mut action, &frame);
            let name = |action: u32| self.names[action as usize].clone();
            (name(action.action), name(action.step_action))
        }
    }

    #[test]
    fn nothing_is_tried_with_a_share_of_0() {
        let mut corridor = Corridor::new(0.0);
        for _ in 0..20 {
            let done = corridor.decides("GO", "FP", ActionOutcome::Succeeded);
            assert_eq!(done, ("GO".to_owned(), "FP".to_owned()));
        }
    }

    #[test]
    fn what_was_tried_is_what_is_said_to_have_been_done() {
        let mut corridor = Corridor::new(1.0);
        let (mut before, _) = corridor.decides("GO", "FP", ActionOutcome::None);
        let mut tried = vec![before.clone()];
        for _ in 0..40 {
            // It was asked for GO, and has done what was tried instead.
            let (done, made) = corridor.decides("GO", "GO", ActionOutcome::Succeeded);
            assert_eq!(made, before);
            tried.push(done.clone());
            before = done;
        }
        tried.sort();
        tried.dedup();
        assert_eq!(tried.len(), TRIED.len(), "{tried:?}");
        // What cannot be done is a step of following the path, but where the robot reports it.
        for _ in 0..40 {
            let (done, made) = corridor.decides("GO", "GO", ActionOutcome::Failed);
            let reports = ["NP", "GO"].contains(&before.as_str());
            assert_eq!(
                made,
                if reports { before.as_str() } else { "FP" },
                "{before}"
            );
            before = done;
        }
        // An action without an end is not replaced.
        let (done, _) = corridor.decides("FP", "GO", ActionOutcome::None);
        assert_eq!(done, "FP");
    }
}

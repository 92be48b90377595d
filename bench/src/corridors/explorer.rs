//! Vigil, but at times it tries something else: what is never tried is never learned about.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{Action, ActionOutcome, RecoveryKind, SensorFrame};
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
    pub(super) fn new(setup: &Setup, share: f64, seed: u64) -> Self {
        let names = setup.decision.actions().iter().zip(0..);
        let kinds = &setup.file.supervisor.actions;
        let all: Vec<Tried> = names
            .filter_map(|(name, action)| {
                let kind = RecoveryKind::from(kinds.get(name)?.kind);
                Some(Tried { action, kind })
            })
            .collect();
        let follow = all.iter().find(|it| it.kind == RecoveryKind::GoOn);
        Self {
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
        }
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

    /// As the supervisor counts steps: what was not done is one of following the path, but a new
    /// path or an opening that was not found is a step of its own.
    fn step_action(&self, done: Tried, said: u32, frame: &SensorFrame) -> u32 {
        let reports = [RecoveryKind::NewPath, RecoveryKind::GoThrough].contains(&done.kind);
        match ActionOutcome::from_repr(frame.action_outcome) {
            Some(ActionOutcome::Succeeded) => done.action,
            Some(ActionOutcome::Failed) if reports => done.action,
            _ if said == self.own => self.follow,
            _ => said,
        }
    }
}

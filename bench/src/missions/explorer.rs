//! Vigil, but after an alarm it may go on or slow down whatever it would do: how much an action
//! shows is seen only where nobody chose it for what had been seen.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{Action, RecoveryKind};
use vigil_setup::Setup;

use super::order::action_block;
use super::rules::RuleOutput;

/// What is tried.
const TRIED: [RecoveryKind; 2] = [RecoveryKind::GoOn, RecoveryKind::SlowDown];
/// How long, s: as long as evidence comes, as a rule.
const TRIED_S: f64 = 1.0;

/// Replaces the decisions after a share of the alarms by one of [`TRIED`], evenly drawn.
#[derive(Debug, Clone)]
pub(super) struct Explorer {
    share: f64,
    rng: Pcg64Mcg,
    /// The actions as blocks.
    tried: Vec<Action>,
    alarm_count: u32,
    /// What is done instead, and for how long.
    instead: Option<(usize, f64)>,
}

impl Explorer {
    pub(super) fn new(setup: &Setup, share: f64, seed: u64) -> Self {
        let names = setup.decision.actions().iter().zip(0..);
        let kinds = &setup.file.supervisor.actions;
        let tried = names.filter_map(|(name, action)| {
            let of = kinds.get(name)?;
            let kind = RecoveryKind::from(of.kind);
            let block = action_block(setup, RuleOutput::plain(kind));
            let speed_scale = of.speed_scale.unwrap_or(block.speed_scale);
            TRIED.contains(&kind).then_some(Action {
                action,
                speed_scale,
                ..block
            })
        });
        Self {
            share,
            rng: Pcg64Mcg::seed_from_u64(seed ^ 0x7e9_1e57),
            tried: tried.collect(),
            alarm_count: 0,
            instead: None,
        }
    }

    /// Changes an action block to what is done.
    pub(super) fn change(&mut self, action: &mut Action, dt_s: f64) {
        if std::mem::replace(&mut self.alarm_count, action.alarm_count) < action.alarm_count {
            let tries = !self.tried.is_empty() && self.rng.random_bool(self.share);
            self.instead = tries.then(|| (self.rng.random_range(0..self.tried.len()), TRIED_S));
        }
        let Some((at, left_s)) = self.instead else {
            return;
        };
        self.instead = (left_s > dt_s).then_some((at, left_s - dt_s));
        let done = &self.tried[at];
        action.action = done.action;
        action.kind = done.kind;
        action.speed_scale = done.speed_scale;
        action.curvature_gain = done.curvature_gain;
        action.curvature_offset = done.curvature_offset;
        action.stuck_wheels = done.stuck_wheels;
        action.broken_encoders = done.broken_encoders;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::ShippedGraph;
    use crate::variation::Variation;

    /// Speeds over two alarms, of which each is answered by a call.
    fn speeds(share: f64, seed: u64) -> Vec<f64> {
        let shipped = ShippedGraph::read("rover.toml".as_ref(), Variation::default()).unwrap();
        let mut explorer = Explorer::new(&shipped.setup, share, seed);
        let alarms = (0..600).map(|k| k / 300);
        let changed = alarms.map(|before| {
            let mut action = Action {
                alarm_count: before + 1,
                kind: RecoveryKind::CallForHelp as u32,
                stuck_wheels: 1,
                ..Action::default()
            };
            explorer.change(&mut action, 0.01);
            let is_own = action.kind == RecoveryKind::CallForHelp as u32;
            assert_eq!(action.stuck_wheels, u16::from(is_own));
            action.speed_scale
        });
        changed.collect()
    }

    #[test]
    fn a_second_after_an_alarm_something_else_is_done() {
        assert!(speeds(0.0, 1).iter().all(|speed| *speed == 0.0));
        let mut drawn = Vec::new();
        for seed in 0..10 {
            for of_one in speeds(1.0, seed).chunks(300) {
                let tried = of_one.iter().take_while(|speed| **speed == of_one[0]);
                assert!((100..=101).contains(&tried.count()));
                assert!(of_one[101..].iter().all(|speed| *speed == 0.0));
                drawn.push(of_one[0]);
            }
        }
        assert!(drawn.contains(&1.0) && drawn.contains(&0.5), "{drawn:?}");
    }
}

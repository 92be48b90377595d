//! From frames to actions.

use std::error::Error;

use vigil_blocks::{Action, FaultBelief, MODE_MULTIPLE, RecoveryKind, SensorFrame};
use vigil_evaluation::stages::Stages;

use super::ShippedGraph;
use super::breakdown::Cause;
use super::rules::{Follower, Rule, RuleInput, RuleOutput};
use super::told::{self, Knowledge};
use crate::simulated;

/// Who commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Arm {
    /// Detector, identifier and supervisor as they ship.
    Vigil,
    /// Rules over detector and identifier.
    Rule(Rule),
    /// As Vigil, with decisions by Q-MDP: of the same model, without what information is worth.
    Heuristic,
    /// Nobody watches: as planned, whatever happens.
    Without,
    /// Told what breaks when it begins, and how it will go on.
    Told,
}

impl Arm {
    /// In words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Vigil => "Vigil",
            Self::Rule(rule) => rule.name(),
            Self::Heuristic => "Q-MDP",
            Self::Without => "without",
            Self::Told => "told the fault",
        }
    }
}

/// One of the commanders.
pub(super) struct Commander<'a> {
    shipped: &'a ShippedGraph,
    mind: Mind,
    /// Leaves of the tree with what they mean.
    leaves: Vec<(usize, Cause)>,
    action: Box<Action>,
}

enum Mind {
    Vigil(Box<Stages>),
    Rule(Box<Stages>, Rule, Follower),
    Without,
    Told,
}

impl<'a> Commander<'a> {
    pub(super) fn new(
        shipped: &'a ShippedGraph,
        arm: Arm,
        seed: u64,
    ) -> Result<Self, Box<dyn Error>> {
        let file = &shipped.setup.file;
        let (sensors, rate_hz) = (file.detector.sensors, file.graph.rate_hz);
        let of = |setup| simulated::stages(setup, sensors, rate_hz, seed).map(Box::new);
        let stages = || of(&shipped.setup);
        let mind = match arm {
            Arm::Vigil => Mind::Vigil(stages()?),
            Arm::Heuristic => Mind::Vigil(of(&shipped.heuristic)?),
            Arm::Rule(rule) => Mind::Rule(stages()?, rule, Follower::new(rule)),
            Arm::Without => Mind::Without,
            Arm::Told => Mind::Told,
        };
        Ok(Self {
            shipped,
            mind,
            leaves: leaves(shipped),
            action: Box::default(),
        })
    }

    /// The action after a frame; `dt_s` is the time between frames. Only who is told knows.
    pub(super) fn command(
        &mut self,
        frame: &SensorFrame,
        knowledge: &Knowledge<'_>,
        dt_s: f64,
    ) -> &Action {
        let output = match &mut self.mind {
            Mind::Vigil(stages) => {
                stages.take(frame);
                *self.action = *stages.action();
                return &self.action;
            }
            Mind::Rule(stages, _, follower) => {
                stages.take(frame);
                let (explanation, p) = most_probable(&self.leaves, stages.diagnosis());
                let alarm = stages.detection().alarm != 0;
                let input = RuleInput {
                    alarm,
                    explanation,
                    p,
                    several: stages.diagnosis().mode == MODE_MULTIPLE,
                };
                follower.answer(input, dt_s)
            }
            Mind::Without => RuleOutput::plain(RecoveryKind::GoOn),
            Mind::Told => told::best(&self.shipped.missions.prices, knowledge),
        };
        self.set_action(output);
        &self.action
    }

    /// Whoever has helped restarts what remembers; the filters see a new run.
    pub(super) fn begin_anew(&mut self) {
        if let Mind::Rule(_, rule, follower) = &mut self.mind {
            *follower = Follower::new(*rule);
        }
    }

    /// The action block of a kind, as the supervisor would write it.
    fn set_action(&mut self, output: RuleOutput) {
        let RuleOutput { kind, wheel } = output;
        let steers = wheel.filter(|_| kind == RecoveryKind::Compensate);
        let straight = (1.0, 0.0);
        let (gain, offset) = steers.map_or(straight, |w| self.shipped.setup.model.compensation(w));
        *self.action = Action {
            decision_seq: 1,
            kind: kind as u32,
            wheel: wheel.map_or(u32::MAX, |wheel| wheel as u32),
            speed_scale: output.speed_scale(),
            curvature_gain: gain,
            curvature_offset: offset,
            valid_until_ns: u64::MAX,
            ..Action::default()
        };
    }
}

fn leaves(shipped: &ShippedGraph) -> Vec<(usize, Cause)> {
    let tree = &shipped.setup.tree;
    let meaning = |node: usize| {
        let fault = tree.nodes().get(node)?.fault.as_deref()?;
        let (kind, wheel) = fault.split_once(':')?;
        let wheel = shipped.setup.robot.wheel_index(wheel)?;
        let cause = match kind {
            "stuck" => Cause::Stuck(wheel),
            _ => Cause::Encoder(wheel),
        };
        Some((node, cause))
    };
    tree.leaves().filter_map(meaning).collect()
}

/// The most probable explanation, `None` for none, and its probability. Ties go to none, then to
/// the leaf that comes first.
fn most_probable(leaves: &[(usize, Cause)], belief: &FaultBelief) -> (Option<Cause>, f64) {
    let mut best = (None, belief.p[0]);
    for &(node, cause) in leaves {
        let p = belief.p.get(node).copied().unwrap_or(0.0);
        if p > best.1 {
            best = (Some(cause), p);
        }
    }
    if belief.p_unknown > best.1 {
        best = (Some(Cause::Unmodelled), belief.p_unknown);
    }
    best
}

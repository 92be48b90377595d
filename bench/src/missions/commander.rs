//! From frames to actions.

use std::error::Error;

use vigil_blocks::{Action, FaultBelief, RecoveryKind, SensorFrame};

use super::arm::Arm;
use super::escalation::{Escalation, Explanation, RuleInput, RuleOutput};
use super::{ShippedGraph, Truth};
use crate::simulated;
use vigil_evaluation::stages::Stages;

/// One of the commanders.
pub(super) struct Commander<'a> {
    shipped: &'a ShippedGraph,
    mind: Mind,
    /// Leaves of the tree with what they mean.
    leaves: Vec<(usize, Explanation)>,
    action: Box<Action>,
}

enum Mind {
    Vigil(Box<Stages>),
    Without,
    Escalation(Box<Stages>, Escalation),
    StopAndCall(Box<Stages>),
    Oracle,
}

impl<'a> Commander<'a> {
    pub(super) fn new(
        shipped: &'a ShippedGraph,
        arm: Arm,
        seed: u64,
    ) -> Result<Self, Box<dyn Error>> {
        let file = &shipped.setup.file;
        let (sensors, rate_hz) = (file.detector.sensors, file.graph.rate_hz);
        let stages = || simulated::stages(&shipped.setup, sensors, rate_hz, seed).map(Box::new);
        let mind = match arm {
            Arm::Vigil => Mind::Vigil(stages()?),
            Arm::Without => Mind::Without,
            Arm::Escalation => Mind::Escalation(stages()?, Escalation::default()),
            Arm::StopAndCall => Mind::StopAndCall(stages()?),
            Arm::Oracle => Mind::Oracle,
        };
        let leaves = leaves(shipped);
        Ok(Self {
            shipped,
            mind,
            leaves,
            action: Box::default(),
        })
    }

    /// The action after a frame; `dt_s` is the time between frames. Only the oracle looks at the
    /// truth.
    pub(super) fn command(&mut self, frame: &SensorFrame, truth: Truth, dt_s: f64) -> &Action {
        let order = |kind| RuleOutput { kind, wheel: None };
        let output = match &mut self.mind {
            Mind::Vigil(stages) => {
                stages.take(frame);
                *self.action = *stages.action();
                return &self.action;
            }
            Mind::Without => order(RecoveryKind::GoOn),
            Mind::Escalation(stages, rules) => {
                stages.take(frame);
                let alarm = stages.detection().alarm != 0;
                let explanation = most_probable(&self.leaves, stages.diagnosis());
                rules.answer(RuleInput { alarm, explanation }, dt_s)
            }
            Mind::StopAndCall(stages) => {
                stages.take(frame);
                match stages.detection().alarm {
                    0 => order(RecoveryKind::GoOn),
                    _ => order(RecoveryKind::CallForHelp),
                }
            }
            Mind::Oracle => RuleOutput {
                kind: self.shipped.kind(self.shipped.solution.best(truth.state)),
                wheel: truth.wheel,
            },
        };
        self.set_action(output);
        self.action.valid_until_ns = u64::MAX;
        &self.action
    }

    /// Whoever has helped restarts what remembers; the filters see a new run.
    pub(super) fn begin_anew(&mut self) {
        if let Mind::Escalation(_, rules) = &mut self.mind {
            *rules = Escalation::default();
        }
    }

    /// The action block of a kind, as the supervisor would write it.
    fn set_action(&mut self, RuleOutput { kind, wheel }: RuleOutput) {
        let action = self.shipped.action(kind).unwrap_or_default();
        let steers = wheel.filter(|_| kind == RecoveryKind::Compensate);
        let straight = (1.0, 0.0);
        let (gain, offset) = steers.map_or(straight, |w| self.shipped.setup.model.compensation(w));
        let remedies = matches!(kind, RecoveryKind::Compensate | RecoveryKind::IgnoreEncoder);
        let about = wheel.filter(|_| remedies);
        *self.action = Action {
            decision_seq: 1,
            action: action as u32,
            kind: kind as u32,
            wheel: about.map_or(u32::MAX, |wheel| wheel as u32),
            speed_scale: self.shipped.speed_scale(action),
            curvature_gain: gain,
            curvature_offset: offset,
            ..Action::default()
        };
    }
}

fn leaves(shipped: &ShippedGraph) -> Vec<(usize, Explanation)> {
    let tree = &shipped.setup.tree;
    let meaning = |node: usize| {
        let fault = tree.nodes().get(node)?.fault.as_deref()?;
        let (kind, wheel) = fault.split_once(':')?;
        let wheel = shipped.setup.robot.wheel_index(wheel)?;
        let explanation = match kind {
            "stuck" => Explanation::Stuck(wheel),
            _ => Explanation::Encoder(wheel),
        };
        Some((node, explanation))
    };
    tree.leaves().filter_map(meaning).collect()
}

/// Ties go to nominal, then to the leaf that comes first.
fn most_probable(leaves: &[(usize, Explanation)], belief: &FaultBelief) -> Explanation {
    let mut best = (Explanation::Nominal, belief.p[0]);
    for &(node, explanation) in leaves {
        let p = belief.p.get(node).copied().unwrap_or(0.0);
        if p > best.1 {
            best = (explanation, p);
        }
    }
    if belief.p_unknown > best.1 {
        best.0 = Explanation::Unknown;
    }
    best.0
}

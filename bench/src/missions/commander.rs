//! From frames to actions.

use std::error::Error;

use vigil_blocks::{Action, RecoveryKind, SensorFrame};
use vigil_evaluation::stages::Stages;

use super::ShippedGraph;
use super::explanation::Explanations;
use super::explorer::Explorer;
use super::order::action_block;
use super::rules::{Follower, Rule, RuleOutput};
use super::told::{self, Knowledge};
use crate::simulated;

/// Who commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Arm {
    /// Detector, identifier and supervisor as they ship.
    Vigil,
    /// The same, which after this share of the alarms tries something else.
    Explorer(f64),
    /// Rules over detector and identifier.
    Rule(Rule),
    /// As Vigil, with decisions by Q-MDP: of the same model, without what information is worth.
    Heuristic,
    /// Nobody watches: as planned, whatever happens.
    Without,
    /// Told what breaks when it begins, and how it will go on.
    Told,
    /// Told the same from the detector's first alarm on, and as planned before: what no decision
    /// after the alarm can better.
    ToldAtAlarm,
}

impl Arm {
    /// In words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Vigil => "Vigil",
            Self::Explorer(_) => "explorer",
            Self::Rule(rule) => rule.name(),
            Self::Heuristic => "Q-MDP",
            Self::Without => "without",
            Self::Told => "told the fault",
            Self::ToldAtAlarm => "told at the alarm",
        }
    }
}

/// One of the commanders.
pub(super) struct Commander<'a> {
    shipped: &'a ShippedGraph,
    mind: Mind,
    explanations: Explanations,
    action: Box<Action>,
}

enum Mind {
    Vigil(Box<Stages>, Option<Explorer>),
    Rule(Box<Stages>, Rule, Follower),
    Without,
    Told,
    /// True once the detector has alarmed while something was wrong.
    ToldAtAlarm(Box<Stages>, bool),
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
            Arm::Vigil => Mind::Vigil(stages()?, None),
            Arm::Explorer(share) => {
                let explorer = Explorer::new(&shipped.setup, share, seed);
                Mind::Vigil(stages()?, Some(explorer))
            }
            Arm::Heuristic => Mind::Vigil(of(&shipped.heuristic)?, None),
            Arm::Rule(rule) => Mind::Rule(stages()?, rule, Follower::new(rule)),
            Arm::Without => Mind::Without,
            Arm::Told => Mind::Told,
            Arm::ToldAtAlarm => Mind::ToldAtAlarm(stages()?, false),
        };
        Ok(Self {
            shipped,
            mind,
            explanations: Explanations::new(&shipped.setup),
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
            Mind::Vigil(stages, explorer) => {
                stages.take(frame);
                *self.action = *stages.action();
                if let Some(explorer) = explorer {
                    explorer.change(&mut self.action, dt_s);
                }
                return &self.action;
            }
            Mind::Rule(stages, _, follower) => {
                stages.take(frame);
                let (detection, diagnosis) = (stages.detection(), stages.diagnosis());
                follower.answer(self.explanations.input(detection, diagnosis), dt_s)
            }
            Mind::Without => RuleOutput::plain(RecoveryKind::GoOn),
            Mind::Told => told::best(&self.shipped.missions.prices, knowledge),
            Mind::ToldAtAlarm(stages, is_told) => {
                stages.take(frame);
                *is_told |= stages.detection().alarm != 0 && !knowledge.present.is_empty();
                match is_told {
                    true => told::best(&self.shipped.missions.prices, knowledge),
                    false => RuleOutput::plain(RecoveryKind::GoOn),
                }
            }
        };
        *self.action = action_block(&self.shipped.setup, output);
        &self.action
    }

    /// Whoever has helped restarts what remembers; the filters see a new run.
    pub(super) fn begin_anew(&mut self) {
        match &mut self.mind {
            Mind::Rule(_, rule, follower) => *follower = Follower::new(*rule),
            Mind::ToldAtAlarm(_, is_told) => *is_told = false,
            Mind::Vigil(..) | Mind::Without | Mind::Told => {}
        }
    }
}

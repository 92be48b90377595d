//! From frames to actions.

use std::error::Error;

use vigil_blocks::{Action, ActionOutcome, RecoveryKind, SensorFrame, Symptoms};
use vigil_evaluation::stages::Stages;
use vigil_setup::Setup;

use super::explorer::Explorer;
use super::ladder::{Escalation, EscalationSettings, LadderInput};
use crate::missions::{Explanations, RuleOutput, action_block};
use crate::simulated;

/// Symptoms of the monitors: what else a frame holds is the outcome of an action.
const MONITORS: u32 = Symptoms::EPS | Symptoms::EPM | Symptoms::LD | Symptoms::SD;

/// Who commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CorridorArm {
    /// Detector, identifier and supervisor as they ship.
    Vigil,
    /// An escalation ladder over monitors, detector and identifier.
    Ladder(EscalationSettings),
    /// Nobody watches: along the path, whatever happens.
    Without,
    /// Vigil, but it tries something else in this share of its decisions.
    Explorer(f64),
}

impl CorridorArm {
    /// In words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Vigil => "Vigil",
            Self::Ladder(_) => "ladder",
            Self::Without => "without",
            Self::Explorer(_) => "explorer",
        }
    }
}

/// One of the commanders.
pub(super) struct CorridorCommander<'a> {
    setup: &'a Setup,
    mind: Mind,
    explanations: Explanations,
    action: Box<Action>,
}

enum Mind {
    /// With what tries something else, if anything does.
    Vigil(Box<Stages>, Option<Explorer>),
    Ladder(Box<Stages>, Escalation),
    Without,
}

impl<'a> CorridorCommander<'a> {
    pub(super) fn new(
        setup: &'a Setup,
        arm: CorridorArm,
        seed: u64,
    ) -> Result<Self, Box<dyn Error>> {
        let (sensors, rate_hz) = (setup.file.detector.sensors, setup.file.graph.rate_hz);
        let stages = || simulated::stages(setup, sensors, rate_hz, seed).map(Box::new);
        let mind = match arm {
            CorridorArm::Vigil => Mind::Vigil(stages()?, None),
            CorridorArm::Ladder(settings) => Mind::Ladder(stages()?, Escalation::new(settings)),
            CorridorArm::Without => Mind::Without,
            CorridorArm::Explorer(share) => {
                Mind::Vigil(stages()?, Some(Explorer::new(setup, share, seed)?))
            }
        };
        Ok(Self {
            setup,
            mind,
            explanations: Explanations::new(setup),
            action: Box::default(),
        })
    }

    /// The action after a frame; `dt_s` is the time between frames.
    pub(super) fn command(&mut self, frame: &SensorFrame, dt_s: f64) -> &Action {
        let (output, number) = match &mut self.mind {
            Mind::Vigil(stages, explorer) => {
                stages.take(frame);
                *self.action = *stages.action();
                if let Some(explorer) = explorer {
                    explorer.change(&mut self.action, frame);
                }
                return &self.action;
            }
            Mind::Ladder(stages, ladder) => {
                stages.take(frame);
                let (detection, diagnosis) = (stages.detection(), stages.diagnosis());
                let outcome = ActionOutcome::from_repr(frame.action_outcome);
                let input = LadderInput {
                    symptoms: detection.symptoms & MONITORS,
                    outcome: outcome.unwrap_or(ActionOutcome::None),
                    hardware: self.explanations.input(detection, diagnosis),
                };
                let order = ladder.order(input, dt_s);
                (order.output, order.number)
            }
            Mind::Without => (RuleOutput::plain(RecoveryKind::GoOn), 1),
        };
        *self.action = Action {
            decision_seq: number,
            ..action_block(self.setup, output)
        };
        &self.action
    }
}

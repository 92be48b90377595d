//! Detector and identifier over recorded runs, as they run live.

use vigil_blocks::{
    DetectionBelief, Entry, FaultBelief, MODE_BLIND, MODE_MULTIPLE, MODE_UNKNOWN, ParticleBlock,
    SensorFrame, SizeKind,
};
use vigil_decision::fused_alarm;
use vigil_diagnosis::detect::{self, Detector, DetectorError};
use vigil_diagnosis::identify::{
    self, Diagnoser, Identifier, IdentifierError, Input, Models, NominalIdentifier,
};
use vigil_evaluation::scoring::field::BLIND;
use vigil_evaluation::scoring::{MULTIPLE, Side, Taxonomy, UNKNOWN, Verdict};
use vigil_recording::frames::Run;
use vigil_robot::FaultTree;
use vigil_robot::{Description, nominal};

use crate::recovery::{Recoverer, RecoveryRun};

/// Velocity from which a robot counts as driving, m/s and rad/s.
const DRIVES: f64 = 0.005;

/// Why a pipeline was refused.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The detector's reason.
    #[error(transparent)]
    Detector(#[from] DetectorError),
    /// The identifier's reason.
    #[error(transparent)]
    Identifier(#[from] IdentifierError),
}

/// Detector, identifier and, with a decision model, supervisor in one process.
pub struct Pipeline {
    robot: Description,
    recoverer: Option<Recoverer>,
    detector: Detector,
    identifier: Diagnoser,
    taxonomy: Taxonomy,
    detection: Box<DetectionBelief>,
    detected: Box<ParticleBlock>,
    diagnosis: Box<FaultBelief>,
    diagnosed: Box<ParticleBlock>,
}

impl Pipeline {
    /// A pipeline with the settings of a graph; `seed` is the graph's.
    ///
    /// # Errors
    /// [`PipelineError`] if model, robot, tree and settings do not fit together.
    pub fn new(
        models: &Models<'_>,
        detector: &detect::Settings,
        identifier: &identify::Settings,
        seed: u64,
    ) -> Result<Self, PipelineError> {
        let prior_unknown = identifier.p_unknown;
        let identifier = Identifier::new(models, identifier, detector.sensors, seed)?;
        Ok(Self::assemble(
            Detector::new(models.model, models.robot, detector)?,
            Diagnoser::from(identifier),
            Taxonomy::new(models.tree, models.robot).with_prior_unknown(prior_unknown),
            models.robot,
        ))
    }

    /// A pipeline for a robot of which only the nominal behaviour is known.
    ///
    /// # Errors
    /// [`PipelineError`] if model, robot and settings do not fit together.
    pub fn nominal(
        model: &nominal::Model,
        robot: &Description,
        tree: &FaultTree,
        detector: &detect::Settings,
    ) -> Result<Self, PipelineError> {
        Ok(Self::assemble(
            Detector::nominal(model, robot, detector)?,
            Diagnoser::from(NominalIdentifier::new(tree)),
            Taxonomy::new(tree, robot),
            robot,
        ))
    }

    fn assemble(
        detector: Detector,
        identifier: Diagnoser,
        taxonomy: Taxonomy,
        robot: &Description,
    ) -> Self {
        Self {
            taxonomy,
            robot: robot.clone(),
            recoverer: None,
            detector,
            identifier,
            detection: Box::default(),
            detected: Box::default(),
            diagnosis: Box::default(),
            diagnosed: Box::default(),
        }
    }

    /// Decides on actions, too.
    pub fn recovering(mut self, recoverer: Option<Recoverer>) -> Self {
        self.recoverer = recoverer;
        self
    }

    /// Most hypotheses of the identifier, or particles of a sampled one; 0 without any.
    pub fn particles(&self) -> u32 {
        self.identifier.particles()
    }

    /// Log-odds at which the detector's alarm rises, nats.
    pub const fn alarm_log_odds(&self) -> f64 {
        self.detector.alarm_log_odds()
    }

    /// Sides and types of the faults that the verdicts name.
    pub const fn taxonomy(&self) -> &Taxonomy {
        &self.taxonomy
    }

    /// Gives one verdict per frame, each from the frames up to it. Every run starts from the same
    /// state, so that its verdicts do not depend on the runs before it.
    pub fn run(&mut self, run: &Run, mut take: impl FnMut(Verdict)) {
        let mut detector = self.detector.clone();
        let mut identifier = self.identifier.clone();
        let mut recovering = self.recoverer.as_ref().and_then(Recoverer::begin);
        for frame in &run.frames {
            let (detection, detected) = (&mut *self.detection, &mut *self.detected);
            detector.step(Entry::Frame(frame), detection, detected);
            let input = Input {
                frame,
                detection: Some((detection, detected)),
            };
            let (diagnosis, diagnosed) = (&mut *self.diagnosis, &mut *self.diagnosed);
            identifier.step(Entry::Frame(input), diagnosis, diagnosed);
            (detection.header, diagnosis.header) = (frame.header, frame.header);
            if let Some(recovering) = &mut recovering {
                recovering.take(detection, diagnosis);
            }
            take(self.verdict(frame, !detector.is_armed(), recovering.as_ref()));
        }
    }

    fn verdict(
        &self,
        frame: &SensorFrame,
        warming_up: bool,
        recovering: Option<&RecoveryRun<'_>>,
    ) -> Verdict {
        let belief = &self.diagnosis;
        let name = |i: usize| self.taxonomy.name(i).unwrap_or(UNKNOWN).to_owned();
        let word = |mode: u32| match mode {
            MODE_UNKNOWN => UNKNOWN.to_owned(),
            MODE_MULTIPLE => MULTIPLE.to_owned(),
            MODE_BLIND => BLIND.to_owned(),
            node => name(node as usize),
        };
        let velocity = self.robot.twist(&frame.command);
        let leaves = belief.sets[0].leaves;
        let members: Vec<String> = (1..u64::BITS as usize)
            .filter(|i| leaves >> i & 1 == 1)
            .map(name)
            .collect();
        let kind = belief.size_kind.get(belief.mode as usize).copied();
        let kind = SizeKind::from_wire(kind.unwrap_or_default());
        let size = belief.size.get(belief.mode as usize).copied();
        let stuck = |side| any_of(belief, self.taxonomy.leaves("stuck", side));
        Verdict {
            t_s: frame.header.t_capture_ns as f64 / 1e9,
            p_fault: self.detection.p_fault,
            log_odds: self.detection.log_odds,
            alarm: fused_alarm(&self.detection, recovering.map(RecoveryRun::action)),
            warming_up,
            mode: word(belief.mode),
            p_mode: belief.p_mode,
            p_unknown: belief.p_unknown,
            fault_set: if members.is_empty() {
                name(0)
            } else {
                members.join("+")
            },
            p_left_stuck: stuck(Side::Left),
            p_right_stuck: stuck(Side::Right),
            p_nodes: belief.p[..(belief.node_count as usize).min(belief.p.len())].to_vec(),
            is_identifying: belief.identifying != 0,
            reported: word(belief.reported),
            action: recovering.map_or_else(String::new, RecoveryRun::name),
            size_kind: kind.word(),
            size: size.filter(|_| kind.unit().is_some()),
            drives: velocity.iter().any(|value| value.abs() >= DRIVES),
        }
    }
}

/// Probability that any of some leaves' faults is present. Leaves may be present together, so that
/// their probabilities may add up to more: the most probable sets are counted once each, what they
/// leave of each leaf is added.
fn any_of(belief: &FaultBelief, leaves: impl Iterator<Item = usize>) -> f64 {
    let sets = &belief.sets[..(belief.set_count as usize).min(belief.sets.len())];
    let (mut wanted, mut sum) = (0_u64, 0.0);
    for leaf in leaves {
        wanted |= 1 << leaf;
        let counted = sets.iter().filter(|set| set.leaves >> leaf & 1 == 1);
        sum += (belief.p[leaf] - counted.map(|set| set.p).sum::<f64>()).max(0.0);
    }
    let any = sets.iter().filter(|set| set.leaves & wanted != 0);
    (sum + any.map(|set| set.p).sum::<f64>()).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::FaultSet;

    #[test]
    fn leaves_that_are_present_together_are_counted_once() {
        let mut belief = FaultBelief::default();
        (belief.p[3], belief.p[4], belief.set_count) = (0.55, 0.52, 3);
        let set = |leaves, p| FaultSet { leaves, p };
        belief.sets[..3].copy_from_slice(&[
            set(1 << 3 | 1 << 4, 0.5),
            set(0, 0.4),
            set(1 << 3, 0.04),
        ]);
        // Half for both, 0.04 for one alone, and what no listed set accounts for: 0.01 and 0.02.
        assert!((any_of(&belief, [3, 4].into_iter()) - 0.57).abs() < 1e-12);
        assert!((any_of(&belief, [4].into_iter()) - 0.52).abs() < 1e-12);
    }
}

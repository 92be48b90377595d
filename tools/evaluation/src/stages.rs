//! Detector, identifier and supervisor over frames in one process, as they run live.

use vigil_blocks::{
    Action, ControlMode, DetectionBelief, Entry, FaultBelief, MODE_BLIND, MODE_MULTIPLE,
    MODE_UNKNOWN, ParticleBlock, RecoveryKind, SensorFrame, SizeKind,
};
use vigil_decision::{Inputs, Supervisor, fused_alarm};
use vigil_diagnosis::detect::Detector;
use vigil_diagnosis::identify::{Diagnoser, Input};
use vigil_robot::Description;
use vigil_robot::description::Kinematics;

use crate::scoring::field::{BLIND, RobotOrder, SAFE_STOP, Size};
use crate::scoring::{MULTIPLE, Side, Taxonomy, UNKNOWN, Verdict};

/// Velocity from which a robot counts as driving, m/s and rad/s: below what any of the recorded
/// robots creeps with, above the rest of a command that is meant to stop it.
const DRIVES: f64 = 0.005;

/// The names that verdicts are written in.
#[derive(Debug, Clone)]
pub struct Vocabulary {
    /// Of the faults.
    pub taxonomy: Taxonomy,
    /// Of the wheels.
    pub robot: Description,
    /// Of the decision model's actions; none without one.
    pub actions: Vec<String>,
}

/// The stages at the beginning of a run.
pub struct Stages {
    detector: Detector,
    identifier: Diagnoser,
    supervisor: Option<Supervisor>,
    vocabulary: Vocabulary,
    detection: Box<DetectionBelief>,
    detection_particles: Box<ParticleBlock>,
    diagnosis: Box<FaultBelief>,
    diagnosis_particles: Box<ParticleBlock>,
    action: Box<Action>,
}

impl Stages {
    /// Wires the stages; without a supervisor nothing is decided.
    #[must_use]
    pub fn new(
        detector: Detector,
        identifier: Diagnoser,
        supervisor: Option<Supervisor>,
        vocabulary: Vocabulary,
    ) -> Self {
        Self {
            detector,
            identifier,
            supervisor,
            vocabulary,
            detection: Box::default(),
            detection_particles: Box::default(),
            diagnosis: Box::default(),
            diagnosis_particles: Box::default(),
            action: Box::default(),
        }
    }

    /// Takes a frame.
    pub fn take(&mut self, frame: &SensorFrame) {
        let (detection, particles) = (&mut *self.detection, &mut *self.detection_particles);
        self.detector
            .step(Entry::Frame(frame), detection, particles);
        detection.header = frame.header;
        let input = Input {
            frame,
            detection: Some((detection, particles)),
        };
        let (diagnosis, particles) = (&mut *self.diagnosis, &mut *self.diagnosis_particles);
        self.identifier
            .step(Entry::Frame(input), diagnosis, particles);
        diagnosis.header = frame.header;
        let inputs = Inputs {
            diagnosis: Some(diagnosis),
            detection: Some(detection),
        };
        if let Some(supervisor) = &mut self.supervisor {
            supervisor.step(Entry::Frame(inputs), &mut self.action);
        }
        self.keep_action();
    }

    /// No frame came in time: every stage misses its input.
    pub fn miss(&mut self) {
        let (detection, particles) = (&mut *self.detection, &mut *self.detection_particles);
        self.detector.step(Entry::Missed(1), detection, particles);
        let (diagnosis, particles) = (&mut *self.diagnosis, &mut *self.diagnosis_particles);
        self.identifier.step(Entry::Missed(1), diagnosis, particles);
        if let Some(supervisor) = &mut self.supervisor {
            supervisor.step(Entry::Missed(1), &mut self.action);
        }
        self.keep_action();
    }

    /// The world obeys the last decision; how long an action is valid is the ports' matter.
    fn keep_action(&mut self) {
        self.action.valid_until_ns = u64::MAX;
    }

    /// What the detector has published last.
    #[must_use]
    pub const fn detection(&self) -> &DetectionBelief {
        &self.detection
    }

    /// What the identifier has published last.
    #[must_use]
    pub const fn diagnosis(&self) -> &FaultBelief {
        &self.diagnosis
    }

    /// The action that stands.
    #[must_use]
    pub const fn action(&self) -> &Action {
        &self.action
    }

    /// Sides and types of the faults that the verdicts name.
    #[must_use]
    pub const fn taxonomy(&self) -> &Taxonomy {
        &self.vocabulary.taxonomy
    }

    /// What is reported of the last frame; `frame` gives its time and command.
    #[must_use]
    pub fn verdict(&self, frame: &SensorFrame) -> Verdict {
        let (belief, vocabulary) = (&self.diagnosis, &self.vocabulary);
        let velocity = vocabulary.robot.twist(&frame.command);
        let decided = self.supervisor.as_ref().map(|_| &*self.action);
        let leaves = |side| vocabulary.taxonomy.leaves("stuck", side);
        Verdict {
            t_s: frame.header.t_capture_ns as f64 / 1e9,
            p_fault: self.detection.p_fault,
            log_odds: self.detection.log_odds,
            alarm: fused_alarm(&self.detection, decided),
            warming_up: !self.detector.is_armed(),
            mode: vocabulary.mode(belief.mode),
            p_mode: belief.p_mode,
            p_unknown: belief.p_unknown,
            fault_set: vocabulary.set(belief.sets[0].leaves),
            p_left_stuck: any_of(belief, leaves(Side::Left)),
            p_right_stuck: any_of(belief, leaves(Side::Right)),
            p_nodes: belief.p[..(belief.node_count as usize).min(belief.p.len())].to_vec(),
            is_identifying: belief.identifying != 0,
            reported: vocabulary.mode(belief.reported),
            action: decided.map_or_else(String::new, |action| vocabulary.action(action)),
            order: decided.map_or(RobotOrder::GoOn, order),
            size: size(belief),
            drives: match vocabulary.robot.kinematics {
                Kinematics::None => vocabulary.robot.is_told_to_move(&frame.command),
                _ => velocity.iter().any(|value| value.abs() >= DRIVES),
            },
        }
    }
}

impl Vocabulary {
    fn node(&self, node: usize) -> &str {
        self.taxonomy.name(node).unwrap_or(UNKNOWN)
    }

    fn mode(&self, mode: u32) -> String {
        let name = match mode {
            MODE_UNKNOWN => UNKNOWN,
            MODE_MULTIPLE => MULTIPLE,
            MODE_BLIND => BLIND,
            node => self.node(node as usize),
        };
        name.to_owned()
    }

    /// Names of leaves, joined by `+`.
    fn set(&self, leaves: u64) -> String {
        let members = (1..u64::BITS as usize).filter(|i| leaves >> i & 1 == 1);
        let members: Vec<&str> = members.map(|node| self.node(node)).collect();
        match members.is_empty() {
            true => self.node(0).to_owned(),
            false => members.join("+"),
        }
    }

    /// The action's name, and the wheels that it is about after a colon.
    fn action(&self, action: &Action) -> String {
        if order(action) == RobotOrder::Blind {
            return SAFE_STOP.to_owned();
        }
        let name = self.actions.get(action.action as usize);
        let name = name.map_or("?", String::as_str);
        self.robot.action_text(name, action.answered())
    }
}

/// Size of the fault of the node that the mode names.
fn size(belief: &FaultBelief) -> Size {
    let node = belief.mode as usize;
    let kind = belief.size_kind.get(node).copied().unwrap_or_default();
    Size {
        kind: SizeKind::from_wire(kind),
        value: belief.size.get(node).copied().unwrap_or(0.0),
    }
}

/// An action as it is scored. Without a usable belief the robot stops by rule.
fn order(action: &Action) -> RobotOrder {
    if action.control_mode == ControlMode::Safe as u32 {
        return RobotOrder::Blind;
    }
    match RecoveryKind::from_repr(action.kind).unwrap_or(RecoveryKind::None) {
        RecoveryKind::GoOn => RobotOrder::GoOn,
        RecoveryKind::SlowDown => RobotOrder::Slow,
        RecoveryKind::None | RecoveryKind::Stop | RecoveryKind::GiveUp => RobotOrder::Stop,
        RecoveryKind::CallForHelp => RobotOrder::Help,
        RecoveryKind::Compensate
        | RecoveryKind::IgnoreEncoder
        | RecoveryKind::LimpHome
        | RecoveryKind::NewPath
        | RecoveryKind::Relocalise
        | RecoveryKind::GoThrough
        | RecoveryKind::MoveAway
        | RecoveryKind::Own => RobotOrder::Other,
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

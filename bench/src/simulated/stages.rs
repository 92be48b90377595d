//! Detector, identifier and supervisor, one frame at a time, as the graph wires them.

use std::error::Error;

use vigil_blocks::{
    Action, ControlMode, DetectionBelief, Entry, FaultBelief, MODE_BLIND, MODE_MULTIPLE,
    MODE_UNKNOWN, ParticleBlock, RecoveryKind, SensorFrame, SizeKind,
};
use vigil_decision::{Inputs, Supervisor, fused_alarm};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect::Detector;
use vigil_diagnosis::identify::{Diagnoser, Input};
use vigil_evaluation::scoring::field::{BLIND, Moment, RobotOrder, Size};
use vigil_evaluation::scoring::{Belief, MULTIPLE, UNKNOWN};
use vigil_setup::Setup;

/// The three stages of a graph.
pub struct Stages {
    detector: Detector,
    identifier: Diagnoser,
    supervisor: Supervisor,
    names: Vec<String>,
    detection: Box<DetectionBelief>,
    detection_particles: Box<ParticleBlock>,
    diagnosis: Box<FaultBelief>,
    diagnosis_particles: Box<ParticleBlock>,
    action: Box<Action>,
    /// The most probable set in words; kept while the leaves stay.
    set: (u64, String),
}

impl Stages {
    /// The stages of a configuration, but for the sensors they use, the rate and the seed.
    ///
    /// # Errors
    /// If model, robot, tree and settings do not fit together.
    pub fn new(
        setup: &Setup,
        sensors: Sensors,
        rate_hz: f64,
        seed: u64,
    ) -> Result<Self, Box<dyn Error>> {
        let mut setup = setup.clone();
        setup.file.graph.rate_hz = rate_hz;
        setup.file.graph.seed = seed;
        setup.file.detector.sensors = sensors;
        let names = setup.tree.nodes().iter().map(|node| node.name.clone());
        let names: Vec<String> = names.collect();
        let nominal = names.first().cloned().unwrap_or_default();
        Ok(Self {
            detector: vigil_detector::assemble(&setup)?,
            identifier: vigil_identifier::assemble(&setup)?,
            supervisor: vigil_supervisor::assemble(&setup)?,
            names,
            detection: Box::default(),
            detection_particles: Box::default(),
            diagnosis: Box::default(),
            diagnosis_particles: Box::default(),
            action: Box::default(),
            set: (0, nominal),
        })
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
        self.supervisor.step(Entry::Frame(inputs), &mut self.action);
        self.after();
    }

    /// No frame came in time: every stage misses its input.
    pub fn miss(&mut self) {
        let (detection, particles) = (&mut *self.detection, &mut *self.detection_particles);
        self.detector.step(Entry::Missed(1), detection, particles);
        let (diagnosis, particles) = (&mut *self.diagnosis, &mut *self.diagnosis_particles);
        self.identifier.step(Entry::Missed(1), diagnosis, particles);
        self.supervisor.step(Entry::Missed(1), &mut self.action);
        self.after();
    }

    fn after(&mut self) {
        // The world obeys what was decided last; how long an action is valid is the ports' matter.
        self.action.valid_until_ns = u64::MAX;
        let leaves = self.diagnosis.sets[0].leaves;
        if self.set.0 != leaves {
            let members = (1..u64::BITS as usize).filter(|i| leaves >> i & 1 == 1);
            let members: Vec<&str> = members.map(|node| self.node(node)).collect();
            let text = match members.is_empty() {
                true => self.node(0).to_owned(),
                false => members.join("+"),
            };
            self.set = (leaves, text);
        }
    }

    /// The action that stands.
    #[must_use]
    pub const fn action(&self) -> &Action {
        &self.action
    }

    /// What the three stages say now.
    #[must_use]
    pub const fn blocks(&self) -> (&DetectionBelief, &FaultBelief, &Action) {
        (&self.detection, &self.diagnosis, &self.action)
    }

    /// What is said now.
    #[must_use]
    pub fn moment(&self, t_s: f64, dt_s: f64, drives: bool) -> Moment<'_> {
        let (belief, action) = (&self.diagnosis, &self.action);
        Moment {
            t_s,
            dt_s,
            drives,
            alarm: fused_alarm(&self.detection, Some(action)),
            belief: Belief {
                p_nodes: &belief.p[..self.names.len().min(belief.p.len())],
                p_unknown: belief.p_unknown,
                is_identifying: belief.identifying != 0,
            },
            mode: self.name(belief.mode),
            p_mode: belief.p_mode,
            size: self.size(),
            set: &self.set.1,
            reported: self.name(belief.reported),
            order: order(action),
            action: u64::from(action.action) << 32 | u64::from(action.wheel),
        }
    }

    /// Names of the fault tree's nodes, in their order.
    pub fn node_names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// The detector's log-odds by channel; see [`vigil_blocks::Channel`].
    #[must_use]
    pub const fn channel_log_odds(&self) -> &[f64] {
        &self.detection.channel_log_odds
    }

    /// Of the node that the mode names.
    fn size(&self) -> Size {
        let node = self.diagnosis.mode as usize;
        let kind = self.diagnosis.size_kind.get(node).copied();
        Size {
            kind: SizeKind::from_wire(kind.unwrap_or_default()),
            value: self.diagnosis.size.get(node).copied().unwrap_or(0.0),
        }
    }

    fn name(&self, mode: u32) -> &str {
        match mode {
            MODE_UNKNOWN => UNKNOWN,
            MODE_MULTIPLE => MULTIPLE,
            MODE_BLIND => BLIND,
            node => self.node(node as usize),
        }
    }

    fn node(&self, node: usize) -> &str {
        self.names.get(node).map_or("?", String::as_str)
    }
}

/// An action as it is scored. What is not decided stops the robot.
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
        | RecoveryKind::NewPath
        | RecoveryKind::Relocalise
        | RecoveryKind::GoThrough
        | RecoveryKind::MoveAway => RobotOrder::Other,
    }
}

//! From frames to actions.

use std::error::Error;

use vigil_blocks::{
    Action, DetectionBelief, Entry, FaultBelief, ParticleBlock, RecoveryKind, SensorFrame,
};
use vigil_decision::{Inputs, Supervisor};
use vigil_diagnosis::detect::Detector;
use vigil_diagnosis::identify::{Diagnoser, Input};

use super::arm::Arm;
use super::escalation::{Escalation, Explanation, RuleInput, RuleOutput};
use super::{ShippedGraph, Truth};

/// Detector and identifier as they ship, one frame at a time.
struct Watch {
    detector: Detector,
    identifier: Diagnoser,
    detection: Box<DetectionBelief>,
    detection_particles: Box<ParticleBlock>,
    diagnosis: Box<FaultBelief>,
    diagnosis_particles: Box<ParticleBlock>,
}

impl Watch {
    fn new(shipped: &ShippedGraph, seed: u64) -> Result<Self, Box<dyn Error>> {
        let mut setup = shipped.setup.clone();
        setup.file.graph.seed = seed;
        Ok(Self {
            detector: vigil_detector::assemble(&setup)?,
            identifier: vigil_identifier::assemble(&setup)?,
            detection: Box::default(),
            detection_particles: Box::default(),
            diagnosis: Box::default(),
            diagnosis_particles: Box::default(),
        })
    }

    fn detect(&mut self, frame: &SensorFrame) -> bool {
        let (detection, particles) = (&mut *self.detection, &mut *self.detection_particles);
        self.detector
            .step(Entry::Frame(frame), detection, particles);
        detection.header = frame.header;
        detection.alarm != 0
    }

    fn identify(&mut self, frame: &SensorFrame) -> &FaultBelief {
        let input = Input {
            frame,
            detection: Some((&*self.detection, &*self.detection_particles)),
        };
        let (diagnosis, particles) = (&mut *self.diagnosis, &mut *self.diagnosis_particles);
        self.identifier
            .step(Entry::Frame(input), diagnosis, particles);
        diagnosis.header = frame.header;
        diagnosis
    }
}

/// One of the commanders.
pub(super) struct Commander<'a> {
    shipped: &'a ShippedGraph,
    mind: Mind,
    /// Leaves of the tree with what they mean.
    leaves: Vec<(usize, Explanation)>,
    action: Box<Action>,
}

enum Mind {
    Vigil(Box<Watch>, Box<Supervisor>),
    Without,
    Escalation(Box<Watch>, Escalation),
    StopAndCall(Box<Watch>),
    Oracle,
}

impl<'a> Commander<'a> {
    pub(super) fn new(
        shipped: &'a ShippedGraph,
        arm: Arm,
        seed: u64,
    ) -> Result<Self, Box<dyn Error>> {
        let watch = || Watch::new(shipped, seed).map(Box::new);
        let mind = match arm {
            Arm::Vigil => {
                let supervisor = vigil_supervisor::assemble(&shipped.setup)?;
                Mind::Vigil(watch()?, Box::new(supervisor))
            }
            Arm::Without => Mind::Without,
            Arm::Escalation => Mind::Escalation(watch()?, Escalation::default()),
            Arm::StopAndCall => Mind::StopAndCall(watch()?),
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
        let told = match &mut self.mind {
            Mind::Vigil(watch, supervisor) => {
                watch.detect(frame);
                watch.identify(frame);
                let inputs = Inputs {
                    diagnosis: Some(&*watch.diagnosis),
                    detection: Some(&*watch.detection),
                };
                supervisor.step(Entry::Frame(inputs), &mut self.action);
                None
            }
            Mind::Without => Some((RecoveryKind::GoOn, None)),
            Mind::Escalation(watch, rules) => {
                let alarm = watch.detect(frame);
                let explanation = most_probable(&self.leaves, watch.identify(frame));
                let RuleOutput { kind, wheel } =
                    rules.answer(RuleInput { alarm, explanation }, dt_s);
                Some((kind, wheel))
            }
            Mind::StopAndCall(watch) => match watch.detect(frame) {
                true => Some((RecoveryKind::CallForHelp, None)),
                false => Some((RecoveryKind::GoOn, None)),
            },
            Mind::Oracle => {
                let best = self.shipped.solution.best(truth.state);
                Some((self.shipped.kind(best), truth.wheel))
            }
        };
        if let Some((kind, wheel)) = told {
            self.tell(kind, wheel);
        }
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
    fn tell(&mut self, kind: RecoveryKind, wheel: Option<usize>) {
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

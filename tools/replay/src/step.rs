//! A service's step, as the service builds it, fed with entries of its journal.

use vigil_blocks::JournalKind::{Kept, Lived, Ordered, Restored, Told};
use vigil_blocks::{
    Action, DetectionBelief, Entry, FaultBelief, Faults, JournalEntry, JournalKind, ParticleBlock,
};
use vigil_checkpoint::{Checkpoint, CheckpointError, CheckpointReader, CheckpointWriter};
use vigil_cycle::topic::ServiceName;
use vigil_decision::Inputs;
use vigil_diagnosis::detect::Detector;
use vigil_diagnosis::identify::{Diagnoser, Input};
use vigil_setup::Setup;
use vigil_supervisor::Steps;

use crate::blocks::Blocks;
use crate::error::ReplayError;

/// What steps write.
#[derive(Default)]
pub(crate) struct Answers {
    pub(crate) detection: Box<DetectionBelief>,
    pub(crate) particles: Box<ParticleBlock>,
    pub(crate) diagnosis: Box<FaultBelief>,
    /// The detector's, on their way to the identifier.
    detected: Box<ParticleBlock>,
    hypotheses: Box<ParticleBlock>,
    pub(crate) action: Box<Action>,
    pub(crate) faults: Box<Faults>,
}

/// A block that an entry names was not recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Missing {
    Frame,
    Detection,
    Hypotheses,
    Diagnosis,
    Faults,
    Version,
}

impl Missing {
    pub(crate) const fn as_str(self) -> &'static str {
        match self {
            Self::Frame => "a sensor frame was not recorded",
            Self::Detection => "a detection was not recorded",
            Self::Hypotheses => "the detector's hypotheses are not known",
            Self::Diagnosis => "a diagnosis was not recorded",
            Self::Faults => "the faults that an earlier supervisor has left were not recorded",
            Self::Version => "the journal is of another version",
        }
    }
}

/// The step of a service.
pub(crate) enum Step {
    Detector(Box<Detector>),
    Identifier(Box<Diagnoser>),
    Supervisor(Box<Steps>),
}

impl Step {
    /// The step at the start of a service, which is one of those that step.
    pub(crate) fn new(service: ServiceName, setup: &Setup) -> Result<Self, ReplayError> {
        Ok(match service {
            ServiceName::Identifier => {
                Self::Identifier(built(service, vigil_identifier::assemble(setup))?)
            }
            ServiceName::Supervisor => {
                Self::Supervisor(built(service, vigil_supervisor::steps(setup))?)
            }
            ServiceName::SensorSim | ServiceName::Detector => {
                Self::Detector(built(service, vigil_detector::assemble(setup))?)
            }
        })
    }

    /// Takes an entry, as the service did.
    pub(crate) fn take(
        &mut self,
        entry: &JournalEntry,
        blocks: &Blocks,
        to: &mut Answers,
    ) -> Result<(), Missing> {
        let kind = JournalKind::from_repr(entry.kind).ok_or(Missing::Version)?;
        match self {
            Self::Detector(detector) => detect(detector, kind, entry, (blocks, to)),
            Self::Identifier(identifier) => identify(identifier, kind, entry, (blocks, to)),
            Self::Supervisor(steps) => decide(steps, kind, entry, (blocks, to)),
        }
    }

    /// The state as bytes, in `room`; `None` if it is larger.
    pub(crate) fn state<'a>(&self, room: &'a mut [u8]) -> Option<&'a [u8]> {
        let mut writer = CheckpointWriter::new(room);
        match self {
            Self::Detector(detector) => detector.save(&mut writer),
            Self::Identifier(identifier) => identifier.save(&mut writer),
            Self::Supervisor(steps) => steps.save(&mut writer),
        }
        let bytes = writer.finish().ok()?;
        room.get(..bytes)
    }

    /// Takes what the service has published, from which it may go on.
    pub(crate) fn decided(&mut self, action: &Action) {
        if let Self::Supervisor(steps) = self {
            steps.faults.decide(action);
        }
    }

    /// Takes over a state.
    pub(crate) fn load(&mut self, state: &[u8]) -> Result<(), CheckpointError> {
        let mut reader = CheckpointReader::new(state);
        match self {
            Self::Detector(detector) => detector.load(&mut reader),
            Self::Identifier(identifier) => identifier.load(&mut reader),
            Self::Supervisor(steps) => steps.load(&mut reader),
        }
        reader.finish()
    }
}

/// A step that a service has assembled.
fn built<T>(
    service: ServiceName,
    step: Result<T, impl std::error::Error>,
) -> Result<Box<T>, ReplayError> {
    step.map(Box::new).map_err(|error| ReplayError::Build {
        service: service.as_str(),
        reason: error.to_string(),
    })
}

fn detect(
    detector: &mut Detector,
    kind: JournalKind,
    entry: &JournalEntry,
    (blocks, to): (&Blocks, &mut Answers),
) -> Result<(), Missing> {
    let (belief, particles) = (&mut to.detection, &mut to.particles);
    match kind {
        JournalKind::Frame => {
            let frame = entry.input().and_then(|id| blocks.frames.get(id));
            let frame = frame.ok_or(Missing::Frame)?;
            detector.step(Entry::Frame(frame), belief, particles);
        }
        JournalKind::Missed => detector.step(Entry::Missed(entry.count), belief, particles),
        JournalKind::Budget => detector.step(Entry::Budget(entry.count), belief, particles),
        JournalKind::Reset => detector.step(Entry::Reset, belief, particles),
        JournalKind::Refused => detector.refuse(),
        JournalKind::Begun | JournalKind::Looked => {}
        Restored | Kept | Lived | Ordered | Told => {}
    }
    Ok(())
}

fn identify(
    identifier: &mut Diagnoser,
    kind: JournalKind,
    entry: &JournalEntry,
    (blocks, to): (&Blocks, &mut Answers),
) -> Result<(), Missing> {
    let detection = |id| blocks.detections.get(id).ok_or(Missing::Detection);
    let (belief, out) = (&mut to.diagnosis, &mut to.hypotheses);
    match kind {
        JournalKind::Frame => {
            let frame = entry.input().and_then(|id| blocks.frames.get(id));
            let detected = match entry.detection() {
                Some(id) => {
                    let hypotheses = blocks.hypotheses.get(id).ok_or(Missing::Hypotheses)?;
                    hypotheses.fill(&mut to.detected);
                    Some((detection(id)?, &*to.detected))
                }
                None => None,
            };
            let input = Input {
                frame: frame.ok_or(Missing::Frame)?,
                detection: detected,
            };
            identifier.step(Entry::Frame(input), belief, out);
        }
        JournalKind::Looked => {
            let id = entry.detection().ok_or(Missing::Detection)?;
            identifier.look(detection(id)?);
        }
        JournalKind::Missed => identifier.step(Entry::Missed(entry.count), belief, out),
        JournalKind::Budget => identifier.step(Entry::Budget(entry.count), belief, out),
        JournalKind::Reset => identifier.step(Entry::Reset, belief, out),
        JournalKind::Begun | JournalKind::Refused => {}
        Restored | Kept | Lived | Ordered | Told => {}
    }
    Ok(())
}

fn decide(
    steps: &mut Steps,
    kind: JournalKind,
    entry: &JournalEntry,
    (blocks, to): (&Blocks, &mut Answers),
) -> Result<(), Missing> {
    let action = &mut to.action;
    match kind {
        JournalKind::Frame => {
            let diagnosis = entry.input().map(|id| blocks.diagnoses.get(id));
            let diagnosis = diagnosis.map(|found| found.ok_or(Missing::Diagnosis));
            let detection = match entry.detection() {
                Some(id) => {
                    let recorded = blocks.detections.get(id).ok_or(Missing::Detection)?;
                    let mut taken = Box::new(*recorded);
                    taken.blind = entry.blind;
                    Some(taken)
                }
                None => None,
            };
            let inputs = Inputs {
                diagnosis: diagnosis.transpose()?,
                detection: detection.as_deref(),
            };
            steps.take(inputs, action);
        }
        JournalKind::Missed => steps.supervisor.step(Entry::Missed(entry.count), action),
        JournalKind::Budget => steps.supervisor.step(Entry::Budget(entry.count), action),
        JournalKind::Reset => steps.supervisor.step(Entry::Reset, action),
        JournalKind::Begun | JournalKind::Looked | JournalKind::Refused => {}
        Restored | Kept | Lived | Ordered | Told => {
            live(steps, kind, entry, (blocks, &mut to.faults))?;
        }
    }
    Ok(())
}

/// What the faults' life takes.
fn live(
    steps: &mut Steps,
    kind: JournalKind,
    entry: &JournalEntry,
    (blocks, faults): (&Blocks, &mut Faults),
) -> Result<(), Missing> {
    match kind {
        Restored => {
            let left = entry.input().and_then(|id| blocks.faults.get(id));
            steps.restore(left.ok_or(Missing::Faults)?);
        }
        Kept => {
            let frame = entry.input().and_then(|id| blocks.frames.get(id));
            steps.faults.keep(frame.ok_or(Missing::Frame)?);
        }
        Lived => steps.faults.live(entry.t_ns, entry.count),
        Ordered => {
            steps.faults.obey(entry.count, entry.fault, entry.t_ns);
        }
        Told => steps.write(faults),
        _ => {}
    }
    // The service tells them as events.
    while steps.faults.take_change().is_some() {}
    Ok(())
}

//! Blocks as messages of ROS 2.

mod action;
mod detection;
mod diagnosis;
mod event;
mod explanation;
mod fault_status;
mod faults;
mod frame;
mod health;
mod truth;

use vigil_blocks::layout::Layout;
use vigil_blocks::{Block, CheckpointPart, Control, Journal, ParticleBlock};
use vigil_cycle::topic::{ServiceName, Topic};
use vigil_setup::Setup;

use action::ActionTranslation;
use detection::DetectionTranslation;
use diagnosis::DiagnosisTranslation;
use faults::FaultsTranslation;
use frame::FrameTranslation;
use health::HealthTranslation;
use truth::write_truth;

use crate::message_times::MessageTimes;
use crate::sink::Sink;

pub(crate) use event::write_event;

/// What was made of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Its messages, as far as any were due.
    Messages,
    /// Nothing: its numbers are about other models than the graph's, or it is of another version.
    OtherModels,
}

/// How each block with content is translated.
pub(crate) struct Translation {
    frame: FrameTranslation,
    detection: DetectionTranslation,
    diagnosis: DiagnosisTranslation,
    action: ActionTranslation,
    faults: FaultsTranslation,
    health: HealthTranslation,
}

/// A part of a graph that may fall silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Speaker {
    /// Who keeps the faults, for the graph as a whole.
    Faults,
    /// Who names the fault.
    Diagnosis,
    /// A service, of itself.
    Health(ServiceName),
}

/// A block that can be read, and when it was.
struct ReadBlock<B> {
    block: B,
    times: MessageTimes,
}

/// Has a block kept as it is, and reads it; `None` if it is something else.
fn read<B: Block + Layout, S: Sink>(
    topic: Topic,
    bytes: &[u8],
    sink: &mut S,
) -> Result<Option<ReadBlock<B>>, S::Error> {
    let times = sink.keep::<B>(topic, bytes)?;
    Ok(times.map(|times| ReadBlock {
        block: bytemuck::pod_read_unaligned(bytes),
        times,
    }))
}

impl Translation {
    /// With the names that a graph's models give.
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            frame: FrameTranslation::new(&setup.robot),
            detection: DetectionTranslation::new(&setup.robot),
            diagnosis: DiagnosisTranslation::new(setup),
            action: ActionTranslation::new(setup),
            faults: FaultsTranslation::new(setup),
            health: HealthTranslation::new(setup),
        }
    }

    /// The same after a new start of the graph.
    pub(crate) fn restarted(self, setup: &Setup) -> Self {
        Self {
            faults: self.faults.restarted(setup),
            ..Self::new(setup)
        }
    }

    /// Writes a block as it came from its topic: as it is, and the messages that follow from it.
    pub(crate) fn write<S: Sink>(
        &mut self,
        topic: Topic,
        bytes: &[u8],
        sink: &mut S,
    ) -> Result<Outcome, S::Error> {
        let all = |written: Result<(), S::Error>| written.map(|()| Outcome::Messages);
        let outcome = match topic {
            Topic::Sensor => {
                read(topic, bytes, sink)?.map(|it| self.frame.write(&it.block, it.times, sink))
            }
            Topic::Detection => read(topic, bytes, sink)?
                .map(|it| all(self.detection.write(&it.block, it.times, sink))),
            Topic::Diagnosis => {
                read(topic, bytes, sink)?.map(|it| self.diagnosis.write(&it.block, it.times, sink))
            }
            Topic::Action => {
                read(topic, bytes, sink)?.map(|it| self.action.write(&it.block, it.times, sink))
            }
            Topic::Faults => read(topic, bytes, sink)?.map(|it| {
                let diagnosis = || self.diagnosis.status();
                self.faults.write(&it.block, diagnosis, it.times, sink)
            }),
            Topic::Truth => {
                read(topic, bytes, sink)?.map(|it| all(write_truth(&it.block, it.times, sink)))
            }
            Topic::Health(service) => read(topic, bytes, sink)?
                .map(|it| all(self.health.write(service, &it.block, it.times, sink))),
            Topic::DetectionParticles | Topic::DiagnosisParticles => sink
                .keep::<ParticleBlock>(topic, bytes)?
                .map(|_| Ok(Outcome::Messages)),
            Topic::Control(_) => sink
                .keep::<Control>(topic, bytes)?
                .map(|_| Ok(Outcome::Messages)),
            Topic::Journal(_) => sink
                .keep::<Journal>(topic, bytes)?
                .map(|_| Ok(Outcome::Messages)),
            Topic::Checkpoint(_) => sink
                .keep::<CheckpointPart>(topic, bytes)?
                .map(|_| Ok(Outcome::Messages)),
        };
        Ok(outcome.transpose()?.unwrap_or(Outcome::OtherModels))
    }

    /// Writes that nothing is heard of a part any more, and why.
    pub(crate) fn write_stale<S: Sink>(
        &mut self,
        speaker: Speaker,
        why: &str,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        match speaker {
            Speaker::Diagnosis => {
                self.diagnosis.forget();
                Ok(())
            }
            Speaker::Faults => {
                let diagnosis = self.diagnosis.status();
                self.faults.write_stale(why, diagnosis, times, sink)
            }
            Speaker::Health(service) => self.health.write_stale(service, why, times, sink),
        }
    }
}

//! The topics that are looked at.

use vigil_blocks::{Action, Block, DetectionBelief, FaultBelief, Faults, Health, SensorFrame};
use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, Graph, PortError, Receiver, Topic};

use super::view::View;

/// Readers of the topics.
pub struct Topics {
    faults: Box<dyn Receiver<Faults>>,
    frames: Box<dyn Receiver<SensorFrame>>,
    detection: Box<dyn Receiver<DetectionBelief>>,
    diagnosis: Box<dyn Receiver<FaultBelief>>,
    actions: Box<dyn Receiver<Action>>,
    health: Vec<Box<dyn Receiver<Health>>>,
}

impl Topics {
    /// Opens them.
    ///
    /// # Errors
    /// The transport's, as when a topic has no place for one more reader.
    pub fn join(domain: &Domain) -> Result<Self, PortError> {
        let graph = Graph::SharedMemory(Link::join(domain, "vigil-top")?);
        let health = ServiceName::ALL.map(|service| graph.receiver(Topic::Health(service)));
        Ok(Self {
            faults: graph.receiver(Topic::Faults)?,
            frames: graph.receiver(Topic::Sensor)?,
            detection: graph.receiver(Topic::Detection)?,
            diagnosis: graph.receiver(Topic::Diagnosis)?,
            actions: graph.receiver(Topic::Action)?,
            health: health.into_iter().collect::<Result<_, _>>()?,
        })
    }

    /// Takes the blocks that wait.
    pub fn take(&mut self, view: &mut View, now_ns: u64) {
        let View {
            histories,
            end_to_end,
            ..
        } = view;
        take(self.faults.as_mut(), &mut view.faults, |_| {});
        take(self.frames.as_mut(), &mut view.frame, |_| {});
        take(self.detection.as_mut(), &mut view.detection, |block| {
            histories.take_detection(block, now_ns);
        });
        take(self.diagnosis.as_mut(), &mut view.diagnosis, |block| {
            histories.take_diagnosis(block, now_ns);
        });
        take(self.actions.as_mut(), &mut view.action, |block| {
            end_to_end.push(block.header);
        });
        for (place, receiver) in self.health.iter_mut().enumerate() {
            take(receiver.as_mut(), &mut view.health[place], |block| {
                histories.take_health(place, block, now_ns);
            });
        }
    }
}

/// Gives each block that waits to `each`, and keeps the newest.
fn take<T: Block>(
    receiver: &mut dyn Receiver<T>,
    newest: &mut Option<Box<T>>,
    mut each: impl FnMut(&T),
) {
    // At most a full queue: a flood must not hold the reader.
    for _ in 0..receiver.buffer() {
        let Some(block) = receiver.take_next() else {
            break;
        };
        if block.header().schema == T::SCHEMA {
            each(block);
            match newest {
                Some(kept) => **kept = *block,
                None => *newest = Some(Box::new(*block)),
            }
        }
    }
}

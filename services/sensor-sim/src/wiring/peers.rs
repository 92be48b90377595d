//! Waits for the other stages before the first frame, so that none of them misses it.

use vigil_blocks::{Block, Health, ServiceState};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, PortError, Receiver, Topic};

const STAGES: [ServiceName; 3] = [
    ServiceName::Detector,
    ServiceName::Identifier,
    ServiceName::Supervisor,
];

/// Watches the other stages come up.
pub(super) struct Peers {
    health: Vec<Box<dyn Receiver<Health>>>,
    up: [bool; STAGES.len()],
}

impl Peers {
    pub(super) fn new(graph: &Graph) -> Result<Self, PortError> {
        let open = |name| graph.receiver(Topic::Health(name));
        Ok(Self {
            health: STAGES.into_iter().map(open).collect::<Result<_, _>>()?,
            up: [false; 3],
        })
    }

    /// True once every stage has opened its ports.
    pub(super) fn are_up(&mut self) -> bool {
        if self.up == [true; STAGES.len()] {
            return true;
        }
        for (up, receiver) in self.up.iter_mut().zip(&mut self.health) {
            for _ in 0..receiver.buffer() {
                let Some(health) = receiver.take_next() else {
                    break;
                };
                let open = [ServiceState::Ready as u32, ServiceState::Running as u32];
                *up |= health.header.schema == Health::SCHEMA && open.contains(&health.state);
            }
        }
        self.up == [true; STAGES.len()]
    }
}

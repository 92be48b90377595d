//! The supervisor's newest action, and the start of the drive.

use vigil_blocks::{Action, Block, CauseKind};
use vigil_cycle::{Graph, PortError, Receiver, Topic};

/// Reads actions.
pub(super) struct Actions {
    receiver: Box<dyn Receiver<Action>>,
    latest: Option<Box<Action>>,
    ready_ns: Option<u64>,
}

impl Actions {
    pub(super) fn new(graph: &Graph) -> Result<Self, PortError> {
        let receiver = graph.receiver(Topic::Action)?;
        // Allocated once: a cycle only copies into it.
        Ok(Self {
            receiver,
            latest: Some(Box::default()),
            ready_ns: None,
        })
    }

    /// Takes the actions that have arrived, in the cycle that was due at `t_schedule_ns`.
    pub(super) fn take(&mut self, t_schedule_ns: u64, own_epoch: u64) {
        for _ in 0..self.receiver.buffer() {
            let Some(action) = self.receiver.take_next() else {
                break;
            };
            if action.header.schema != Action::SCHEMA {
                continue;
            }
            if let Some(latest) = &mut self.latest {
                **latest = *action;
            }
            // An action that follows from a frame of ours has passed through every stage.
            let from_frame = action.cause.kind() == Some(CauseKind::Frame);
            if from_frame && action.cause.frame_epoch == own_epoch && self.ready_ns.is_none() {
                self.ready_ns = Some(t_schedule_ns);
            }
        }
    }

    /// The newest action; `None` before the first.
    pub(super) fn newest(&self) -> Option<&Action> {
        self.latest
            .as_deref()
            .filter(|action| action.header.epoch != 0)
    }

    /// The scheduled instant of the first cycle in which every stage had answered, ns.
    pub(super) const fn ready_ns(&self) -> Option<u64> {
        self.ready_ns
    }
}

//! The supervisor's newest action, and the start of the drive.

use vigil_blocks::{Action, CauseKind};
use vigil_cycle::{Graph, PortError, Topic};

use super::newest::Newest;

/// Reads actions.
pub(super) struct Actions {
    action: Newest<Action>,
    ready_ns: Option<u64>,
}

impl Actions {
    pub(super) fn new(graph: &Graph) -> Result<Self, PortError> {
        Ok(Self {
            action: Newest::new(graph.receiver(Topic::Action)?),
            ready_ns: None,
        })
    }

    /// Takes the actions that have arrived, in the cycle that was due at `t_schedule_ns`.
    pub(super) fn take(&mut self, t_schedule_ns: u64, own_epoch: u64) {
        let ready_ns = &mut self.ready_ns;
        self.action.take(|action| {
            // An action that follows from a frame of ours has passed through every stage.
            let from_frame = action.cause.kind() == Some(CauseKind::Frame);
            if from_frame && action.cause.frame_epoch == own_epoch && ready_ns.is_none() {
                *ready_ns = Some(t_schedule_ns);
            }
        });
    }

    /// The newest action; `None` before the first.
    pub(super) fn newest(&self) -> Option<&Action> {
        Some(self.action.block()).filter(|action| action.header.epoch != 0)
    }

    /// The scheduled instant of the first cycle in which every stage had answered, ns.
    pub(super) const fn ready_ns(&self) -> Option<u64> {
        self.ready_ns
    }
}

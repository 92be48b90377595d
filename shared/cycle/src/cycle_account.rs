//! What a service accounts of its cycles, whether input or its schedule wakes it.

use std::ops::ControlFlow;

use vigil_blocks::{Degraded, ServiceState};

use crate::clock::Clock;
use crate::deadline::DeadlineMonitor;
use crate::health::HealthBoard;
use crate::on_miss::{Lateness, OnMiss};
use crate::port_error::PortError;
use crate::recorder::Recorder;
use crate::stamps::CycleStamps;

/// Deadlines, Health and histograms of one service, which have to agree.
pub struct CycleAccount {
    pub(crate) monitor: DeadlineMonitor,
    pub(crate) health: HealthBoard,
    pub(crate) recorder: Recorder,
    pub(crate) on_miss: OnMiss,
    lateness: Lateness,
}

/// What one turn has come to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TurnResult {
    /// Deadlines that were found missed.
    pub missed: u64,
    /// True if a cycle was published.
    pub is_published: bool,
}

impl CycleAccount {
    /// An empty account with this monitor and board, and a recorder that has recorded nothing yet.
    #[must_use]
    pub fn new(monitor: DeadlineMonitor, health: HealthBoard, recorder: Recorder) -> Self {
        Self {
            monitor,
            health,
            recorder,
            on_miss: OnMiss::default(),
            lateness: Lateness::default(),
        }
    }

    /// The same account with this answer to missed deadlines.
    #[must_use]
    pub const fn with_on_miss(mut self, on_miss: OnMiss) -> Self {
        self.on_miss = on_miss;
        self
    }

    /// What it has kept of its cycles.
    #[must_use]
    pub const fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    /// The board.
    #[must_use]
    pub const fn health(&self) -> &HealthBoard {
        &self.health
    }

    /// Announces that the ports are open.
    ///
    /// # Errors
    /// The transport's.
    pub fn ready(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        self.health.enter(ServiceState::Ready);
        self.health.publish(clock)
    }

    /// Announces the end.
    ///
    /// # Errors
    /// The transport's.
    pub fn stop(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        self.health.enter(ServiceState::Stopping);
        self.health.publish(clock)
    }

    /// Counts a cycle that has published, for the block `seq` of its input.
    pub(crate) fn count_cycle(&mut self, cycle: CycleStamps, seq: u64) {
        let cycle_ns = self.recorder.keep(cycle);
        self.health.count_cycle(cycle_ns, seq);
        let (kept, counted) = (self.recorder.cycles(), self.health.view().cycles);
        assert!(
            kept == counted,
            "each cycle is recorded once: {kept} recorded, {counted} in Health"
        );
    }

    /// Closes a turn: misses, lateness and what the monitor has accounted go to Health.
    pub(crate) fn settle(&mut self, now_ns: u64, turn: TurnResult) {
        self.health.miss(now_ns, turn.missed);
        let is_late = self
            .lateness
            .take(self.on_miss, turn.missed, turn.is_published);
        self.health.set_degraded(now_ns, Degraded::LATE, is_late);
        if turn.is_published {
            self.health.enter(ServiceState::Running);
        }
        self.health
            .set_accounted(self.monitor.missed(), self.monitor.accounted_ns());
    }

    /// Breaks if a deadline was missed and that is to end the service.
    pub(crate) fn verdict(&self, missed: u64) -> ControlFlow<()> {
        if missed > 0 && self.on_miss == OnMiss::Stop {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::health;

    #[test]
    #[should_panic(expected = "each cycle is recorded once: 1 recorded, 3 in Health")]
    fn a_cycle_that_only_health_counts_is_found() {
        let (board, _) = health::tests::board();
        let monitor = DeadlineMonitor::new(crate::deadline::Schedule {
            period_ns: 1,
            deadline_ns: 1,
            budget_ns: 1,
        });
        let mut account = CycleAccount::new(monitor, board, Recorder::new().unwrap());
        account.count_cycle(CycleStamps::default(), 0);
    }
}

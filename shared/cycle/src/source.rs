//! The source of the graph: woken by its own absolute schedule.

use std::ops::ControlFlow;

use vigil_blocks::{Degraded, ServiceState};

use crate::clock::Clock;
use crate::deadline::{DeadlineMonitor, GAP_INSTANTS_MAX};
use crate::health::HealthBoard;
use crate::on_miss::{Lateness, OnMiss};
use crate::port::PortError;
use crate::recorder::Recorder;
use crate::stamps::CycleStamps;

/// What a source did at an instant of its schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SourceOutcome {
    /// A frame was published at this instant, ns.
    Frame(u64),
    /// Nothing is to be published at this instant.
    Nothing,
    /// There is nothing more to publish.
    End,
}

/// A sensor source, as the cycle sees it.
pub trait Source {
    /// Produces and publishes the frame that was due at `t_schedule_ns`.
    ///
    /// # Errors
    /// The transport's.
    fn produce(
        &mut self,
        t_schedule_ns: u64,
        clock: &dyn Clock,
    ) -> Result<SourceOutcome, PortError>;

    /// Readies the block of the next cycle, see [`crate::Sender::prepare`]. Off the critical path.
    ///
    /// # Errors
    /// The transport's.
    fn prepare(&mut self) -> Result<(), PortError>;

    /// Reports events, handles control commands. Off the critical path.
    fn after(&mut self, health: &mut HealthBoard, now_ns: u64);
}

/// Runs a [`Source`], one turn at a time.
pub struct SourceCycle {
    monitor: DeadlineMonitor,
    health: HealthBoard,
    recorder: Recorder,
    next_ns: u64,
    ended: bool,
    on_miss: OnMiss,
    lateness: Lateness,
}

impl SourceCycle {
    /// A cycle whose first frame is due at `first_ns`.
    ///
    /// # Errors
    /// None in practice; see [`crate::Latency::new`].
    pub fn new(
        monitor: DeadlineMonitor,
        health: HealthBoard,
        first_ns: u64,
    ) -> Result<Self, PortError> {
        Ok(Self {
            monitor,
            health,
            recorder: Recorder::new()?,
            next_ns: first_ns,
            ended: false,
            on_miss: OnMiss::default(),
            lateness: Lateness::default(),
        })
    }

    /// The same cycle with this answer to its own misses.
    #[must_use]
    pub const fn with_on_miss(mut self, on_miss: OnMiss) -> Self {
        self.on_miss = on_miss;
        self
    }

    /// The same cycle with this recorder.
    #[must_use]
    pub fn with_recorder(mut self, recorder: Recorder) -> Self {
        self.recorder = recorder;
        self
    }

    /// When the next turn is due, ns.
    #[must_use]
    pub fn next_wake_ns(&self) -> u64 {
        if self.ended {
            self.health.due_ns()
        } else {
            self.next_ns
        }
    }

    /// Announces that the ports are open.
    ///
    /// # Errors
    /// The transport's.
    pub fn ready(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        self.health.enter(ServiceState::Ready);
        self.health.publish(clock)
    }

    /// One turn: skip instants that were slept through (slips), produce, publish, account. Breaks
    /// when a deadline was missed and that is to end the service.
    ///
    /// # Errors
    /// The transport's.
    pub fn turn(
        &mut self,
        source: &mut impl Source,
        clock: &impl Clock,
    ) -> Result<ControlFlow<()>, PortError> {
        let woken_ns = clock.now_ns();
        let missed_before = self.monitor.missed();
        if !self.ended && woken_ns >= self.next_ns {
            let slips = (woken_ns - self.next_ns) / self.monitor.period_ns();
            let schedule_ns = self.next_ns + slips * self.monitor.period_ns();
            // Each instant that was slept through waited, too.
            for instant in 0..=slips.min(GAP_INSTANTS_MAX) {
                let late_ns = woken_ns - schedule_ns + instant * self.monitor.period_ns();
                self.recorder.timing.wake_up.record(late_ns);
            }
            match source.produce(schedule_ns, clock)? {
                SourceOutcome::Nothing => {}
                SourceOutcome::End => self.ended = true,
                SourceOutcome::Frame(published_ns) => {
                    self.account(schedule_ns, woken_ns, published_ns, slips);
                }
            }
            self.next_ns = schedule_ns + self.monitor.period_ns();
        }
        source.prepare()?;
        source.after(&mut self.health, clock.now_ns());
        self.health.publish(clock)?;
        let is_end = self.monitor.missed() > missed_before && self.on_miss == OnMiss::Stop;
        Ok(if is_end {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    }

    fn account(&mut self, schedule_ns: u64, woken_ns: u64, published_ns: u64, slips: u64) {
        let latency = &mut self.recorder.timing.from_schedule;
        let missed = self.monitor.published(schedule_ns, published_ns, latency);
        let cycle_ns = self.recorder.keep(CycleStamps {
            t_schedule_ns: schedule_ns,
            t_input_ns: schedule_ns,
            t_wake_ns: woken_ns,
            t_publish_ns: published_ns,
        });
        let seq = self.health.view().cycles;
        self.health.count_cycle(cycle_ns, seq);
        self.health.block().answered_seq = seq;
        self.health.enter(ServiceState::Running);
        let (total, accounted_ns) = (self.monitor.missed(), self.monitor.accounted_ns());
        let health = self.health.block();
        health.slips += slips;
        (health.missed, health.accounted_ns) = (total, accounted_ns);
        self.health.miss(published_ns, missed);
        let is_late = self.lateness.take(self.on_miss, missed, true);
        self.health
            .set_degraded(published_ns, Degraded::LATE, is_late);
    }

    /// Announces the end.
    ///
    /// # Errors
    /// The transport's.
    pub fn stop(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        self.health.enter(ServiceState::Stopping);
        self.health.publish(clock)
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
}

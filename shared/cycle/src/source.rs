//! The source of the graph: woken by its own absolute schedule.

use vigil_blocks::ServiceState;

use crate::clock::Clock;
use crate::deadline::DeadlineMonitor;
use crate::health::HealthBoard;
use crate::port::PortError;
use crate::stage::Timing;

/// What a source did at an instant of its schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Produced {
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
    fn produce(&mut self, t_schedule_ns: u64, clock: &dyn Clock) -> Result<Produced, PortError>;

    /// Reports events, handles control commands. Off the critical path.
    fn after(&mut self, health: &mut HealthBoard, now_ns: u64);
}

/// Runs a [`Source`], one turn at a time.
pub struct SourceCycle {
    monitor: DeadlineMonitor,
    health: HealthBoard,
    timing: Timing,
    next_ns: u64,
    ended: bool,
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
            timing: Timing::new()?,
            next_ns: first_ns,
            ended: false,
        })
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

    /// One turn: skip instants that were slept through (slips), produce, publish, account.
    ///
    /// # Errors
    /// The transport's.
    pub fn turn(&mut self, source: &mut impl Source, clock: &impl Clock) -> Result<(), PortError> {
        let woken_ns = clock.now_ns();
        if !self.ended && woken_ns >= self.next_ns {
            let slips = (woken_ns - self.next_ns) / self.monitor.period_ns();
            let schedule_ns = self.next_ns + slips * self.monitor.period_ns();
            self.timing.wake_up.record(woken_ns - schedule_ns);
            match source.produce(schedule_ns, clock)? {
                Produced::Nothing => {}
                Produced::End => self.ended = true,
                Produced::Frame(published_ns) => {
                    self.account(schedule_ns, woken_ns, published_ns, slips);
                }
            }
            self.next_ns = schedule_ns + self.monitor.period_ns();
        }
        source.after(&mut self.health, clock.now_ns());
        self.health.publish(clock)
    }

    fn account(&mut self, schedule_ns: u64, woken_ns: u64, published_ns: u64, slips: u64) {
        let missed =
            self.monitor
                .published(schedule_ns, published_ns, &mut self.timing.from_schedule);
        let cycle_ns = published_ns.saturating_sub(woken_ns);
        self.timing.step.record(cycle_ns);
        let seq = self.health.view().cycles;
        self.health.count_cycle(cycle_ns, seq);
        self.health.enter(ServiceState::Running);
        let (total, accounted_ns) = (self.monitor.missed(), self.monitor.accounted_ns());
        let health = self.health.block();
        health.slips += slips;
        (health.missed, health.accounted_ns) = (total, accounted_ns);
        self.health.miss(published_ns, missed);
    }

    /// Announces the end.
    ///
    /// # Errors
    /// The transport's.
    pub fn stop(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        self.health.enter(ServiceState::Stopping);
        self.health.publish(clock)
    }

    /// The histograms so far.
    #[must_use]
    pub const fn timing(&self) -> &Timing {
        &self.timing
    }

    /// The board.
    #[must_use]
    pub const fn health(&self) -> &HealthBoard {
        &self.health
    }
}

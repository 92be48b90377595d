//! A stage of the graph: woken by its input or its deadline.

use vigil_blocks::{Block, Cause, CauseKind, Header, ServiceState};

use crate::clock::Clock;
use crate::deadline::DeadlineMonitor;
use crate::health::HealthBoard;
use crate::input::{Arrival, InputAccount};
use crate::latency::Latency;
use crate::port::{PortError, Stamp};

/// Misses in a row after which the input counts as lost, and the service as degraded.
const LOST_AFTER_MISSES: u64 = 3;

/// A service's work, as the cycle sees it. Implementations hold the ports and the filter.
pub trait Stage {
    /// Takes every waiting input block (accounted through `intake`), stepping the filter for each
    /// frame; writes the result into the loaned output blocks.
    fn take(&mut self, intake: &mut Intake<'_>);

    /// The deadline passed `count` times without input: writes the prediction into the output.
    fn miss(&mut self, count: u32);

    /// Publishes the output blocks; the last is the one that downstream waits for. Returns its
    /// publication instant, ns.
    ///
    /// # Errors
    /// The transport's.
    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError>;

    /// Reports events of the last step, adds the accounts of further inputs (anew in each turn),
    /// handles control commands. Off the critical path.
    fn after(&mut self, health: &mut HealthBoard, now_ns: u64);
}

/// What the stage takes in one turn.
pub struct Intake<'a> {
    account: &'a mut InputAccount,
    now_ns: u64,
    period_ns: u64,
    /// Frames stepped in this turn.
    frames: u32,
    newest: Header,
    new_epoch: bool,
    cause: Cause,
}

impl Intake<'_> {
    /// Accounts an input block; true if it is to be taken.
    pub fn accept<T: Block>(&mut self, header: &Header) -> bool {
        let arrival = self
            .account
            .arrive::<T>(header, self.now_ns, self.period_ns);
        self.new_epoch |= arrival == Arrival::NewEpoch;
        arrival.is_taken()
    }

    /// The filter has stepped the sensor frame (epoch, seq) behind the accepted block with this
    /// header: the output answers its instant of the schedule.
    pub fn stepped(&mut self, header: &Header, (frame_epoch, frame_seq): (u64, u64)) {
        // An old frame never moves the schedule back.
        if self.frames == 0 || header.t_schedule_ns >= self.newest.t_schedule_ns || self.new_epoch {
            self.newest = *header;
            self.new_epoch = false;
        }
        self.frames += 1;
        self.cause = Cause {
            kind: CauseKind::Frame as u32,
            count: self.frames,
            frame_epoch,
            frame_seq,
        };
    }

    /// The instant at which this turn began, ns.
    #[must_use]
    pub const fn now_ns(&self) -> u64 {
        self.now_ns
    }
}

/// The histograms of a service.
#[derive(Debug, Clone)]
pub struct Timing {
    /// From the publication of the input to the wake-up, ns.
    pub wake_up: Latency,
    /// From the wake-up to the publication of the output, ns.
    pub step: Latency,
    /// From the sensor's scheduled instant to the publication of the output, ns; every instant of
    /// the schedule is in it.
    pub from_schedule: Latency,
}

impl Timing {
    /// Empty histograms.
    ///
    /// # Errors
    /// None in practice; see [`Latency::new`].
    pub fn new() -> Result<Self, PortError> {
        let new = || Latency::new().map_err(|error| PortError::setup("histogram", &error));
        Ok(Self {
            wake_up: new()?,
            step: new()?,
            from_schedule: new()?,
        })
    }
}

/// Runs a [`Stage`], one turn at a time.
pub struct StageCycle {
    monitor: DeadlineMonitor,
    account: InputAccount,
    health: HealthBoard,
    timing: Timing,
    last_cause: Cause,
    last_stamp: Stamp,
    misses_in_a_row: u64,
}

impl StageCycle {
    /// A cycle with this monitor and board.
    ///
    /// # Errors
    /// None in practice; see [`Latency::new`].
    pub fn new(monitor: DeadlineMonitor, health: HealthBoard) -> Result<Self, PortError> {
        Ok(Self {
            monitor,
            account: InputAccount::default(),
            health,
            timing: Timing::new()?,
            last_cause: Cause::default(),
            last_stamp: Stamp::default(),
            misses_in_a_row: 0,
        })
    }

    /// When the next turn is due at the latest, ns.
    #[must_use]
    pub fn next_wake_ns(&self) -> u64 {
        let deadline_ns = self
            .monitor
            .next_deadline_ns()
            .map_or(u64::MAX, |ns| ns + 1);
        deadline_ns.min(self.health.due_ns())
    }

    /// Announces that the ports are open.
    ///
    /// # Errors
    /// The transport's.
    pub fn ready(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        self.health.enter(ServiceState::Ready);
        self.health.publish(clock)
    }

    /// One turn: count passed deadlines, take input, step, publish, account.
    ///
    /// # Errors
    /// The transport's.
    pub fn turn(&mut self, stage: &mut impl Stage, clock: &impl Clock) -> Result<(), PortError> {
        let woken_ns = clock.now_ns();
        let mut overdue = self.monitor.overdue(woken_ns);
        let mut intake = Intake {
            account: &mut self.account,
            now_ns: woken_ns,
            period_ns: self.monitor.period_ns(),
            frames: 0,
            newest: Header::default(),
            new_epoch: false,
            cause: self.last_cause,
        };
        stage.take(&mut intake);
        let (frames, newest, cause) = (intake.frames, intake.newest, intake.cause);
        if frames > 0 {
            let stamp = Stamp::of(&newest);
            let published_ns = stage.publish(cause, stamp, clock)?;
            self.health.block().late +=
                u64::from(woken_ns > newest.t_schedule_ns + self.monitor.deadline_ns());
            self.timing
                .wake_up
                .record(woken_ns.saturating_sub(newest.t_publish_ns));
            let cycle_ns = published_ns.saturating_sub(woken_ns);
            self.timing.step.record(cycle_ns);
            self.health.count_cycle(cycle_ns, newest.seq);
            overdue += self.monitor.published(
                stamp.t_schedule_ns,
                published_ns,
                &mut self.timing.from_schedule,
            );
            (self.last_cause, self.last_stamp) = (cause, stamp);
        } else if overdue > 0 {
            let count = u32::try_from(overdue).unwrap_or(u32::MAX);
            stage.miss(count);
            let cause = Cause {
                kind: CauseKind::Missed as u32,
                count,
                ..self.last_cause
            };
            let t_schedule_ns = self.monitor.last_accounted_ns();
            stage.publish(
                cause,
                Stamp {
                    t_schedule_ns,
                    ..self.last_stamp
                },
                clock,
            )?;
        }
        self.report(stage, frames, overdue, clock)
    }

    fn report(
        &mut self,
        stage: &mut impl Stage,
        frames: u32,
        overdue: u64,
        clock: &impl Clock,
    ) -> Result<(), PortError> {
        use vigil_blocks::EventKind::{InputBack, InputLost};
        let now_ns = clock.now_ns();
        self.health.miss(now_ns, overdue);
        let was_lost = self.misses_in_a_row >= LOST_AFTER_MISSES;
        self.misses_in_a_row = if frames > 0 {
            0
        } else {
            self.misses_in_a_row + overdue
        };
        let is_lost = self.misses_in_a_row >= LOST_AFTER_MISSES;
        if is_lost != was_lost {
            let kind = if is_lost { InputLost } else { InputBack };
            self.health
                .event(now_ns, kind, 0, 0.0, self.misses_in_a_row);
            self.health.set_degraded(is_lost);
        }
        if frames > 0 {
            self.health.enter(ServiceState::Running);
        }
        let (missed, accounted_ns) = (self.monitor.missed(), self.monitor.accounted_ns());
        let (lost, duplicate, invalid) = (
            self.account.lost,
            self.account.duplicate,
            self.account.invalid,
        );
        let health = self.health.block();
        (health.missed, health.accounted_ns) = (missed, accounted_ns);
        (health.lost, health.duplicate, health.invalid) = (lost, duplicate, invalid);
        stage.after(&mut self.health, now_ns);
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

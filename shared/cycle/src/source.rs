//! The source of the graph: woken by its own absolute schedule.

use std::ops::ControlFlow;

use crate::clock::Clock;
use crate::cycle_account::{CycleAccount, TurnResult};
use crate::deadline::GAP_INSTANTS_MAX;
use crate::failure::{Work, work_on};
use crate::health::HealthBoard;
use crate::port_error::PortError;
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
    account: CycleAccount,
    next_ns: u64,
    ended: bool,
}

impl SourceCycle {
    /// A cycle that keeps this account; its first frame is due at `first_ns`.
    #[must_use]
    pub const fn new(account: CycleAccount, first_ns: u64) -> Self {
        Self {
            account,
            next_ns: first_ns,
            ended: false,
        }
    }

    /// What it accounts.
    #[must_use]
    pub const fn account(&self) -> &CycleAccount {
        &self.account
    }

    /// What it accounts, to announce start and stop.
    pub const fn account_mut(&mut self) -> &mut CycleAccount {
        &mut self.account
    }

    /// When the next turn is due, ns.
    #[must_use]
    pub fn next_wake_ns(&self) -> u64 {
        // After the end no frame is due any more: only the health block still goes out.
        if self.ended {
            self.account.health.due_ns()
        } else {
            self.next_ns
        }
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
        let mut turn = TurnResult {
            missed: 0,
            is_published: false,
        };
        if !self.ended && woken_ns >= self.next_ns {
            turn = self.produce(source, woken_ns, clock)?;
        }
        source.prepare()?;
        let now_ns = clock.now_ns();
        self.account.settle(now_ns, turn);
        source.after(&mut self.account.health, now_ns);
        self.account.health.publish(clock)?;
        Ok(self.account.verdict(turn.missed))
    }

    /// Produces the frame of the newest instant that is due, and accounts those slept through.
    fn produce(
        &mut self,
        source: &mut impl Source,
        woken_ns: u64,
        clock: &impl Clock,
    ) -> Result<TurnResult, PortError> {
        let period_ns = self.account.monitor.period_ns();
        let slips = (woken_ns - self.next_ns) / period_ns;
        let schedule_ns = self.next_ns + slips * period_ns;
        work_on(Work::Frame {
            t_schedule_ns: schedule_ns,
        });
        let timing = &mut self.account.recorder.timing;
        // Each instant that was slept through waited, too.
        for instant in 0..=slips.min(GAP_INSTANTS_MAX) {
            let late_ns = woken_ns - schedule_ns + instant * period_ns;
            timing.wake_up.record(late_ns);
        }
        self.next_ns = schedule_ns + period_ns;
        let published_ns = match source.produce(schedule_ns, clock)? {
            SourceOutcome::Frame(published_ns) => published_ns,
            outcome => {
                self.ended |= outcome == SourceOutcome::End;
                return Ok(TurnResult {
                    missed: 0,
                    is_published: false,
                });
            }
        };
        assert!(
            published_ns >= woken_ns,
            "a frame is published after the wake-up: {published_ns} < {woken_ns} ns"
        );
        let cycle = CycleStamps {
            t_schedule_ns: schedule_ns,
            t_input_ns: schedule_ns,
            t_wake_ns: woken_ns,
            t_publish_ns: published_ns,
        };
        let account = &mut self.account;
        let seq = account.health.view().cycles;
        let latency = &mut account.recorder.timing.from_schedule;
        let missed = account
            .monitor
            .published(schedule_ns, published_ns, latency);
        account.count_cycle(cycle, seq);
        let health = account.health.block();
        health.answered_seq = seq;
        health.slips += slips;
        Ok(TurnResult {
            missed,
            is_published: true,
        })
    }
}

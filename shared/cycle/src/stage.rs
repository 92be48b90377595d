//! A stage of the graph: woken by its input or its deadline.

use std::ops::ControlFlow;

use vigil_blocks::{Block, BlockId, Cause, CauseKind, Header, Rejection};

use crate::clock::Clock;
use crate::cycle_account::{CycleAccount, TurnResult};
use crate::failure::{Work, work_on};
use crate::health::HealthBoard;
use crate::input::{Arrival, InputAccount, Writer};
use crate::port::Stamp;
use crate::port_error::PortError;
use crate::shed::Shedder;
use crate::stamps::CycleStamps;

/// Misses in a row after which the input counts as lost, and the service as degraded. With fewer, a
/// single stall of the machine would count; with more, a loss would show later.
const LOST_AFTER_MISSES: u64 = 3;
/// After a wake-up without input the stage ignores wake-ups for this part of a period at least: a
/// flood of them takes a core for 1/32 of the time at most. Larger, it would answer late.
const PAUSE_PERIOD_PART: u64 = 32;
/// It listens again this part of a period before its input is expected: more than inputs jitter.
const EARLY_PERIOD_PART: u64 = 16;

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

    /// Readies the blocks of the next cycle, see [`crate::Sender::prepare`], and whatever else does
    /// not depend on its input. Off the critical path.
    ///
    /// # Errors
    /// The transport's.
    fn prepare(&mut self) -> Result<(), PortError>;

    /// Hypotheses or particles that this stage is configured for; 0 if it has none to shed.
    fn particles(&self) -> u32 {
        0
    }

    /// Those that the last cycle may have worked on; 0 if it worked on none.
    fn particles_in_use(&self) -> u32 {
        self.particles()
    }

    /// From now on at most `particles`: the time allows no more.
    fn limit(&mut self, _particles: u32) {}

    /// Who writes its input: what comes from outside the graph is checked accordingly.
    fn writer(&self) -> Writer {
        Writer::Service
    }

    /// False if without input there is nothing to publish.
    fn predicts(&self) -> bool {
        true
    }

    /// True if input waits in shared memory, announced or not: for a stage that spins before it
    /// blocks. Costs no system call.
    fn has_input(&self) -> bool {
        false
    }

    /// Reports events of the last step, adds the accounts of further inputs (anew in each turn),
    /// handles control commands. Off the critical path.
    fn after(&mut self, health: &mut HealthBoard, now_ns: u64);

    /// Publishes the journal of this turn, see [`crate::JournalWriter::publish`]. The last of all.
    ///
    /// # Errors
    /// The transport's.
    fn keep_journal(&mut self, _stamp: Stamp, _clock: &dyn Clock) -> Result<(), PortError> {
        Ok(())
    }
}

/// What the stage takes in one turn.
pub struct Intake<'a> {
    account: &'a mut InputAccount,
    clock: &'a dyn Clock,
    period_ns: u64,
    /// True if a block was taken in this turn, of whichever input.
    is_input: bool,
    /// Frames stepped in this turn.
    frames: u32,
    newest: Header,
    new_epoch: bool,
    cause: Cause,
}

impl Intake<'_> {
    /// Accounts an input block; true if it is to be taken.
    pub fn accept<T: Block>(&mut self, header: &Header) -> bool {
        self.admit::<T>(header, || Ok(()))
    }

    /// Accounts a block from outside the graph; `content` checks what it holds.
    pub fn admit<T: Block>(
        &mut self,
        header: &Header,
        content: impl FnOnce() -> Result<(), Rejection>,
    ) -> bool {
        let (now_ns, period_ns) = (self.now_ns(), self.period_ns);
        let arrival = self.account.admit::<T>(header, now_ns, period_ns, content);
        if arrival.is_taken() {
            let BlockId { epoch, seq } = header.id();
            work_on(Work::Input { epoch, seq });
        }
        self.new_epoch |= arrival == Arrival::NewEpoch;
        self.is_input |= arrival.is_taken();
        arrival.is_taken()
    }

    /// Accounts a block of a further input in an account of the stage's own; true if it is to be
    /// taken.
    pub fn admit_further<T: Block>(
        &self,
        account: &mut InputAccount,
        header: &Header,
        content: impl FnOnce() -> Result<(), Rejection>,
    ) -> bool {
        let arrival = account.admit::<T>(header, self.now_ns(), self.period_ns, content);
        arrival.is_taken()
    }

    /// A block of a further input was taken: the wake-up was not for nothing.
    pub const fn took_further(&mut self) {
        self.is_input = true;
    }

    /// Accounts what the known writer sent and was refused before its header could be read.
    pub fn reject(&mut self, rejection: Rejection) {
        self.account.reject(rejection);
    }

    /// Accounts what was refused and cannot be attributed to a writer.
    pub fn count(&mut self, rejection: Rejection) {
        self.account.count(rejection);
    }

    /// The filter has stepped `frame`, the sensor frame behind the accepted block with this header:
    /// the output answers its instant of the schedule.
    pub fn stepped(&mut self, header: &Header, frame: BlockId) {
        // An old frame never moves the schedule back.
        if header.t_schedule_ns >= self.newest.t_schedule_ns || self.new_epoch {
            self.newest = *header;
            self.new_epoch = false;
        }
        self.frames += 1;
        self.cause = Cause {
            kind: CauseKind::Frame as u32,
            count: self.frames,
            frame_epoch: frame.epoch,
            frame_seq: frame.seq,
        };
    }

    /// Now, ns. Read anew for each block: during a long turn blocks arrive that were not due when
    /// it began.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }
}

/// Runs a [`Stage`], one turn at a time.
pub struct StageCycle {
    account: CycleAccount,
    input: InputAccount,
    last_cause: Cause,
    last_stamp: Stamp,
    misses_in_a_row: u64,
    shedder: Option<Shedder>,
    /// From the schedule to the publication of the last input, ns.
    input_offset_ns: u64,
    /// From the schedule to the wake-up of the last cycle, ns.
    woken_after_ns: u64,
    /// True if the last turn has taken a block.
    had_input: bool,
}

impl StageCycle {
    /// A cycle that keeps this account.
    #[must_use]
    pub fn new(account: CycleAccount) -> Self {
        Self {
            account,
            input: InputAccount::default(),
            last_cause: Cause::default(),
            last_stamp: Stamp::default(),
            misses_in_a_row: 0,
            shedder: None,
            input_offset_ns: 0,
            woken_after_ns: 0,
            had_input: false,
        }
    }

    /// The same cycle, whose input comes from this kind of writer.
    #[must_use]
    pub fn with_input_of(mut self, writer: Writer) -> Self {
        self.input = InputAccount::new(writer);
        self
    }

    /// The same cycle, which sheds hypotheses or particles of the stage before its budget is spent.
    #[must_use]
    pub fn with_shedder(mut self, shedder: Shedder) -> Self {
        self.shedder = Some(shedder);
        self
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

    /// When the next input is to be expected, ns: a period after the last one came; `None` before
    /// the first, and while the input is lost.
    #[must_use]
    pub fn expected_input_ns(&self) -> Option<u64> {
        Some(
            self.next_schedule_ns()?
                .saturating_add(self.input_offset_ns),
        )
    }

    /// When the next instant of the schedule is, ns; `None` before the first input, and while the
    /// input is lost.
    fn next_schedule_ns(&self) -> Option<u64> {
        let next_ns = self.last_stamp.t_schedule_ns + self.account.monitor.period_ns();
        (self.last_stamp.t_schedule_ns > 0 && self.misses_in_a_row == 0).then_some(next_ns)
    }

    /// True if the last turn has taken a block of an input, with a frame behind it or without.
    #[must_use]
    pub const fn had_input(&self) -> bool {
        self.had_input
    }

    /// When to listen again after a wake-up at `now_ns` that brought no input, ns: shortly before
    /// the next input is expected, after a short pause if that is now, and no later than the next
    /// turn is due.
    #[must_use]
    pub fn listens_again_ns(&self, now_ns: u64) -> u64 {
        let period_ns = self.account.monitor.period_ns();
        let early_ns = period_ns / EARLY_PERIOD_PART;
        // The last input may have been late: the next may come as soon as it is due.
        let expected_ns = self
            .next_schedule_ns()
            .map_or(0, |ns| ns.saturating_sub(early_ns));
        let pause_ends_ns = now_ns + period_ns / PAUSE_PERIOD_PART;
        expected_ns.max(pause_ends_ns).min(self.next_wake_ns())
    }

    /// When the next turn is due at the latest, ns.
    #[must_use]
    pub fn next_wake_ns(&self) -> u64 {
        let deadline_ns = self
            .account
            .monitor
            .next_deadline_ns()
            .map_or(u64::MAX, |ns| ns + 1);
        deadline_ns.min(self.account.health.due_ns())
    }

    /// One turn: count passed deadlines, take input, step, publish, account. Breaks when a deadline
    /// was missed and that is to end the service.
    ///
    /// # Errors
    /// The transport's.
    pub fn turn(
        &mut self,
        stage: &mut impl Stage,
        clock: &impl Clock,
    ) -> Result<ControlFlow<()>, PortError> {
        let woken_ns = clock.now_ns();
        let mut missed = self.account.monitor.overdue(woken_ns);
        let mut intake = Intake {
            account: &mut self.input,
            clock,
            period_ns: self.account.monitor.period_ns(),
            is_input: false,
            frames: 0,
            newest: Header::default(),
            new_epoch: false,
            cause: self.last_cause,
        };
        stage.take(&mut intake);
        let (frames, newest, cause) = (intake.frames, intake.newest, intake.cause);
        self.had_input = intake.is_input;
        assert!(
            frames == 0 || self.had_input,
            "a stage steps only frames behind blocks that it has accepted"
        );
        if frames > 0 {
            let stamp = Stamp::from_header(&newest);
            let published_ns = stage.publish(cause, stamp, clock)?;
            assert!(
                published_ns >= woken_ns,
                "a block is published after the wake-up: {published_ns} < {woken_ns} ns"
            );
            // A block that came during this turn woke nobody: the wait for it ends with its
            // publication.
            let woken_ns = woken_ns.max(newest.t_publish_ns.min(published_ns));
            missed += self.answered(&newest, cause, woken_ns, published_ns);
            (self.last_cause, self.last_stamp) = (cause, stamp);
        } else if missed > 0 {
            self.predict(stage, missed, clock)?;
        }
        stage.prepare()?;
        let turn = TurnResult {
            missed,
            is_published: frames > 0,
        };
        self.report(stage, turn, clock)?;
        stage.keep_journal(self.last_stamp, clock)?;
        Ok(self.account.verdict(missed))
    }

    /// Accounts a cycle that answered the input behind `newest`; returns how many instants it
    /// reveals as missed.
    fn answered(&mut self, newest: &Header, cause: Cause, woken_ns: u64, published_ns: u64) -> u64 {
        let account = &mut self.account;
        let timing = &mut account.recorder.timing;
        timing
            .wake_up
            .record(woken_ns.saturating_sub(newest.t_publish_ns));
        let from_schedule = &mut timing.from_schedule;
        let missed = account
            .monitor
            .published(newest.t_schedule_ns, published_ns, from_schedule);
        let cycle = CycleStamps {
            t_schedule_ns: newest.t_schedule_ns,
            t_input_ns: newest.t_publish_ns,
            t_wake_ns: woken_ns,
            t_publish_ns: published_ns,
        };
        account.count_cycle(cycle, newest.seq);
        // A publisher outside the graph may claim any time of publication.
        let offset_ns = newest.t_publish_ns.saturating_sub(newest.t_schedule_ns);
        self.input_offset_ns = offset_ns.min(account.monitor.deadline_ns());
        self.woken_after_ns = woken_ns.saturating_sub(newest.t_schedule_ns);
        let health = account.health.block();
        (health.answered_epoch, health.answered_seq) = (cause.frame_epoch, cause.frame_seq);
        health.late += u64::from(woken_ns > newest.t_schedule_ns + account.monitor.deadline_ns());
        missed
    }

    /// The deadline has passed without input: publishes the prediction, if that is wanted.
    fn predict(
        &mut self,
        stage: &mut impl Stage,
        missed: u64,
        clock: &impl Clock,
    ) -> Result<(), PortError> {
        if !self.account.on_miss.predicts() || !stage.predicts() {
            return Ok(());
        }
        let count = u32::try_from(missed).unwrap_or(u32::MAX);
        work_on(Work::Missed(count));
        stage.miss(count);
        let cause = Cause {
            kind: CauseKind::Missed as u32,
            count,
            ..self.last_cause
        };
        let stamp = Stamp {
            t_schedule_ns: self.account.monitor.last_accounted_ns(),
            ..self.last_stamp
        };
        stage.publish(cause, stamp, clock).map(drop)
    }

    /// Off the critical path: fewer particles if the time is short, more if there is room.
    fn shed(&mut self, stage: &mut impl Stage, now_ns: u64) {
        let Some(shedder) = &mut self.shedder else {
            return;
        };
        let health = &mut self.account.health;
        let cycle_ns = health.view().last_cycle_ns;
        let in_use = stage.particles_in_use();
        if let Some(particles) = shedder.take(cycle_ns, self.woken_after_ns, in_use) {
            stage.limit(particles);
        }
        health.set_particles(now_ns, shedder.allowed(), shedder.configured());
    }

    /// Off the critical path: accounts the turn, and publishes Health if it is due.
    fn report(
        &mut self,
        stage: &mut impl Stage,
        turn: TurnResult,
        clock: &impl Clock,
    ) -> Result<(), PortError> {
        let now_ns = clock.now_ns();
        self.account.settle(now_ns, turn);
        self.misses_in_a_row = if turn.is_published {
            0
        } else {
            self.misses_in_a_row + turn.missed
        };
        let is_lost = self.misses_in_a_row >= LOST_AFTER_MISSES;
        let health = &mut self.account.health;
        health.set_input_lost(now_ns, is_lost, self.misses_in_a_row);
        if turn.is_published {
            self.shed(stage, now_ns);
        }
        let health = &mut self.account.health;
        health.set_input(now_ns, &self.input);
        stage.after(health, now_ns);
        health.publish(clock)
    }
}

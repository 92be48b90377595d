//! A service's account of itself, and when to publish it.

use vigil_blocks::{
    Degraded, EVENTS, Event, EventKind, Health, REJECTIONS, Rejection, ServiceState,
};

use crate::clock::Clock;
use crate::deadline::Schedule;
use crate::input::InputAccount;
use crate::placement::{self, Placement, PlacementRequest};
use crate::port::{Sender, Stamp};
use crate::port_error::PortError;

/// Health goes out at least this often, ns; at once when something happens. Chosen: twenty a second
/// look live to a person, and cost one block a few cycles.
pub const HEALTH_PERIOD_NS: u64 = 50_000_000;

/// Events of misses are at least this far apart, ns, and sum up what came between: a flood of them
/// must not push other events out of the ring.
const MISS_EVENT_INTERVAL_NS: u64 = 100_000_000;
/// Events of refused blocks are at least this far apart, ns: a source that misbehaves for minutes
/// must not fill the timeline. Chosen: a line each second; a longer time delays the news.
const REJECTED_EVENT_INTERVAL_NS: u64 = 1_000_000_000;

/// Collects counters and events, and publishes them.
pub struct HealthBoard {
    block: Health,
    /// What was published last.
    published: Health,
    /// Misses in events so far, and those that await the next one.
    misses_in_events: u64,
    pending_misses: u64,
    next_miss_event_ns: u64,
    /// Refused blocks in events so far.
    rejected_in_events: [u64; REJECTIONS],
    next_rejected_event_ns: u64,
    sender: Box<dyn Sender<Health>>,
    published_ns: u64,
    changed: bool,
}

impl HealthBoard {
    /// A board for a service with this schedule and placement.
    #[must_use]
    pub fn new(
        sender: Box<dyn Sender<Health>>,
        schedule: Schedule,
        wanted: PlacementRequest,
        got: Placement,
    ) -> Self {
        let block = Health {
            period_ns: schedule.period_ns,
            deadline_ns: schedule.deadline_ns,
            budget_ns: schedule.budget_ns,
            state: ServiceState::Starting as u32,
            core_wanted: u32::try_from(wanted.core).unwrap_or(u32::MAX),
            core: u32::try_from(got.core).unwrap_or(u32::MAX),
            pinned: u32::from(got.pinned),
            policy: got.policy,
            priority: got.priority,
            memory_locked: u32::from(got.memory_locked),
            pid: std::process::id(),
            ..Health::default()
        };
        Self {
            block,
            published: block,
            misses_in_events: 0,
            pending_misses: 0,
            next_miss_event_ns: 0,
            rejected_in_events: [0; REJECTIONS],
            next_rejected_event_ns: 0,
            sender,
            published_ns: 0,
            changed: true,
        }
    }

    /// The counters, to be kept up to date by the cycle.
    pub(crate) const fn block(&mut self) -> &mut Health {
        &mut self.block
    }

    /// A read-only view of the counters.
    #[must_use]
    pub const fn view(&self) -> &Health {
        &self.block
    }

    /// Counts a cycle that took `cycle_ns` from wake-up to publication, for the block `seq`.
    pub(crate) const fn count_cycle(&mut self, cycle_ns: u64, seq: u64) {
        let health = &mut self.block;
        health.cycles += 1;
        health.over_budget += (cycle_ns > health.budget_ns) as u64;
        health.last_cycle_ns = cycle_ns;
        if cycle_ns > health.worst_cycle_ns {
            (health.worst_cycle_ns, health.worst_cycle_seq) = (cycle_ns, seq);
        }
    }

    /// Enters a state; published at once.
    pub(crate) fn enter(&mut self, state: ServiceState) {
        if self.block.state != state as u32 {
            self.block.state = state as u32;
            self.changed = true;
        }
    }

    /// Sets or clears a reason for degraded mode, one of [`Degraded`]; published at once.
    pub(crate) fn set_degraded(&mut self, now_ns: u64, reason: u32, is_degraded: bool) {
        let bits = self.block.degraded & !reason | if is_degraded { reason } else { 0 };
        if self.block.degraded != bits {
            self.block.degraded = bits;
            self.changed = true;
            // A lost input has an event of its own.
            if reason != Degraded::INPUT_LOST {
                self.event(now_ns, EventKind::Degraded, bits, 0.0, 0);
            }
        }
    }

    /// Notes after how many misses in a row the input is lost, or that it is back.
    pub(crate) fn set_input_lost(&mut self, now_ns: u64, is_lost: bool, misses_in_a_row: u64) {
        if is_lost != (self.block.degraded & Degraded::INPUT_LOST != 0) {
            let kind = match is_lost {
                true => EventKind::InputLost,
                false => EventKind::InputBack,
            };
            self.event(now_ns, kind, 0, 0.0, misses_in_a_row);
            self.set_degraded(now_ns, Degraded::INPUT_LOST, is_lost);
        }
    }

    /// Notes what the monitor has accounted: misses, first and last instant.
    pub(crate) const fn set_accounted(&mut self, missed: u64, accounted_ns: [u64; 2]) {
        (self.block.missed, self.block.accounted_ns) = (missed, accounted_ns);
    }

    /// Notes the particles that the time allows; published at once when it changes.
    pub(crate) fn set_particles(&mut self, now_ns: u64, allowed: u32, configured: u32) {
        assert!(
            allowed <= configured,
            "no more particles are allowed than configured: {allowed} of {configured}"
        );
        if self.block.particles != allowed && self.block.particles_configured != 0 {
            let of = u64::from(configured);
            self.event(now_ns, EventKind::Particles, allowed, 0.0, of);
        }
        (self.block.particles, self.block.particles_configured) = (allowed, configured);
        self.set_degraded(now_ns, Degraded::FEWER_PARTICLES, allowed < configured);
    }

    /// Records the answer to a control command; published at once.
    pub fn answer_control(&mut self, epoch: u64, seq: u64, done: bool) {
        self.block.control_epoch = epoch;
        self.block.control_seq = seq;
        self.block.control_result = if done { 1 } else { 2 };
        self.changed = true;
    }

    /// Records an event; published at once.
    pub fn event(&mut self, t_ns: u64, kind: EventKind, what: u32, p: f64, value: u64) {
        let slot = (self.block.event_count % EVENTS as u64) as usize;
        self.block.events[slot] = Event {
            t_ns,
            kind: kind as u32,
            what,
            p,
            value,
        };
        self.block.event_count += 1;
        self.changed = true;
    }

    /// Records misses as an event: at once, but summed up when they come in a flood.
    pub(crate) fn miss(&mut self, now_ns: u64, count: u64) {
        self.pending_misses += count;
        if self.pending_misses > 0 && now_ns >= self.next_miss_event_ns {
            self.event(now_ns, EventKind::Miss, 0, 0.0, self.pending_misses);
            self.misses_in_events += std::mem::take(&mut self.pending_misses);
            self.next_miss_event_ns = now_ns + MISS_EVENT_INTERVAL_NS;
        }
    }

    /// Copies the counters of the input's account; records refused blocks as events, summed up, and
    /// a quarantine at once.
    pub(crate) fn set_input(&mut self, now_ns: u64, account: &InputAccount) {
        let health = &mut self.block;
        (health.lost, health.duplicate) = (account.lost, account.duplicate);
        (health.invalid, health.rejected) = (account.invalid, account.rejected);
        self.set_degraded(now_ns, Degraded::QUARANTINE, account.is_quarantined());
        if account.rejected == self.rejected_in_events || now_ns < self.next_rejected_event_ns {
            return;
        }
        for &rejection in Rejection::ALL {
            let i = rejection as usize;
            let count = account.rejected[i] - self.rejected_in_events[i];
            if count > 0 {
                self.event(now_ns, EventKind::Rejected, rejection as u32, 0.0, count);
            }
        }
        self.rejected_in_events = account.rejected;
        self.next_rejected_event_ns = now_ns + REJECTED_EVENT_INTERVAL_NS;
    }

    /// Adds the counters of a further input's account.
    pub fn add_input(&mut self, account: &InputAccount) {
        let health = &mut self.block;
        health.lost += account.lost;
        health.duplicate += account.duplicate;
        health.invalid += account.invalid;
        for (sum, count) in health.rejected.iter_mut().zip(account.rejected) {
            *sum += count;
        }
    }

    /// When the block has to go out next, ns.
    #[must_use]
    pub const fn due_ns(&self) -> u64 {
        self.published_ns + HEALTH_PERIOD_NS
    }

    /// Publishes if something changed or the time has come.
    ///
    /// # Errors
    /// The transport's.
    pub fn publish(&mut self, clock: &impl Clock) -> Result<(), PortError> {
        let now_ns = clock.now_ns();
        if !self.changed && now_ns < self.due_ns() {
            return Ok(());
        }
        self.block.core = u32::try_from(placement::current_core()).unwrap_or(u32::MAX);
        self.assert_consistent();
        self.published = self.block;
        *self.sender.block() = self.block;
        self.sender.send(
            Stamp {
                t_schedule_ns: now_ns,
                t_capture_ns: now_ns,
            },
            clock,
        )?;
        self.published_ns = now_ns;
        self.changed = false;
        Ok(())
    }

    /// Counters only grow, and they add up.
    fn assert_consistent(&self) {
        let (now, before) = (&self.block, &self.published);
        for (name, count, before) in [
            ("cycles", now.cycles, before.cycles),
            ("missed", now.missed, before.missed),
            ("over_budget", now.over_budget, before.over_budget),
            ("slips", now.slips, before.slips),
            ("lost", now.lost, before.lost),
            ("late", now.late, before.late),
            ("duplicate", now.duplicate, before.duplicate),
            ("invalid", now.invalid, before.invalid),
            ("event_count", now.event_count, before.event_count),
            (
                "last accounted",
                now.accounted_ns[1],
                before.accounted_ns[1],
            ),
        ] {
            assert!(count >= before, "{name} only grows: {count} after {before}");
        }
        assert!(
            now.over_budget <= now.cycles && now.late <= now.cycles,
            "late cycles and those over budget are cycles"
        );
        let refused: u64 = now.rejected.iter().sum();
        assert!(
            refused == now.duplicate + now.invalid,
            "each refused block has one cause: {refused} causes, {} duplicate, {} invalid",
            now.duplicate,
            now.invalid
        );
        let in_events = self.misses_in_events + self.pending_misses;
        assert!(
            now.missed == in_events,
            "each miss is in one event: {} missed, {in_events} in events",
            now.missed
        );
    }
}

/// Reads the events of `health` from number `seen` on, and moves `seen` behind them. Returns how
/// many were overwritten before they could be read.
pub fn new_events(health: &Health, seen: &mut u64, mut take: impl FnMut(&Event)) -> u64 {
    let oldest = health.event_count.saturating_sub(EVENTS as u64);
    let overwritten = oldest.saturating_sub(*seen);
    for n in (*seen).max(oldest)..health.event_count {
        take(&health.events[(n % EVENTS as u64) as usize]);
    }
    *seen = health.event_count;
    overwritten
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::clock::VirtualClock;
    use crate::port::{Bus, Graph};
    use crate::topic::{ServiceName, Topic};

    const SCHEDULE: Schedule = Schedule {
        period_ns: 1_000_000,
        deadline_ns: 750_000,
        budget_ns: 300_000,
    };

    /// A board after two cycles and three misses, and the clock of its graph.
    pub(crate) fn board() -> (HealthBoard, VirtualClock) {
        let clock = VirtualClock::default();
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let wanted = PlacementRequest {
            core: 0,
            priority: 0,
        };
        let sender = graph.sender(Topic::Health(ServiceName::Detector)).unwrap();
        let mut board = HealthBoard::new(sender, SCHEDULE, wanted, placement::read_back(0));
        board.count_cycle(1, 1);
        board.count_cycle(1, 2);
        board.miss(0, 3);
        board.set_accounted(3, [1, 5]);
        board.publish(&clock).unwrap();
        (board, clock)
    }

    #[test]
    fn misses_are_an_event_at_once_and_summed_up_while_they_flood() {
        let (mut board, _) = board();
        assert_eq!(board.block.event_count, 1, "the first three");
        board.miss(MISS_EVENT_INTERVAL_NS - 1, 2);
        assert_eq!(board.block.event_count, 1, "too soon after those");
        board.miss(MISS_EVENT_INTERVAL_NS, 0);
        assert_eq!(board.block.event_count, 2);
        assert_eq!(board.block.events[1].value, 2, "what came between");
        board.miss(3 * MISS_EVENT_INTERVAL_NS, 0);
        assert_eq!(board.block.event_count, 2, "nothing is no event");
    }

    /// Publishes a board that was changed behind its back.
    fn publish_broken(change: impl FnOnce(&mut HealthBoard)) {
        let (mut board, clock) = board();
        change(&mut board);
        board.changed = true;
        board.publish(&clock).unwrap();
    }

    #[test]
    fn the_board_of_these_tests_is_sound() {
        publish_broken(|_| {});
    }

    #[test]
    #[should_panic(expected = "cycles only grows: 1 after 2")]
    fn a_counter_that_shrinks_is_found() {
        publish_broken(|board| board.block.cycles = 1);
    }

    #[test]
    #[should_panic(expected = "last accounted only grows: 4 after 5")]
    fn an_accounted_instant_that_goes_back_is_found() {
        publish_broken(|board| board.set_accounted(3, [1, 4]));
    }

    #[test]
    #[should_panic(expected = "late cycles and those over budget are cycles")]
    fn more_late_cycles_than_cycles_are_found() {
        publish_broken(|board| board.block.late = 3);
    }

    #[test]
    #[should_panic(expected = "each refused block has one cause: 1 causes, 0 duplicate, 0 invalid")]
    fn a_refused_block_that_is_not_counted_is_found() {
        publish_broken(|board| board.block.rejected[0] = 1);
    }

    #[test]
    #[should_panic(expected = "each miss is in one event: 4 missed, 3 in events")]
    fn a_miss_without_an_event_is_found() {
        publish_broken(|board| board.set_accounted(4, [1, 5]));
    }

    #[test]
    #[should_panic(expected = "no more particles are allowed than configured: 9 of 8")]
    fn more_particles_than_configured_are_found() {
        board().0.set_particles(0, 9, 8);
    }

    #[test]
    fn events_are_read_once_and_those_overwritten_are_counted() {
        let (mut board, _) = board();
        let mut seen = 0;
        assert_eq!(new_events(board.view(), &mut seen, |_| {}), 0);
        for n in 0..EVENTS as u64 + 2 {
            board.event(n, EventKind::Run, 0, 0.0, n);
        }
        let mut values = Vec::new();
        let overwritten = new_events(board.view(), &mut seen, |event| values.push(event.value));
        assert_eq!(overwritten, 2);
        assert_eq!(values, (2..EVENTS as u64 + 2).collect::<Vec<_>>());
        assert_eq!(new_events(board.view(), &mut seen, |_| values.clear()), 0);
        assert_eq!(values.len(), EVENTS);
    }
}

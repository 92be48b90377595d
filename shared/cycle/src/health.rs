//! A service's account of itself, and when to publish it.

use vigil_blocks::{
    Degraded, EVENTS, Event, EventKind, Health, REJECTIONS, Rejection, ServiceState,
};

use crate::clock::Clock;
use crate::deadline::Schedule;
use crate::input::InputAccount;
use crate::placement::{self, Placement, PlacementRequest};
use crate::port::{PortError, Sender, Stamp};

/// Health goes out at least this often, ns; at once when something happens.
pub const HEALTH_PERIOD_NS: u64 = 50_000_000;

/// Misses are told at most this often, ns, summed up: a flood must not push out other events.
const MISS_EVENT_INTERVAL_NS: u64 = 100_000_000;
/// The same for refused blocks.
const REJECTED_EVENT_INTERVAL_NS: u64 = 1_000_000_000;

/// Collects counters and events, and publishes them.
pub struct HealthBoard {
    block: Health,
    untold_misses: u64,
    next_miss_event_ns: u64,
    /// Refused blocks that were told, and when the next may be.
    rejected_told: [u64; REJECTIONS],
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
            untold_misses: 0,
            next_miss_event_ns: 0,
            rejected_told: [0; REJECTIONS],
            next_rejected_event_ns: 0,
            sender,
            published_ns: 0,
            changed: true,
        }
    }

    /// The counters, to be kept up to date by the cycle.
    pub const fn block(&mut self) -> &mut Health {
        &mut self.block
    }

    /// A read-only view of the counters.
    #[must_use]
    pub const fn view(&self) -> &Health {
        &self.block
    }

    /// Counts a cycle that took `cycle_ns` from wake-up to publication, for the block `seq`.
    pub const fn count_cycle(&mut self, cycle_ns: u64, seq: u64) {
        let health = &mut self.block;
        health.cycles += 1;
        health.over_budget += (cycle_ns > health.budget_ns) as u64;
        health.last_cycle_ns = cycle_ns;
        if cycle_ns > health.worst_cycle_ns {
            (health.worst_cycle_ns, health.worst_cycle_seq) = (cycle_ns, seq);
        }
    }

    /// Enters a state; told at once.
    pub fn enter(&mut self, state: ServiceState) {
        if self.block.state != state as u32 {
            self.block.state = state as u32;
            self.changed = true;
        }
    }

    /// Sets or clears a reason for degraded mode, one of [`Degraded`]; told at once.
    pub fn set_degraded(&mut self, now_ns: u64, reason: u32, is_degraded: bool) {
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

    /// Notes the particles that the time allows; told at once when it changes.
    pub fn set_particles(&mut self, now_ns: u64, allowed: u32, configured: u32) {
        if self.block.particles != allowed && self.block.particles_configured != 0 {
            let of = u64::from(configured);
            self.event(now_ns, EventKind::Particles, allowed, 0.0, of);
        }
        (self.block.particles, self.block.particles_configured) = (allowed, configured);
        self.set_degraded(now_ns, Degraded::FEWER_PARTICLES, allowed < configured);
    }

    /// Records the answer to a control command; told at once.
    pub fn answer_control(&mut self, epoch: u64, seq: u64, done: bool) {
        self.block.control_epoch = epoch;
        self.block.control_seq = seq;
        self.block.control_result = if done { 1 } else { 2 };
        self.changed = true;
    }

    /// Records an event; told at once.
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

    /// Tells misses: at once, but summed up when they come in a flood.
    pub fn miss(&mut self, now_ns: u64, count: u64) {
        self.untold_misses += count;
        if self.untold_misses > 0 && now_ns >= self.next_miss_event_ns {
            self.event(now_ns, EventKind::Miss, 0, 0.0, self.untold_misses);
            self.untold_misses = 0;
            self.next_miss_event_ns = now_ns + MISS_EVENT_INTERVAL_NS;
        }
    }

    /// Notes what the account of the input says; tells what was refused, summed up, and a
    /// quarantine at once.
    pub fn set_input(&mut self, now_ns: u64, account: &InputAccount) {
        let health = &mut self.block;
        (health.lost, health.duplicate) = (account.lost, account.duplicate);
        (health.invalid, health.rejected) = (account.invalid, account.rejected);
        self.set_degraded(now_ns, Degraded::QUARANTINE, account.is_quarantined());
        if account.rejected == self.rejected_told || now_ns < self.next_rejected_event_ns {
            return;
        }
        for rejection in Rejection::ALL {
            let i = rejection as usize;
            let count = account.rejected[i] - self.rejected_told[i];
            if count > 0 {
                self.event(now_ns, EventKind::Rejected, rejection as u32, 0.0, count);
            }
        }
        self.rejected_told = account.rejected;
        self.next_rejected_event_ns = now_ns + REJECTED_EVENT_INTERVAL_NS;
    }

    /// Adds what the account of a further input says.
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
}

/// Reads the events of `health` that are new since event number `seen`; updates `seen`. Returns
/// how many were overwritten before they could be read.
pub fn new_events(health: &Health, seen: &mut u64, mut take: impl FnMut(&Event)) -> u64 {
    let oldest = health.event_count.saturating_sub(EVENTS as u64);
    let overwritten = oldest.saturating_sub(*seen);
    for n in (*seen).max(oldest)..health.event_count {
        take(&health.events[(n % EVENTS as u64) as usize]);
    }
    *seen = health.event_count;
    overwritten
}

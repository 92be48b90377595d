//! Finds services that live and do not do their work, by the Health that they publish.
//!
//! The three kinds of AUTOSAR's watchdog manager (specification of Watchdog Manager, R4): *alive*,
//! does it report as often as it should; *deadline*, does it keep its times; *logical*, does its
//! output follow its input. A process that has died is the launcher's to see; this finds the ones
//! that hang, are stopped, or go on repeating themselves.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use strum::FromRepr;
use vigil_blocks::{Degraded, Health, ServiceState};

/// Window in which missed deadlines are counted, ns.
const WINDOW_NS: u64 = 1_000_000_000;

/// What the watchdog finds wrong with a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum WatchdogFinding {
    /// It did not begin to report in time.
    StartUp = 1,
    /// It has stopped reporting.
    Alive = 2,
    /// It misses too many deadlines.
    Deadline = 3,
    /// It reports, its input moves on, and its output does not.
    Logical = 4,
}

impl WatchdogFinding {
    /// True if only a new process can mend it. Missed deadlines are no such case: a restart would
    /// cost more of them.
    #[must_use]
    pub const fn needs_restart(self) -> bool {
        !matches!(self, Self::Deadline)
    }
}

/// When a service that lives counts as failed. It is then ended and restarted, within the bounds of
/// `[restart]`.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Time that all services may take until the first action comes back, and a restarted one until
    /// it cycles.
    #[default(20.0)]
    #[schemars(range(min = 0.1, max = 600.0))]
    pub startup_s: f64,
    /// Longest silence of a service that cycles; a healthy one reports 20 times a second.
    #[default(2.0)]
    #[schemars(range(min = 0.3, max = 60.0), extend("x-off" = 0))]
    pub alive_s: f64,
    /// Longest time for which a service may publish without following its input, while that moves
    /// on.
    #[default(2.0)]
    #[schemars(range(min = 0.2, max = 60.0), extend("x-off" = 0))]
    pub logical_s: f64,
    /// Share of the deadlines of one second whose miss is reported as failed. Nothing is restarted
    /// for it, as that would cost more deadlines.
    #[default(50.0)]
    #[schemars(range(min = 1.0, max = 100.0), extend("x-off" = 0))]
    pub deadline_percent: f64,
}

/// The settings in the units of Health; 0 for no limit.
#[derive(Debug, Clone, Copy)]
struct WatchdogLimits {
    start_up_ns: u64,
    alive_ns: u64,
    logical_ns: u64,
    missed_share: f64,
}

impl WatchdogLimits {
    fn new(settings: &Settings) -> Self {
        let ns = |s: f64| (s * 1e9).round() as u64;
        Self {
            start_up_ns: ns(settings.startup_s),
            alive_ns: ns(settings.alive_s),
            logical_ns: ns(settings.logical_s),
            missed_share: settings.deadline_percent * 1e-2,
        }
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Peer {
    started_ns: u64,
    /// Writer of the reports before the last start: those of a process that is gone.
    old_epoch: u64,
    epoch: u64,
    /// Sequence number of its last report.
    seq: u64,
    reported_ns: u64,
    is_stopping: bool,
    answered: (u64, u64),
    /// For how long the stage before has moved on and this one has not, ns.
    behind_ns: Option<u64>,
    /// When the stage before moved on last, ns, and how long after the time before.
    input_moved_ns: u64,
    input_interval_ns: u64,
    window_ns: u64,
    window_missed: u64,
    missed: u64,
    period_ns: u64,
    /// It was without input at some time in this window.
    was_without_input: bool,
    has_missed_too_many: bool,
    /// Dead, or found failed: not examined until it is started anew.
    is_gone: bool,
}

/// Longest time between two looks, ns. After a longer one the whole machine may have stood still:
/// no service is blamed for the time between. 50 polls of the launcher.
const LOOK_NS_MAX: u64 = 200_000_000;

/// Watches the services of one graph, given in the order of the data.
#[derive(Debug, Clone)]
pub struct Watchdog {
    limits: WatchdogLimits,
    services: Vec<Peer>,
    looked_ns: u64,
    /// The last look came later than [`LOOK_NS_MAX`] after the one before: it finds nobody failed.
    looked_too_late: bool,
}

impl Watchdog {
    /// A watchdog over `count` services that start at `now_ns`.
    #[must_use]
    pub fn new(settings: &Settings, count: usize, now_ns: u64) -> Self {
        let watched = Peer {
            started_ns: now_ns,
            ..Peer::default()
        };
        Self {
            limits: WatchdogLimits::new(settings),
            services: vec![watched; count],
            looked_ns: now_ns,
            looked_too_late: false,
        }
    }

    /// Begins a look at the services. If the last is too long ago, that time does not count, and
    /// this look finds no failure.
    pub fn look(&mut self, now_ns: u64) {
        assert!(
            now_ns >= self.looked_ns,
            "the watchdog's time never goes back: {now_ns} after {} ns",
            self.looked_ns
        );
        let since_ns = now_ns - self.looked_ns;
        self.looked_ns = now_ns;
        self.looked_too_late = since_ns > LOOK_NS_MAX;
        if self.looked_too_late {
            for watched in &mut self.services {
                watched.started_ns += since_ns;
                watched.reported_ns += since_ns;
                watched.input_moved_ns += since_ns;
                (watched.window_ns, watched.window_missed) = (now_ns, watched.missed);
                watched.behind_ns = None;
            }
        }
    }

    /// The process of a service has died; it will be started anew.
    pub fn ended(&mut self, service: usize) {
        if let Some(watched) = self.services.get_mut(service) {
            watched.is_gone = true;
        }
    }

    /// The process of a service has been started anew.
    pub fn started(&mut self, service: usize, now_ns: u64) {
        if let Some(watched) = self.services.get_mut(service) {
            *watched = Peer {
                started_ns: now_ns,
                // One that never reported has left nothing about.
                old_epoch: if watched.epoch == 0 {
                    watched.old_epoch
                } else {
                    watched.epoch
                },
                ..Peer::default()
            };
        }
    }

    /// Takes a report of a service, read at `now_ns`; one read before is ignored.
    pub fn take(&mut self, service: usize, health: &Health, now_ns: u64) {
        let Some(watched) = self.services.get_mut(service) else {
            return;
        };
        if health.header.epoch == watched.old_epoch {
            return;
        }
        let answered = (health.answered_epoch, health.answered_seq);
        let is_first = watched.epoch != health.header.epoch;
        if !is_first && health.header.seq == watched.seq {
            return;
        }
        watched.seq = health.header.seq;
        if is_first {
            watched.epoch = health.header.epoch;
            (watched.window_ns, watched.window_missed) = (now_ns, health.missed);
        }
        watched.reported_ns = now_ns;
        watched.is_stopping = health.state == ServiceState::Stopping as u32;
        watched.was_without_input |= health.degraded & Degraded::INPUT_LOST != 0;
        (watched.missed, watched.period_ns) = (health.missed, health.period_ns);
        let has_moved = !is_first && answered != watched.answered;
        watched.answered = answered;
        if is_first || has_moved {
            watched.behind_ns = None;
        }
        let most_ns = self.limits.logical_ns / 2;
        if let (true, Some(next)) = (has_moved, self.services.get_mut(service + 1)) {
            next.input_moved(now_ns, most_ns);
        }
    }

    /// A service that has failed, and how; each failure is returned once.
    pub fn failed(&mut self, now_ns: u64) -> Option<(usize, WatchdogFinding)> {
        if self.looked_too_late {
            return None;
        }
        let limits = self.limits;
        let mut services = self.services.iter_mut().enumerate();
        services.find_map(|(service, watched)| {
            let found = watched.examine(&limits, now_ns)?;
            watched.is_gone |= found.needs_restart();
            Some((service, found))
        })
    }
}

impl Peer {
    /// The stage before has moved on. Services report at instants of their own, so that this one
    /// may have told of the same frame before: only further moves say that it is behind, and a
    /// pause between two of them, much longer than the one before, says little. No move alone makes
    /// a failure: `most_ns` is the most that it counts for.
    fn input_moved(&mut self, now_ns: u64, most_ns: u64) {
        let since_ns = now_ns.saturating_sub(self.input_moved_ns);
        let is_pause = since_ns > LOOK_NS_MAX.max(self.input_interval_ns.saturating_mul(2));
        let most_ns = if is_pause {
            most_ns.min(LOOK_NS_MAX)
        } else {
            most_ns
        };
        // It goes on reporting all the while: silence is another failure.
        let has_reported = self.reported_ns >= self.input_moved_ns;
        let more_ns = if has_reported {
            since_ns.min(most_ns)
        } else {
            0
        };
        self.behind_ns = Some(self.behind_ns.map_or(0, |behind_ns| behind_ns + more_ns));
        (self.input_moved_ns, self.input_interval_ns) = (now_ns, since_ns);
    }

    fn examine(&mut self, limits: &WatchdogLimits, now_ns: u64) -> Option<WatchdogFinding> {
        assert!(
            self.started_ns <= now_ns && self.reported_ns <= now_ns,
            "a service has started and reported in the past: {} and {}, now {now_ns} ns",
            self.started_ns,
            self.reported_ns
        );
        if self.is_gone || self.is_stopping {
            return None;
        }
        let since = |then_ns: u64| now_ns - then_ns;
        if self.epoch == 0 {
            let is_late = since(self.started_ns) > limits.start_up_ns;
            return is_late.then_some(WatchdogFinding::StartUp);
        }
        if limits.alive_ns > 0 && since(self.reported_ns) > limits.alive_ns {
            return Some(WatchdogFinding::Alive);
        }
        if limits.logical_ns > 0 && self.behind_ns.unwrap_or(0) > limits.logical_ns {
            return Some(WatchdogFinding::Logical);
        }
        let misses = limits.missed_share > 0.0 && self.misses(limits.missed_share, now_ns);
        misses.then_some(WatchdogFinding::Deadline)
    }

    /// True once for each time that a window has too many misses after one that had not.
    fn misses(&mut self, share: f64, now_ns: u64) -> bool {
        let window_ns = now_ns.saturating_sub(self.window_ns);
        if window_ns < WINDOW_NS {
            return false;
        }
        let instants = window_ns as f64 / self.period_ns.max(1) as f64;
        let missed = self.missed.saturating_sub(self.window_missed) as f64;
        (self.window_ns, self.window_missed) = (now_ns, self.missed);
        let before = self.has_missed_too_many;
        // Without input it can be in time for nothing.
        let had_input = !std::mem::take(&mut self.was_without_input);
        self.has_missed_too_many = had_input && missed >= share * instants;
        self.has_missed_too_many && !before
    }
}

#[cfg(test)]
mod tests;

//! A thread that does nothing but be on time, to see when the machine is not.
//!
//! It sleeps to an absolute schedule above the priority of what it watches over, like cyclictest:
//! how late it wakes is the machine's doing alone. A stall of a core shorter than its period can
//! fall between two wake-ups.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use vigil_cycle::Latency;
use vigil_cycle::PortError;
use vigil_cycle::clock::{self, Clock, Monotonic};
use vigil_cycle::placement::{self, Placement, PlacementRequest};

/// Lateness from which a wake-up is kept one by one, ns.
pub const KEPT_FROM_NS: u64 = 5_000;

/// A late wake-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LateWakeUp {
    /// When it was due, ns.
    pub t_schedule_ns: u64,
    /// How late it came, ns.
    pub late_ns: u64,
}

/// What a canary recorded.
#[derive(Debug)]
pub struct CanaryRecord {
    /// Where it ran, as the kernel says.
    pub placement: Placement,
    /// Lateness of every instant of its schedule, ns; those that it slept through too.
    pub lateness: Latency,
    /// Wake-ups late by [`KEPT_FROM_NS`] or more, in order.
    pub late: Vec<LateWakeUp>,
    /// Late wake-ups for which there was no room.
    pub not_kept: u64,
}

/// A running canary.
#[derive(Debug)]
pub struct Canary {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<CanaryRecord>>,
}

impl Canary {
    /// Starts a canary with one wake-up each `period_ns`, with room for `capacity` late ones.
    ///
    /// # Errors
    /// [`PortError::Setup`] if the thread or its histogram cannot be made.
    pub fn start(
        wanted: PlacementRequest,
        period_ns: u64,
        capacity: usize,
    ) -> Result<Self, PortError> {
        let stop = Arc::new(AtomicBool::new(false));
        let lateness = Latency::new().map_err(|e| PortError::setup("histogram", e))?;
        let asked = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name(format!("canary-{}", wanted.core))
            .spawn(move || watch(wanted, period_ns.max(1), capacity, lateness, &asked))
            .map_err(|e| PortError::setup("canary", e))?;
        Ok(Self {
            stop,
            thread: Some(thread),
        })
    }

    /// Ends it; its record; `None` if it has died.
    #[must_use]
    pub fn finish(mut self) -> Option<CanaryRecord> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take()?.join().ok()
    }
}

impl Drop for Canary {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn watch(
    wanted: PlacementRequest,
    period_ns: u64,
    capacity: usize,
    lateness: Latency,
    stop: &AtomicBool,
) -> CanaryRecord {
    let placement = placement::apply(wanted);
    let mut account = Account::new(
        CanaryRecord {
            placement,
            lateness,
            late: touched(capacity),
            not_kept: 0,
        },
        Monotonic.now_ns() + period_ns,
        period_ns,
    );
    while !stop.load(Ordering::Relaxed) {
        clock::sleep_until(account.due_ns);
        account.wake(Monotonic.now_ns());
    }
    account.record.late.shrink_to_fit();
    account.record
}

/// An empty list with room for `capacity` wake-ups, every page of it touched.
fn touched(capacity: usize) -> Vec<LateWakeUp> {
    let touched = LateWakeUp {
        t_schedule_ns: u64::MAX,
        late_ns: 0,
    };
    let mut late = vec![touched; capacity];
    late.clear();
    late
}

/// The book of a canary: what each wake-up says.
#[derive(Debug)]
struct Account {
    record: CanaryRecord,
    room: usize,
    due_ns: u64,
    period_ns: u64,
}

impl Account {
    /// First due at `due_ns`; room for as many late wake-ups as the list of `record` has now.
    const fn new(record: CanaryRecord, due_ns: u64, period_ns: u64) -> Self {
        Self {
            room: record.late.capacity(),
            record,
            due_ns,
            period_ns,
        }
    }

    /// Awake at `now_ns`: every instant up to then was due, those that were slept through too. One
    /// late wake-up is kept for all of them, from the first: its lateness covers the others.
    fn wake(&mut self, now_ns: u64) {
        let Some(late_ns) = now_ns.checked_sub(self.due_ns) else {
            return; // A signal: nothing was due.
        };
        if late_ns >= KEPT_FROM_NS {
            if self.record.late.len() < self.room {
                self.record.late.push(LateWakeUp {
                    t_schedule_ns: self.due_ns,
                    late_ns,
                });
            } else {
                self.record.not_kept += 1;
            }
        }
        while self.due_ns <= now_ns {
            self.record.lateness.record(now_ns - self.due_ns);
            self.due_ns += self.period_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wake_up_accounts_for_every_instant_that_it_slept_through() {
        let record = CanaryRecord {
            placement: placement::read_back(0),
            lateness: Latency::new().unwrap(),
            late: Vec::with_capacity(2),
            not_kept: 0,
        };
        let mut account = Account::new(record, 100_000, 100_000);
        for now_ns in [
            100_100, // 100 ns late: usual
            150_000, // a signal
            500_000, // 200_000, 300_000, 400_000 and 500_000 itself
            600_000, // on time
            704_999, // a nanosecond short of being kept
            805_000, 906_000, // kept; no room
        ] {
            account.wake(now_ns);
        }
        let Account { record, due_ns, .. } = account;
        assert_eq!(due_ns, 1_000_000);
        let late = |t_schedule_ns, late_ns| LateWakeUp {
            t_schedule_ns,
            late_ns,
        };
        assert_eq!(record.late, [late(200_000, 300_000), late(800_000, 5_000)]);
        assert_eq!(record.not_kept, 1);
        let mut all = Latency::new().unwrap();
        for late_ns in [100, 300_000, 200_000, 100_000, 0, 0, 4_999, 5_000, 6_000] {
            all.record(late_ns);
        }
        assert_eq!(record.lateness.histogram(), all.histogram());
    }

    #[test]
    fn every_instant_of_its_schedule_is_accounted() {
        let wanted = PlacementRequest {
            core: 0,
            priority: 1,
        };
        let period_ns = 1_000_000;
        let from_ns = Monotonic.now_ns();
        let canary = Canary::start(wanted, period_ns, 64).unwrap();
        clock::sleep_until(from_ns + 50 * period_ns);
        let record = canary.finish().unwrap();
        let lasted_ns = Monotonic.now_ns() - from_ns;
        let instants = record.lateness.percentiles().n;
        assert!(instants * period_ns <= lasted_ns, "{instants} instants");
        assert!(instants > 0);
        let order = record.late.is_sorted_by_key(|late| late.t_schedule_ns);
        assert!(order && record.late.iter().all(|l| l.late_ns >= KEPT_FROM_NS));
    }
}

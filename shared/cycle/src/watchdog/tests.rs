use super::*;

const MS: u64 = 1_000_000;
const SETTINGS: Settings = Settings {
    startup_s: 3.0,
    alive_s: 0.5,
    logical_s: 0.4,
    deadline_percent: 50.0,
};

/// A graph of three services that report every 50 ms and answer one frame in that time.
struct Services {
    watchdog: Watchdog,
    now_ns: u64,
    health: [Health; 3],
    /// In which order their reports are read.
    order: [usize; 3],
}

impl Services {
    fn new() -> Self {
        let mut health = [Health::default(); 3];
        for (epoch, health) in (1..).zip(&mut health) {
            health.header.epoch = epoch;
            health.period_ns = 10 * MS;
            health.state = ServiceState::Running as u32;
        }
        Self {
            watchdog: Watchdog::new(&SETTINGS, 3, 0),
            now_ns: 0,
            health,
            order: [0, 1, 2],
        }
    }

    /// Runs for `ms`; `change` says what happens to each report, None for none.
    fn run(
        &mut self,
        ms: u64,
        mut change: impl FnMut(usize, &mut Health) -> bool,
    ) -> Vec<(u64, usize, WatchdogFinding)> {
        let mut found = Vec::new();
        for _ in 0..ms / 50 {
            self.now_ns += 50 * MS;
            for service in self.order {
                let health = &mut self.health[service];
                health.header.seq += 1;
                health.answered_seq += 5;
                if change(service, health) {
                    self.watchdog.take(service, health, self.now_ns);
                }
            }
            self.watchdog.look(self.now_ns);
            while let Some((service, what)) = self.watchdog.failed(self.now_ns) {
                found.push((self.now_ns / MS, service, what));
            }
        }
        found
    }
}

#[test]
fn healthy_services_never_fail() {
    let mut services = Services::new();
    assert_eq!(services.run(60_000, |_, _| true), []);
}

#[test]
fn silence_is_found_within_its_limit_and_told_once_until_the_next_start() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    let found = services.run(3000, |service, _| service != 1);
    assert_eq!(found, [(1550, 1, WatchdogFinding::Alive)]);
    services.watchdog.started(1, services.now_ns);
    // Old reports that are still about do not count for the new process.
    let found = services.run(3050, |_, _| true);
    assert_eq!(found, [(7050, 1, WatchdogFinding::StartUp)]);
    // Nor after another one that never reported.
    services.watchdog.started(1, services.now_ns);
    let found = services.run(3050, |_, _| true);
    assert_eq!(found, [(10_100, 1, WatchdogFinding::StartUp)]);
    services.watchdog.started(1, services.now_ns);
    services.health[1].header.epoch = 77;
    assert_eq!(services.run(3050, |_, _| true), []);
}

#[test]
fn an_output_that_stands_still_while_its_input_moves_is_found_and_only_there() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    let stuck = services.health[1].answered_seq;
    // The third follows the second, which stands still: it is not to blame.
    let found = services.run(2000, |service, health| {
        if service > 0 {
            health.answered_seq = stuck;
        }
        true
    });
    assert_eq!(found.len(), 1, "{found:?}");
    let (at_ms, service, what) = found[0];
    assert_eq!((service, what), (1, WatchdogFinding::Logical));
    assert!((1400..=1550).contains(&at_ms), "{at_ms}");
}

#[test]
fn too_many_misses_are_told_when_they_begin_and_restart_nothing() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    let misses = |services: &mut Services, ms, each: u64| {
        services.run(ms, |service, health| {
            health.missed += if service == 2 { each } else { 0 };
            true
        })
    };
    // Two of five deadlines in 50 ms, then three of five.
    assert_eq!(misses(&mut services, 5000, 2), []);
    let found = misses(&mut services, 5000, 3);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].1, found[0].2), (2, WatchdogFinding::Deadline));
    assert!(!found[0].2.needs_restart());
    assert_eq!(misses(&mut services, 3000, 0), []);
    assert_eq!(misses(&mut services, 3000, 5).len(), 1, "a second time");
}

#[test]
fn misses_while_there_is_no_input_are_not_held_against_a_service() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    // Gone for .85 s of every second, and back each time before the window ends.
    let mut reports = 0;
    let found = services.run(5000, |service, health| {
        if service == 2 {
            let is_gone = reports % 20 < 17;
            reports += 1;
            health.missed += if is_gone { 5 } else { 0 };
            health.degraded = if is_gone { Degraded::INPUT_LOST } else { 0 };
        }
        true
    });
    assert_eq!(found, []);
}

#[test]
fn an_outage_of_one_service_is_not_held_against_those_behind_it() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    // The second is silent, and those behind it have nothing to answer.
    let rest = services.health[2].answered_seq;
    let mut still = |service: usize, health: &mut Health| {
        if service == 2 {
            health.answered_seq = rest;
        }
        service != 1
    };
    let found = services.run(3000, &mut still);
    assert_eq!(found, [(1550, 1, WatchdogFinding::Alive)]);
    services.watchdog.started(1, services.now_ns);
    assert_eq!(services.run(1000, &mut still), []);
    // It comes back and answers at once; the one behind it does so a report later.
    services.health[1].header.epoch = 78;
    let mut first = true;
    let found = services.run(5000, |service, health| {
        if service == 2 && std::mem::take(&mut first) {
            health.answered_seq = rest;
        }
        true
    });
    assert_eq!(found, []);
}

#[test]
fn a_source_at_rest_is_nobodys_failure_nor_is_its_going_on() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    let rest = services.health[0].answered_seq;
    let found = services.run(5000, |_, health| {
        health.answered_seq = rest;
        true
    });
    assert_eq!(found, []);
    assert_eq!(services.run(5000, |_, _| true), []);
}

#[test]
fn in_whatever_order_reports_come_the_last_frame_is_nobodys_failure() {
    let orders = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    for order in orders {
        let mut services = Services::new();
        services.order = order;
        services.run(1000, |_, _| true);
        // Of the last frames some reports are late, too: a service tells of five frames fewer.
        for late in 0..8_u32 {
            let last = services.health[0].answered_seq + 5;
            let mut is_last = true;
            let found = services.run(2000, |service, health| {
                let is_late = is_last && late & (1 << service) != 0;
                health.answered_seq = if is_late { last - 5 } else { last };
                is_last &= service != order[2];
                true
            });
            assert_eq!(found, [], "order {order:?}, late {late:03b}");
            assert_eq!(services.run(500, |_, _| true), []);
        }
        // One that does not follow is found in every order.
        let stuck = services.health[1].answered_seq;
        let found = services.run(1000, |service, health| {
            health.answered_seq = if service == 0 {
                health.answered_seq
            } else {
                stuck
            };
            true
        });
        let all: Vec<_> = found.iter().map(|&(_, who, what)| (who, what)).collect();
        assert_eq!(all, [(1, WatchdogFinding::Logical)], "order {order:?}");
    }
}

#[test]
fn of_a_slow_source_too_a_pause_is_nobodys_failure_and_a_service_that_stands_still_is_found() {
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
        let mut services = Services::new();
        services.order = order;
        // A frame a second, and the number of those before a pause.
        let (mut source, mut left) = (0, 20);
        let mut stuck = None;
        let mut of_second = |services: &mut Services, stuck: Option<u64>| {
            left -= 1;
            source += u64::from(!(-5..=0).contains(&left));
            services.run(1000, |service, health| {
                health.answered_seq = match stuck {
                    Some(seq) if service == 1 => seq,
                    _ => source,
                };
                true
            })
        };
        for _ in 0..40 {
            assert_eq!(of_second(&mut services, stuck), [], "{order:?}");
        }
        stuck = Some(services.health[1].answered_seq);
        let found: Vec<_> = (0..6)
            .flat_map(|_| of_second(&mut services, stuck))
            .map(|(_, service, what)| (service, what))
            .collect();
        assert_eq!(found, [(1, WatchdogFinding::Logical)], "{order:?}");
    }
}

#[test]
fn a_report_that_is_read_after_that_of_a_slow_source_is_nobodys_failure() {
    let mut services = Services::new();
    // What a service tells of is read before its source, then one look after it.
    services.order = [2, 1, 0];
    for seq in 1..=20 {
        for look in 0..60 {
            let is_late = seq % 2 == 0 && look == 0;
            let found = services.run(50, |service, health| {
                health.answered_seq = if service == 1 && is_late {
                    seq - 1
                } else {
                    seq
                };
                true
            });
            assert_eq!(found, [], "frame {seq}");
        }
    }
}

#[test]
fn time_in_which_nobody_looked_is_held_against_nobody() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    services.now_ns += 5000 * MS;
    // Only the first has reported when the look comes.
    let found = services.run(50, |service, _| service == 0);
    assert_eq!(found, []);
    assert_eq!(services.run(400, |service, _| service == 0), []);
    let found = services.run(200, |service, _| service == 0);
    assert_eq!(found.len(), 2, "{found:?}");
}

#[test]
fn a_dead_service_is_not_called_silent_and_one_without_input_not_late() {
    let mut services = Services::new();
    services.run(1000, |_, _| true);
    services.watchdog.ended(1);
    let found = services.run(5000, |service, health| {
        if service == 2 {
            health.degraded = Degraded::INPUT_LOST;
            health.missed += 5;
        }
        service != 1
    });
    assert_eq!(found, []);
}

#[test]
#[should_panic(expected = "the watchdog's time never goes back")]
fn a_look_from_the_past_is_found() {
    let mut watchdog = Watchdog::new(&SETTINGS, 1, 5 * MS);
    watchdog.look(4 * MS);
}

#[test]
#[should_panic(expected = "a service has started and reported in the past")]
fn a_report_from_the_future_is_found() {
    let mut watchdog = Watchdog::new(&SETTINGS, 1, 0);
    watchdog.services[0].reported_ns = 2 * MS;
    watchdog.failed(MS);
}

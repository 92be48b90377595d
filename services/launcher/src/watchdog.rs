//! Services that live and do not do their work: found, put into the timeline, ended, so that they
//! restart.

use vigil_blocks::{Event, EventKind};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::watchdog::Settings;
use vigil_cycle::{Clock, Monotonic, Watchdog};
use vigil_timeline::watchdog_text;

use crate::children::Children;
use crate::observer::HealthObserver;

/// Feeds the watchdog with what the services report, and acts on what it finds.
pub struct WatchdogDriver {
    watchdog: Watchdog,
    services: Vec<ServiceName>,
}

impl WatchdogDriver {
    /// Watches these services, which start now.
    pub fn new(settings: &Settings, services: Vec<ServiceName>) -> Self {
        Self {
            watchdog: Watchdog::new(settings, services.len(), Monotonic.now_ns()),
            services,
        }
    }

    /// Takes what is new, and ends the services that only a new process can mend.
    pub fn look_after(&mut self, observer: &mut HealthObserver, children: &mut Children) {
        let now_ns = Monotonic.now_ns();
        self.watchdog.look(now_ns);
        let position = |name| self.services.iter().position(|s| *s == name);
        for service in children.dead().filter_map(position) {
            self.watchdog.ended(service);
        }
        for service in children.take_restarted().into_iter().filter_map(position) {
            self.watchdog.started(service, now_ns);
        }
        for watched in observer.watched() {
            if let (Some(service), Some(health)) = (position(watched.name), &watched.latest) {
                self.watchdog.take(service, health, now_ns);
            }
        }
        while let Some((service, finding)) = self.watchdog.failed(now_ns) {
            let name = self.services[service];
            observer.timeline.add(
                name,
                &Event {
                    t_ns: now_ns,
                    kind: EventKind::Watchdog as u32,
                    what: finding as u32,
                    ..Event::default()
                },
            );
            if finding.needs_restart() {
                children.end(name, watchdog_text(finding));
            }
        }
    }
}

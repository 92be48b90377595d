//! Services that live and have failed all the same: found, told, ended, so that they restart.

use vigil_blocks::{Event, EventKind};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Monotonic, Watchdog};

use crate::children::Children;
use crate::observer::Observer;
use crate::plan::Plan;
use crate::words;

/// Holds the watchdog against what the services report.
pub struct Supervisor {
    watchdog: Watchdog,
    services: Vec<ServiceName>,
}

impl Supervisor {
    /// Watches over the services of the plan, which start now.
    pub fn new(plan: &Plan) -> Self {
        let services: Vec<ServiceName> = plan.services().collect();
        Self {
            watchdog: Watchdog::new(
                &plan.setup.file.watchdog,
                services.len(),
                Monotonic.now_ns(),
            ),
            services,
        }
    }

    /// Takes what is new, and ends the services that only a new process can mend.
    pub fn look_after(&mut self, observer: &mut Observer, children: &mut Children) {
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
        while let Some((service, supervision)) = self.watchdog.failed(now_ns) {
            let name = self.services[service];
            observer.add_event(
                name,
                &Event {
                    t_ns: now_ns,
                    kind: EventKind::Watchdog as u32,
                    what: supervision as u32,
                    ..Event::default()
                },
            );
            if supervision.needs_restart() {
                children.end(name, words::failure(supervision));
            }
        }
    }
}

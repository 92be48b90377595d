//! What services say about themselves.

use vigil_blocks::{Degraded, Health};
use vigil_cycle::topic::ServiceName;
use vigil_setup::Setup;
use vigil_timeline::{degraded_text, service_state_text};

use crate::message_times::MessageTimes;
use crate::messages::diagnostics::{Diagnostics, Level, Status};
use crate::messages::header::Header;
use crate::pace::Pace;
use crate::sink::Sink;
use crate::topics;

/// Shortest time between two messages of a service that say the same, ns.
const REPEAT_NS: u64 = 500_000_000;

/// How often each service is written.
pub(crate) struct HealthTranslation {
    graph: String,
    paces: [Pace; ServiceName::ALL.len()],
}

/// Numbers of a service; times in µs.
fn values(health: &Health) -> Vec<(&'static str, String)> {
    let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
    let is_pinned = if health.pinned == 1 { "yes" } else { "no" };
    vec![
        ("cycles", health.cycles.to_string()),
        ("missed", health.missed.to_string()),
        ("over budget", health.over_budget.to_string()),
        ("slips", health.slips.to_string()),
        ("lost", health.lost.to_string()),
        ("late", health.late.to_string()),
        ("duplicate", health.duplicate.to_string()),
        ("invalid", health.invalid.to_string()),
        ("worst cycle us", us(health.worst_cycle_ns)),
        ("last cycle us", us(health.last_cycle_ns)),
        ("period us", us(health.period_ns)),
        ("deadline us", us(health.deadline_ns)),
        ("budget us", us(health.budget_ns)),
        ("particles", health.particles.to_string()),
        ("core", health.core.to_string()),
        ("pinned", is_pinned.to_owned()),
        ("pid", health.pid.to_string()),
    ]
}

/// Services have a part of the names of their own: a fault may have the name of a service.
fn name(service: ServiceName) -> String {
    format!("health/{}", service.as_str())
}

fn status(service: ServiceName, health: &Health) -> Status {
    let level = match health.degraded {
        0 => Level::Ok,
        bits if bits & (Degraded::INPUT_LOST | Degraded::QUARANTINE) != 0 => Level::Error,
        _ => Level::Warn,
    };
    let state = service_state_text(health.state);
    Status {
        level,
        name: name(service),
        message: match health.degraded {
            0 => state.to_owned(),
            bits => format!("{state}, degraded: {}", degraded_text(bits)),
        },
        values: values(health),
    }
}

impl HealthTranslation {
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            graph: setup.file.graph.name.clone(),
            paces: std::array::from_fn(|_| Pace::every_ns(REPEAT_NS)),
        }
    }

    /// Writes what a service says. It is at most two messages a second, and one whenever the state
    /// or the degraded mode is another.
    pub(crate) fn write<S: Sink>(
        &mut self,
        service: ServiceName,
        health: &Health,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        let mark = u64::from(health.state) << 32 | u64::from(health.degraded);
        if !self.paces[service.index()].is_due(times.log_ns, mark) {
            return Ok(());
        }
        self.send(status(service, health), times, sink)
    }

    /// Writes that nothing is known of a service any more.
    pub(crate) fn write_stale<S: Sink>(
        &self,
        service: ServiceName,
        why: &str,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        self.send(Status::stale(&name(service), why), times, sink)
    }

    fn send<S: Sink>(
        &self,
        status: Status,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        let diagnostics = Diagnostics {
            header: Header::at(times.capture_ns),
            graph: &self.graph,
            statuses: &[status],
        };
        sink.write(&topics::HEALTH, times, &diagnostics)
    }
}

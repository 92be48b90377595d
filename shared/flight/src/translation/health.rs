//! What services say about themselves.

use vigil_blocks::{Degraded, Health};
use vigil_cycle::topic::ServiceName;
use vigil_setup::Setup;
use vigil_timeline::{degraded_text, service_state_text};

use crate::container::Container;
use crate::error::FlightError;
use crate::message_times::MessageTimes;
use crate::messages::diagnostics::{Diagnostics, Level, Status};
use crate::messages::header::Header;
use crate::pace::Pace;

/// Shortest time between two messages of a service that say the same, ns.
const REPEAT_NS: u64 = 500_000_000;

/// How often each service is written.
pub(crate) struct HealthTranslation {
    robot: String,
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

fn status(service: ServiceName, health: &Health) -> Status {
    let level = match health.degraded {
        0 => Level::Ok,
        bits if bits & (Degraded::INPUT_LOST | Degraded::QUARANTINE) != 0 => Level::Error,
        _ => Level::Warn,
    };
    let state = service_state_text(health.state);
    Status {
        level,
        name: service.as_str().to_owned(),
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
            robot: setup.robot.name.clone(),
            paces: std::array::from_fn(|_| Pace::every_ns(REPEAT_NS)),
        }
    }

    /// Writes what a service says. It is at most two messages a second, and one whenever the state
    /// or the degraded mode is another.
    pub(crate) fn write(
        &mut self,
        service: ServiceName,
        health: &Health,
        times: MessageTimes,
        file: &mut Container,
    ) -> Result<(), FlightError> {
        let mark = u64::from(health.state) << 32 | u64::from(health.degraded);
        if !self.paces[service.index()].is_due(times.log_ns, mark) {
            return Ok(());
        }
        let diagnostics = Diagnostics {
            header: Header::at(times.capture_ns),
            hardware: &self.robot,
            statuses: &[status(service, health)],
        };
        file.write("/vigil/health", times, &diagnostics)
    }
}

//! From the configuration to what the cycle needs.

use std::time::Duration;

use vigil_cycle::placement::PlacementRequest;
use vigil_cycle::serve::{Leave, ServicePlan};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, PortError, Schedule, service};

use crate::border::Border;
use crate::load::Setup;

/// Longest pause of an observer: what the black box loses when it is killed.
const OBSERVER_PAUSE_MAX: Duration = Duration::from_millis(50);

impl Setup {
    /// Period of the schedule, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        self.file.graph.period_ns()
    }

    /// Between two looks of who observes every topic: half the time in which the shortest queue
    /// fills, and 50 ms at most.
    #[must_use]
    pub fn observer_pause(&self) -> Duration {
        let period = Duration::from_secs_f64(1.0 / self.file.graph.rate_hz);
        let buffer = u32::try_from(self.file.transport.buffer).unwrap_or(2);
        (period * buffer / 2).min(OBSERVER_PAUSE_MAX)
    }

    /// What its publishers meet.
    #[must_use]
    pub fn border(&self) -> Border {
        Border {
            file: self.file.clone(),
            path: self.path.clone(),
            robot: self.robot.clone(),
        }
    }

    /// Placement and deadline of a service.
    #[must_use]
    pub const fn service(&self, name: ServiceName) -> &service::Settings {
        let services = &self.file.services;
        match name {
            ServiceName::SensorSim => &services.sensor_sim,
            ServiceName::Detector => &services.detector,
            ServiceName::Identifier => &services.identifier,
            ServiceName::Supervisor => &services.supervisor,
        }
    }

    /// The graph's place on this machine.
    ///
    /// # Errors
    /// [`PortError::Setup`] when no runtime folder can be made.
    pub fn domain(&self) -> Result<Domain, PortError> {
        self.file.domain()
    }

    /// What the process of a service is to be, and what it is to leave behind.
    #[must_use]
    pub fn plan(&self, name: ServiceName, leave: Leave) -> ServicePlan {
        let (service, period_ns) = (self.service(name), self.period_ns());
        let share_ns = |percent: f64| (period_ns as f64 * percent * 1e-2).round() as u64;
        ServicePlan {
            service: name,
            graph: self.file.graph.name.clone(),
            queues: self.file.transport,
            wanted: PlacementRequest {
                core: service.core,
                priority: service.priority,
            },
            schedule: Schedule {
                period_ns,
                deadline_ns: share_ns(service.deadline_percent),
                budget_ns: share_ns(service.budget_percent.min(service.deadline_percent)),
            },
            on_miss: service.on_miss,
            spin_ns: (service.spin_us * 1e3).round() as u64,
            leave,
            allow_injection: self.file.control.allow_injection,
        }
    }
}

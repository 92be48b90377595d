//! From the configuration to what the cycle needs.

use vigil_cycle::domain::Queues;
use vigil_cycle::placement::PlacementRequest;
use vigil_cycle::serve::{Leave, Plan};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, PortError, Schedule};

use crate::load::Setup;
use crate::schema::Service;

impl Setup {
    /// Period of the schedule, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        (1e9 / self.file.graph.rate_hz).round() as u64
    }

    /// Placement and deadline of a service.
    #[must_use]
    pub const fn service(&self, name: ServiceName) -> &Service {
        let services = &self.file.services;
        match name {
            ServiceName::SensorSim => &services.sensor_sim,
            ServiceName::Detector => &services.detector,
            ServiceName::Identifier => &services.identifier,
            ServiceName::Supervisor => &services.supervisor,
        }
    }

    /// Sizes of the graph's queues.
    #[must_use]
    pub const fn queues(&self) -> Queues {
        let transport = &self.file.transport;
        Queues {
            buffer: transport.buffer,
            history: transport.history,
            max_subscribers: transport.max_subscribers,
        }
    }

    /// The graph's place on this machine.
    ///
    /// # Errors
    /// [`PortError::Setup`] when no runtime folder can be made.
    pub fn domain(&self) -> Result<Domain, PortError> {
        Domain::new(&self.file.graph.name, self.queues())
    }

    /// What the process of a service is to be, and what it is to leave behind.
    #[must_use]
    pub fn plan(&self, name: ServiceName, leave: Leave) -> Plan {
        let (service, period_ns) = (self.service(name), self.period_ns());
        let share_ns = |percent: f64| (period_ns as f64 * percent * 1e-2).round() as u64;
        Plan {
            service: name,
            graph: self.file.graph.name.clone(),
            queues: self.queues(),
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
        }
    }
}

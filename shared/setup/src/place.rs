//! From the configuration to what the cycle needs.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::Path;
use std::{fs, io};

use vigil_cycle::placement::PlacementRequest;
use vigil_cycle::serve::{Leave, ServicePlan};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, PortError, Schedule, service};
use vigil_robot::channel::channel_list_text;

use crate::graph_file::Source;
use crate::load::Setup;

impl Setup {
    /// Period of the schedule, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        (1e9 / self.file.graph.rate_hz).round() as u64
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
        Domain::new(&self.file.graph.name, self.file.transport)
    }

    /// Leaves in the runtime folder what publishers ask for: the types, the channels and, where
    /// datagrams are taken, the addresses.
    ///
    /// # Errors
    /// The file system's.
    pub fn tell_publishers(&self, domain: &Domain) -> io::Result<()> {
        domain.tell_types()?;
        fs::write(domain.channels_file(), channel_list_text(&self.robot))?;
        let addresses = self.addresses(domain.folder());
        let lines = addresses.iter().map(|address| format!("{address}\n"));
        fs::write(domain.addresses_file(), lines.collect::<String>())
    }

    /// Where this graph takes datagrams from programs of this machine, if it does: `udp ADDRESS`,
    /// `unix PATH`.
    #[must_use]
    pub fn addresses(&self, folder: &Path) -> Vec<String> {
        let (sensor, mut addresses) = (&self.file.sensor, Vec::new());
        if sensor.source != Source::Socket {
            return addresses;
        }
        if let Ok(Some(mut udp)) = sensor.socket.udp_address() {
            if udp.ip().is_unspecified() {
                udp.set_ip(match udp {
                    SocketAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
                    SocketAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
                });
            }
            addresses.push(format!("udp {udp}"));
        }
        if !sensor.socket.unix.is_empty() {
            let path = folder.join(&sensor.socket.unix);
            addresses.push(format!("unix {}", path.display()));
        }
        addresses
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

//! What publishers of frames meet: the graph and its robot, without the models behind them.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::{fs, io};

use vigil_cycle::{Domain, PortError};
use vigil_robot::Description;
use vigil_robot::channel::channel_list_text;

use crate::graph_file::{GraphFile, Source};

/// The border of a graph. A robot has one before its model is learned.
#[derive(Debug, Clone, PartialEq)]
pub struct Border {
    /// The graph file, options applied.
    pub file: GraphFile,
    /// Where it was read from.
    pub path: PathBuf,
    /// The robot.
    pub robot: Description,
}

impl Border {
    /// Period of the schedule, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        self.file.graph.period_ns()
    }

    /// The graph's place on this machine.
    ///
    /// # Errors
    /// [`PortError::Setup`] when no runtime folder can be made.
    pub fn domain(&self) -> Result<Domain, PortError> {
        self.file.domain()
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
}

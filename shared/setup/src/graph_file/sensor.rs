//! Where sensor frames come from.

use std::fmt;
use std::net::SocketAddr;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_blocks::fnv1a;

/// Where sensor frames come from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sensor {
    /// What publishes the frames.
    pub source: Source,
    /// Frames to play back (CSV or CSV.gz), relative to the graph file; for `playback`.
    pub frames: Option<String>,
    /// Runs to play back: `all`, `heldout` (those that the model was not learned from), or run ids
    /// separated by commas; for `playback`.
    pub runs: Option<String>,
    /// Speed of the playback relative to the recording; 1 unless given.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub speed: Option<f64>,
    /// Where frames arrive as datagrams; for `socket`.
    pub socket: Socket,
}

/// Where frames arrive as datagrams.
#[derive(Debug, Clone, PartialEq, Eq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Socket {
    /// Address and port of a UDP socket; empty for none. The default is for this machine alone;
    /// with another address every machine that reaches it may send frames. `--socket` replaces it;
    /// a graph that `--graph` names has, instead of the default, a port that follows from its name.
    #[default = "127.0.0.1:7401"]
    pub udp: String,
    /// Name of a Unix datagram socket in the graph's runtime folder; empty for none.
    #[default = "sensor.sock"]
    pub unix: String,
}

/// Ports of graphs that are told apart by their names alone: below those that the kernel gives.
const NAMED_PORTS: std::ops::Range<u64> = 20_000..30_000;

impl Socket {
    /// Gives the graph of this name a port of its own, unless the file has chosen one.
    pub(crate) fn rename(&mut self, graph: &str) {
        if self.udp == Self::default().udp {
            let count = NAMED_PORTS.end - NAMED_PORTS.start;
            let port = NAMED_PORTS.start + fnv1a::hash(fnv1a::BASIS, graph.as_bytes()) % count;
            self.udp = format!("127.0.0.1:{port}");
        }
    }

    /// The address of the UDP socket; `None` for none.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn udp_address(&self) -> Result<Option<SocketAddr>, String> {
        if self.udp.is_empty() {
            return Ok(None);
        }
        let address = self.udp.parse();
        let wanted = "an address and a port, as 127.0.0.1:7401";
        let address = address.map_err(|_| format!("'{}': wanted is {wanted}", self.udp))?;
        Ok(Some(address))
    }
}

/// Kind of the sensor source.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema, ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The simulated rover.
    #[default]
    Simulator,
    /// Recorded frames.
    Playback,
    /// A publisher outside the graph, in shared memory.
    External,
    /// A publisher anywhere, by datagrams.
    Socket,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.to_possible_value();
        f.write_str(value.as_ref().map_or("", |value| value.get_name()))
    }
}

impl Source {
    /// True if the frames come from outside: who sends them may take their time.
    #[must_use]
    pub const fn is_outside(self) -> bool {
        matches!(self, Self::External | Self::Socket)
    }
}

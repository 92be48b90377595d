//! Where sensor frames come from.

use std::fmt;
use std::net::SocketAddr;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

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
    /// with another address every machine that reaches it may send frames.
    #[default = "127.0.0.1:7401"]
    pub udp: String,
    /// Name of a Unix datagram socket in the graph's runtime folder; empty for none.
    #[default = "sensor.sock"]
    pub unix: String,
}

impl Socket {
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

//! Where sensor frames come from.

use std::fmt;
use std::net::SocketAddr;

use clap::ValueEnum;
use serde::Deserialize;

/// Where sensor frames come from.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sensor {
    /// `simulator`, `playback`, `external` (a publisher in shared memory) or `socket`.
    pub source: Source,
    /// Frames to play back (CSV or CSV.gz), relative to the graph file; for `playback`.
    pub frames: Option<String>,
    /// Runs to play back: `all`, `heldout` (those that the model was not learned from), or run ids
    /// separated by commas; for `playback`.
    pub runs: Option<String>,
    /// Speed of the playback relative to the recording, 0.01 to 100; default 1.
    pub speed: Option<f64>,
    /// Where frames arrive as datagrams; for `socket`.
    pub socket: Socket,
}

/// Where frames arrive as datagrams.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Socket {
    /// Address and port of a UDP socket; empty for none. The default, `127.0.0.1:7401`, is for
    /// this machine alone; with another address every machine that reaches it may send frames.
    pub udp: String,
    /// Name of a Unix datagram socket in the graph's runtime folder; empty for none. Default:
    /// `sensor.sock`.
    pub unix: String,
}

impl Default for Socket {
    fn default() -> Self {
        Self {
            udp: "127.0.0.1:7401".into(),
            unix: "sensor.sock".into(),
        }
    }
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, ValueEnum)]
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

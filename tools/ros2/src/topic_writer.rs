//! Writers of bytes that are in CDR already.

use std::convert::Infallible;

use rustdds::bytes::Bytes;
use rustdds::no_key::{DataWriter, SerializerAdapter};
use rustdds::policy::{Durability, History};
use rustdds::{Duration, QosPolicies, QosPolicyBuilder, RepresentationIdentifier};

/// Length of the encapsulation, which the network stack writes itself.
const HEAD: usize = 4;

/// A message as it travels, without its encapsulation.
pub struct CdrBytes(Bytes);

impl CdrBytes {
    /// Those of a message whose encapsulation says CDR, little endian.
    pub fn new(message: &[u8]) -> Self {
        Self(Bytes::copy_from_slice(
            message.get(HEAD..).unwrap_or_default(),
        ))
    }
}

/// Passes bytes on as they are.
pub struct ByteAdapter;

impl SerializerAdapter<CdrBytes> for ByteAdapter {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &CdrBytes) -> Result<Bytes, Infallible> {
        Ok(value.0.clone())
    }
}

/// Writes to one topic of the network.
pub type TopicWriter = DataWriter<CdrBytes, ByteAdapter>;

/// What every reader of ROS 2 can take: each message arrives, as far as the last ten hold it.
pub fn quality() -> QosPolicies {
    QosPolicyBuilder::new()
        .durability(Durability::Volatile)
        .reliable(Duration::ZERO)
        .history(History::KeepLast { depth: 10 })
        .build()
}

/// Of what tells late readers about nodes: the last message is kept for them.
pub fn kept_quality() -> QosPolicies {
    QosPolicyBuilder::new()
        .durability(Durability::TransientLocal)
        .reliable(Duration::ZERO)
        .history(History::KeepLast { depth: 1 })
        .build()
}

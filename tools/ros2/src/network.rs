//! The network of ROS 2: one participant, a writer for each topic.

use std::collections::BTreeMap;
use std::fmt;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Duration;

use rustdds::dds::{CreateError, WriteError};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Publisher, QosPolicies, RTPSEntity, TopicKind,
};
use vigil_flight::{RosMessage, RosTopic};

use crate::node_info::{self, NodeInfo, node_name};
use crate::topic_writer::{ByteAdapter, CdrBytes, TopicWriter, kept_quality, quality};

/// How long the last messages are waited for, for each topic.
const LAST: Duration = Duration::from_millis(500);
/// Where every message about faults stands.
const DIAGNOSTICS: &str = "/diagnostics";

/// Which network.
#[derive(Debug, Clone, clap::Args)]
pub struct NetworkArgs {
    /// Domain of ROS 2.
    #[arg(long, value_name = "N", env = "ROS_DOMAIN_ID", default_value = "0",
          value_parser = clap::value_parser!(u16).range(0..=232))]
    pub domain: u16,
    /// Address of a network interface to use; can be repeated. Without it: all of them.
    #[arg(long, value_name = "IP")]
    pub address: Vec<IpAddr>,
    /// Tell of the node as ROS 2 Humble and older ones read it.
    #[arg(long)]
    pub humble: bool,
}

/// Why a message cannot be sent.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The participant or a writer cannot be made.
    #[error("the network of ROS 2, domain {domain}: {source}")]
    Open {
        /// The domain.
        domain: u16,
        /// What the stack says.
        source: CreateError,
    },
    /// A message was refused.
    #[error("{topic}: {said}")]
    Write {
        /// Where it was to stand.
        topic: &'static str,
        /// What the stack says.
        said: String,
    },
}

/// A participant with its writers.
pub struct Network {
    domain: u16,
    node: String,
    writers: BTreeMap<&'static str, TopicWriter>,
    /// Keeps what tells of the node.
    _node_writer: TopicWriter,
    // Dropped after the writers.
    _participant: DomainParticipant,
}

/// Who makes writers.
struct WriterFactory {
    participant: DomainParticipant,
    publisher: Publisher,
}

impl WriterFactory {
    fn make(
        &self,
        topic: &str,
        type_name: &str,
        quality: &QosPolicies,
    ) -> Result<TopicWriter, CreateError> {
        let (topic, kind) = (topic.to_owned(), TopicKind::NoKey);
        let type_name = type_name.to_owned();
        let topic = self
            .participant
            .create_topic(topic, type_name, quality, kind)?;
        self.publisher
            .create_datawriter_no_key::<CdrBytes, ByteAdapter>(&topic, Some(quality.clone()))
    }
}

/// `sensor_msgs/msg/JointState` as its type is called on the network.
fn network_type(name: &str) -> String {
    let (package, plain) = name.rsplit_once('/').unwrap_or(("", name));
    format!("{}::dds_::{plain}_", package.replace('/', "::"))
}

/// The wish of the environment to stay on this machine, as ROS 2 reads it.
fn is_local() -> bool {
    let is = |name, value| std::env::var(name).is_ok_and(|given| given == value);
    is("ROS_LOCALHOST_ONLY", "1") || is("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
}

impl Network {
    /// Joins a network as a node named after `graph`, with a writer for each topic.
    ///
    /// # Errors
    /// The participant or a writer cannot be made.
    pub fn open(
        args: &NetworkArgs,
        graph: &str,
        topics: &[&'static RosTopic],
    ) -> Result<Self, NetworkError> {
        Self::create(args, node_name(graph), topics).map_err(|source| NetworkError::Open {
            domain: args.domain,
            source,
        })
    }

    fn create(
        args: &NetworkArgs,
        node: String,
        topics: &[&'static RosTopic],
    ) -> Result<Self, CreateError> {
        let mut addresses = args.address.clone();
        if addresses.is_empty() && is_local() {
            addresses.push(Ipv4Addr::LOCALHOST.into());
        }
        let mut builder = DomainParticipantBuilder::new(args.domain);
        if !addresses.is_empty() {
            builder = builder.with_only_networks(addresses);
        }
        let participant = builder.build()?;
        let publisher = participant.create_publisher(&quality())?;
        let factory = WriterFactory {
            participant,
            publisher,
        };
        let writer = |topic: &&'static RosTopic| {
            let type_name = network_type(topic.type_name());
            let writer = factory.make(&format!("rt{}", topic.name), &type_name, &quality())?;
            Ok((topic.name, writer))
        };
        let writers: BTreeMap<_, _> = topics
            .iter()
            .map(writer)
            .collect::<Result<_, CreateError>>()?;
        let node_writer = factory.make(node_info::TOPIC, node_info::TYPE, &kept_quality())?;
        let identities: Vec<_> = writers.values().map(|it| it.guid().to_bytes()).collect();
        let info = NodeInfo {
            participant: factory.participant.guid().to_bytes(),
            name: &node,
            writers: &identities,
            identity_bytes: if args.humble { 24 } else { 16 },
        };
        // Without it the topics are there all the same.
        let _ = node_writer.write(CdrBytes::new(&info.cdr()), None);
        Ok(Self {
            domain: args.domain,
            node,
            writers,
            _node_writer: node_writer,
            _participant: factory.participant,
        })
    }

    /// Sends a message; one of a topic that was not asked for is passed over.
    ///
    /// # Errors
    /// The stack refuses it. A reader that is too slow is no error: it loses the oldest.
    pub fn send(&self, message: RosMessage<'_>) -> Result<(), NetworkError> {
        let topic = message.topic.name;
        let Some(writer) = self.writers.get(topic) else {
            return Ok(());
        };
        match writer.write(CdrBytes::new(message.cdr), None) {
            Ok(()) | Err(WriteError::WouldBlock { .. }) => Ok(()),
            Err(error) => Err(NetworkError::Write {
                topic,
                said: error.to_string(),
            }),
        }
    }

    /// Leaves the network, once the last diagnostics have arrived or a moment is over.
    pub fn finish(self) {
        if let Some(writer) = self.writers.get(DIAGNOSTICS) {
            let _ = writer.wait_for_acknowledgments(LAST);
        }
    }
}

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (domain, node) = (self.domain, &self.node);
        let topics: Vec<&str> = self.writers.keys().copied().collect();
        write!(f, "domain {domain}, node /{node}: {}", topics.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::network_type;

    #[test]
    fn types_are_called_as_ros_calls_them() {
        let name = network_type("diagnostic_msgs/msg/DiagnosticArray");
        assert_eq!(name, "diagnostic_msgs::msg::dds_::DiagnosticArray_");
    }
}

//! What is there on the transport, whoever made it.

use std::fmt;

use iceoryx2::config::Config;
use iceoryx2::prelude::*;
use iceoryx2::service::static_config::messaging_pattern::MessagingPattern;

use crate::domain::Domain;
use crate::port_error::PortError;

/// A topic that exists, as its first user has made it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundTopic {
    /// Full name.
    pub path: String,
    /// Name of the type of its blocks.
    pub type_name: String,
    /// Size of a block, bytes.
    pub size: usize,
    /// Alignment of a block, bytes.
    pub alignment: usize,
    /// Version of the transport that made it.
    pub version: String,
    /// Blocks that a reader may fall behind.
    pub buffer: usize,
    /// Writers and readers that it admits.
    pub max_publishers: usize,
    /// See `max_publishers`.
    pub max_subscribers: usize,
}

impl FoundTopic {
    /// The publish-subscribe topics of a graph's place on this machine.
    ///
    /// # Errors
    /// [`PortError::Setup`] if they cannot be listed.
    pub fn all(domain: &Domain) -> Result<Vec<Self>, PortError> {
        set_log_level(LogLevel::Error);
        Self::listed(&domain.transport_config()?)
    }

    /// The same by the transport's own settings.
    pub(super) fn listed(config: &Config) -> Result<Vec<Self>, PortError> {
        let mut found = Vec::new();
        ipc::Service::list(config, |service| {
            let details = &service.static_details;
            if let MessagingPattern::PublishSubscribe(topic) = details.messaging_pattern() {
                let payload = &topic.message_type_details().payload;
                found.push(Self {
                    path: details.name().to_string(),
                    type_name: payload.type_name().to_string(),
                    size: payload.size(),
                    alignment: payload.alignment(),
                    version: details.iceoryx2_version().to_string(),
                    buffer: topic.subscriber_max_buffer_size(),
                    max_publishers: topic.max_publishers(),
                    max_subscribers: topic.max_subscribers(),
                });
            }
            CallbackProgression::Continue
        })
        .map_err(|e| PortError::setup("list of topics", e))?;
        Ok(found)
    }
}

impl fmt::Display for FoundTopic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {} bytes, alignment {} (iceoryx2 {})",
            self.type_name, self.size, self.alignment, self.version
        )
    }
}

#[cfg(test)]
mod tests {
    use vigil_blocks::Health;
    use vigil_blocks::layout::Layout;

    use super::*;
    use crate::domain::Queues;
    use crate::port::{Graph, Link};
    use crate::topic::{ServiceName, Topic};

    #[test]
    fn a_topic_is_found_as_its_writer_has_made_it() {
        let graph = format!("t{}-found", std::process::id());
        let domain = Domain::new(&graph, Queues::default()).unwrap();
        assert_eq!(FoundTopic::all(&domain).unwrap(), []);
        let service = Graph::SharedMemory(Link::join(&domain, "test").unwrap());
        let topic = Topic::Health(ServiceName::Detector);
        let sender = service.sender::<Health>(topic).unwrap();
        let found = FoundTopic::all(&domain).unwrap();
        let [found] = found.as_slice() else {
            panic!("{found:?}");
        };
        assert!(found.path.ends_with("health/detector"), "{}", found.path);
        assert_eq!(found.size, size_of::<Health>());
        assert_eq!(found.buffer, Queues::default().buffer);
        assert_eq!((found.max_publishers, found.max_subscribers), (1, 8));
        assert!(
            found.type_name.contains(Health::NAME),
            "{}",
            found.type_name
        );
        drop((sender, service));
        domain.remove_residue();
    }
}

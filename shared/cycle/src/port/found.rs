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

//! Why ports fail.

use std::error::Error;

use iceoryx2::service::builder::event::EventOpenError;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;

/// What the transport or the system said. The transport has an error type for each operation;
/// they are boxed, so that they are no part of this crate's face.
type Cause = Box<dyn Error + Send + Sync>;

/// Why a port could not be opened or used.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The topic could not be opened.
    #[error("topic {topic} (type {type_name}, {size} bytes) cannot be opened: {cause}{}",
        other.as_ref().map(|other| format!("; it exists as {other}")).unwrap_or_default())]
    Open {
        /// Full name of the topic.
        topic: String,
        /// Type name that this side expects.
        type_name: &'static str,
        /// Size of the block.
        size: usize,
        /// The type as which another process has made it.
        other: Option<String>,
        /// What the transport said.
        #[source]
        cause: Cause,
    },
    /// A block could not be loaned, sent or received.
    #[error("topic {topic}: {operation} failed: {cause}")]
    Transfer {
        /// Full name of the topic.
        topic: String,
        /// `loan`, `send`, `notify` or `receive`.
        operation: &'static str,
        /// What the transport said.
        #[source]
        cause: Cause,
    },
    /// Something that the ports need could not be set up.
    #[error("{what} cannot be set up: {cause}")]
    Setup {
        /// What it is.
        what: &'static str,
        /// What the system said.
        #[source]
        cause: Cause,
    },
}

impl PortError {
    /// True if the graph is just making the topic, or just taking it away: it may be there later.
    #[must_use]
    pub fn is_coming(&self) -> bool {
        use EventOpenError as Event;
        use PublishSubscribeOpenError as Blocks;
        let Self::Open { cause, .. } = self else {
            return false;
        };
        let are_blocks = matches!(
            cause.downcast_ref(),
            Some(
                Blocks::DoesNotExist
                    | Blocks::HangsInCreation
                    | Blocks::IsMarkedForDestruction
                    | Blocks::ServiceInCorruptedState
            )
        );
        let is_event = matches!(
            cause.downcast_ref(),
            Some(
                Event::DoesNotExist
                    | Event::HangsInCreation
                    | Event::IsMarkedForDestruction
                    | Event::ServiceInCorruptedState
            )
        );
        are_blocks || is_event
    }

    /// A [`PortError::Setup`] from any error.
    pub fn setup(what: &'static str, cause: impl Into<Cause>) -> Self {
        Self::Setup {
            what,
            cause: cause.into(),
        }
    }
}

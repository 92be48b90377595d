//! Blocks that topics carry.

use vigil_blocks::{
    Action, Block, CheckpointPart, Control, DetectionBelief, FaultBelief, Faults, Health, Journal,
    ParticleBlock, SensorFrame, Truth,
};

use super::{Link, Receiver, Sender};
use crate::port_error::PortError;
use crate::topic::Topic;

/// A block that topics carry; [`carried`](crate::carried) implements it. The transport is generic
/// over the block: where it is implemented, there it is compiled, so each service merely links it.
pub trait TopicBlock: Block {
    /// The writing side of a topic in shared memory.
    ///
    /// # Errors
    /// [`PortError::Open`].
    fn sender(link: &Link, topic: Topic) -> Result<Box<dyn Sender<Self>>, PortError>;

    /// A reading side of a topic in shared memory.
    ///
    /// # Errors
    /// [`PortError::Open`].
    fn receiver(link: &Link, topic: Topic) -> Result<Box<dyn Receiver<Self>>, PortError>;
}

/// Compiles the transport for these blocks.
#[macro_export]
macro_rules! carried {
    ($($block:ty),+ $(,)?) => { $(
        impl $crate::port::TopicBlock for $block {
            fn sender(
                link: &$crate::port::Link,
                topic: $crate::Topic,
            ) -> Result<Box<dyn $crate::Sender<Self>>, $crate::PortError> {
                link.sender(topic)
            }

            fn receiver(
                link: &$crate::port::Link,
                topic: $crate::Topic,
            ) -> Result<Box<dyn $crate::Receiver<Self>>, $crate::PortError> {
                link.receiver(topic)
            }
        }
    )+ };
}

carried!(
    Action,
    CheckpointPart,
    Control,
    DetectionBelief,
    FaultBelief,
    Faults,
    Health,
    Journal,
    ParticleBlock,
    SensorFrame,
    Truth,
);

//! Where messages go: into a file, or onto a network.

use vigil_blocks::Block;
use vigil_blocks::layout::Layout;
use vigil_cycle::topic::Topic;
use vigil_timeline::WallClock;

use crate::message_times::MessageTimes;
use crate::messages::message::Message;
use crate::topics::RosTopic;

/// Takes blocks as they are, and the messages that follow from them.
pub(crate) trait Sink {
    /// Why it cannot take one.
    type Error;

    /// What the calendar says.
    fn clock(&self) -> &WallClock;

    /// Takes a block as it is, and says when it was; `None` if it is something else.
    fn keep<B: Block + Layout>(
        &mut self,
        topic: Topic,
        bytes: &[u8],
    ) -> Result<Option<MessageTimes>, Self::Error>;

    /// Takes a message of ROS 2.
    fn write(
        &mut self,
        topic: &'static RosTopic,
        times: MessageTimes,
        message: &impl Message,
    ) -> Result<(), Self::Error>;
}

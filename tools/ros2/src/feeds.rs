//! The topics of the graph. What is lost between two looks is not missed: the next block says more.

use vigil_blocks::{
    Action, Block, DetectionBelief, FaultBelief, Faults, Health, SensorFrame, Truth,
};
use vigil_cycle::port::{Link, TopicBlock};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Domain, Graph, Monotonic, PortError, Receiver, Topic};
use vigil_flight::LiveMessages;

use crate::network::{Network, NetworkError};

/// A topic of any type.
trait Feed {
    /// Sends what follows from the blocks that wait.
    fn drain(&mut self, messages: &mut LiveMessages, network: &Network)
    -> Result<(), NetworkError>;
}

/// A topic of one type.
struct TypedFeed<T: Block> {
    topic: Topic,
    receiver: Box<dyn Receiver<T>>,
}

impl<T: Block> Feed for TypedFeed<T> {
    fn drain(
        &mut self,
        messages: &mut LiveMessages,
        network: &Network,
    ) -> Result<(), NetworkError> {
        let now_ns = Monotonic.now_ns();
        // At most a full queue: a flood must not hold the reader.
        for _ in 0..self.receiver.buffer() {
            let Some(block) = self.receiver.take_next() else {
                break;
            };
            let bytes = bytemuck::bytes_of(block);
            messages.block(self.topic, bytes, now_ns, &mut |it| network.send(it))?;
        }
        Ok(())
    }
}

/// The topics that are observed.
pub struct Feeds {
    feeds: Vec<Box<dyn Feed>>,
}

fn feed<T: TopicBlock>(graph: &Graph, topic: Topic) -> Result<Box<dyn Feed>, PortError> {
    let receiver = graph.receiver::<T>(topic)?;
    Ok(Box::new(TypedFeed { topic, receiver }))
}

impl Feeds {
    /// Opens them; with `all` also what the robot says.
    ///
    /// # Errors
    /// The transport's.
    pub fn open(domain: &Domain, all: bool) -> Result<Self, PortError> {
        let graph = Graph::SharedMemory(Link::join(domain, "vigil-ros2")?);
        let mut feeds = vec![
            feed::<Faults>(&graph, Topic::Faults)?,
            feed::<DetectionBelief>(&graph, Topic::Detection)?,
            feed::<FaultBelief>(&graph, Topic::Diagnosis)?,
            feed::<Action>(&graph, Topic::Action)?,
        ];
        for service in ServiceName::ALL {
            feeds.push(feed::<Health>(&graph, Topic::Health(service))?);
        }
        if all {
            feeds.push(feed::<SensorFrame>(&graph, Topic::Sensor)?);
            feeds.push(feed::<Truth>(&graph, Topic::Truth)?);
        }
        Ok(Self { feeds })
    }

    /// Sends what follows from the blocks that wait.
    ///
    /// # Errors
    /// The network's.
    pub fn drain(
        &mut self,
        messages: &mut LiveMessages,
        network: &Network,
    ) -> Result<(), NetworkError> {
        let mut feeds = self.feeds.iter_mut();
        feeds.try_for_each(|feed| feed.drain(messages, network))
    }
}

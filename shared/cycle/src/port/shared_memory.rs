//! Ports over iceoryx2: blocks loaned, written and read in place in shared memory.

use std::error::Error;
use std::os::fd::RawFd;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use vigil_blocks::Block;

use super::{FoundTopic, Receiver, Sender, Stamp, Stamper};
use crate::clock::{Clock, Monotonic};
use crate::domain::{BORROWED, Domain, LOANED, Queues};
use crate::port_error::PortError;
use crate::topic::Topic;
use crate::wake::{INPUTS, Inputs, NOTHING};

/// A block as the transport sees it: the same bytes, named by the block's schema.
#[repr(transparent)]
#[derive(Debug, Clone, Copy)]
pub struct Wire<T>(pub T);

// SAFETY: `Block` requires plain old data (`Pod`): self-contained, `repr(C)`, no pointers, valid
// for any bytes. The type name holds the hash of the whole layout.
#[allow(unsafe_code)]
unsafe impl<T: Block> ZeroCopySend for Wire<T> {
    unsafe fn type_name() -> &'static str {
        T::TYPE_NAME
    }
}

/// A process's link to the graph: one node, and the settings that every topic shares.
pub struct Link {
    node: Node<ipc::Service>,
    graph: String,
    queues: Queues,
    /// Opens what the graph has made, whatever its settings, and makes nothing.
    is_guest: bool,
}

/// What peers must agree on, without the type itself.
#[derive(Debug, Clone, Copy)]
struct WireType {
    name: &'static str,
    size: usize,
}

impl WireType {
    const fn new<T: Block>() -> Self {
        Self {
            name: T::TYPE_NAME,
            size: size_of::<T>(),
        }
    }
}

type TopicFactory<T> =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, Wire<T>, ()>;
type EventFactory = iceoryx2::service::port_factory::event::PortFactory<ipc::Service>;

impl Link {
    /// Joins the graph of `domain` under `name`; removes what dead processes left behind.
    ///
    /// # Errors
    /// [`PortError::Setup`].
    pub fn join(domain: &Domain, name: &str) -> Result<Self, PortError> {
        // Its warnings are about files that another process has just cleaned up.
        set_log_level(LogLevel::Error);
        let config = domain.transport_config()?;
        let node_name = NodeName::new(name).map_err(|e| PortError::setup("node name", e))?;
        let node = NodeBuilder::new()
            .config(&config)
            .name(&node_name)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|e| PortError::setup("node", e))?;
        Ok(Self {
            node,
            graph: domain.graph().to_owned(),
            queues: domain.queues(),
            is_guest: false,
        })
    }

    /// Joins a running graph, of whose settings nothing is known: only what its services have made
    /// can be opened.
    ///
    /// # Errors
    /// [`PortError::Setup`].
    pub fn join_as_guest(domain: &Domain, name: &str) -> Result<Self, PortError> {
        let link = Self::join(domain, name)?;
        Ok(Self {
            is_guest: true,
            ..link
        })
    }

    /// The one place where topics are opened: the same settings for every peer, whoever is first.
    fn topic<T: Block>(&self, topic: Topic) -> Result<TopicFactory<T>, PortError> {
        let (name, queues) = (
            self.name(topic, WireType::new::<T>())?,
            self.queues.for_topic(topic),
        );
        let builder = self
            .node
            .service_builder(&name)
            .publish_subscribe::<Wire<T>>();
        if self.is_guest {
            let error = |e| self.open_error(topic, WireType::new::<T>(), e);
            return builder.open().map_err(error);
        }
        builder
            .max_publishers(1)
            .max_subscribers(queues.max_subscribers)
            .max_nodes(queues.max_subscribers + 4)
            .subscriber_max_buffer_size(queues.buffer)
            .subscriber_max_borrowed_samples(BORROWED)
            .history_size(queues.history)
            .enable_safe_overflow(true)
            .open_or_create()
            .map_err(|e| self.open_error(topic, WireType::new::<T>(), e))
    }

    fn event(&self, topic: Topic, wire: WireType) -> Result<EventFactory, PortError> {
        let name = self.name(topic, wire)?;
        let builder = self.node.service_builder(&name).event();
        if self.is_guest {
            return builder.open().map_err(|e| self.open_error(topic, wire, e));
        }
        builder
            .max_notifiers(4)
            .max_listeners(self.queues.max_subscribers)
            .max_nodes(self.queues.max_subscribers + 4)
            .event_id_max_value(15)
            .open_or_create()
            .map_err(|e| self.open_error(topic, wire, e))
    }

    fn name(&self, topic: Topic, wire: WireType) -> Result<ServiceName, PortError> {
        let path = topic.path(&self.graph);
        ServiceName::new(&path).map_err(|e| self.open_error(topic, wire, e))
    }

    fn open_error(
        &self,
        topic: Topic,
        wire: WireType,
        cause: impl Error + Send + Sync + 'static,
    ) -> PortError {
        let path = topic.path(&self.graph);
        let found = FoundTopic::listed(self.node.config()).unwrap_or_default();
        let other = |found: &&FoundTopic| found.path == path && found.type_name != wire.name;
        PortError::Open {
            other: found.iter().find(other).map(FoundTopic::to_string),
            topic: path,
            type_name: wire.name,
            size: wire.size,
            cause: cause.into(),
        }
    }

    /// Opens the writing side; warm: one block is loaned, and every slot was touched by the
    /// transport's own initialisation.
    #[doc(hidden)]
    pub fn sender<T: Block>(&self, topic: Topic) -> Result<Box<dyn Sender<T>>, PortError> {
        let wire = WireType::new::<T>();
        let publisher = self
            .topic::<T>(topic)?
            .publisher_builder()
            .max_loaned_samples(LOANED)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| self.open_error(topic, wire, e))?;
        let notifier = self.event_notifier(topic, wire)?;
        let path = topic.path(&self.graph);
        let loaned = loan(&publisher, &path)?;
        // The start instant identifies the start: no two starts of one writer share it, as the
        // transport admits one living writer only.
        let epoch = Monotonic.now_ns().max(1);
        let spare = bytemuck::allocation::zeroed_box();
        Ok(Box::new(SharedSender {
            loaned: Some(loaned),
            spare,
            has_refused: false,
            publisher,
            notifier,
            path,
            stamper: Stamper::new(epoch),
        }))
    }

    /// Opens a reading side.
    #[doc(hidden)]
    pub fn receiver<T: Block>(&self, topic: Topic) -> Result<Box<dyn Receiver<T>>, PortError> {
        let wire = WireType::new::<T>();
        let buffer = self.queues.for_topic(topic).buffer;
        let subscriber = self
            .topic::<T>(topic)?
            .subscriber_builder()
            .buffer_size(buffer)
            .create()
            .map_err(|e| self.open_error(topic, wire, e))?;
        Ok(Box::new(SharedReceiver {
            subscriber,
            held: None,
            buffer,
        }))
    }

    /// Opens the wake-up side of a topic.
    ///
    /// # Errors
    /// [`PortError::Open`].
    pub fn listener<T: Block>(&self, topic: Topic) -> Result<EventListener, PortError> {
        self.event_listener(topic, WireType::new::<T>())
    }

    fn event_listener(&self, topic: Topic, wire: WireType) -> Result<EventListener, PortError> {
        let listener = self
            .event(topic, wire)?
            .listener_builder()
            .create()
            .map_err(|e| self.open_error(topic, wire, e))?;
        Ok(EventListener { listener })
    }

    /// Opens a side of a topic that wakes its readers without a block: for measuring what a flood
    /// of wake-ups does.
    ///
    /// # Errors
    /// [`PortError::Open`].
    pub fn notifier<T: Block>(&self, topic: Topic) -> Result<EventNotifier, PortError> {
        let notifier = self.event_notifier(topic, WireType::new::<T>())?;
        Ok(EventNotifier { notifier })
    }

    fn event_notifier(
        &self,
        topic: Topic,
        wire: WireType,
    ) -> Result<Notifier<ipc::Service>, PortError> {
        self.event(topic, wire)?
            .notifier_builder()
            .create()
            .map_err(|e| self.open_error(topic, wire, e))
    }

    /// Removes what dead processes of this graph left behind. File-system work: never on a
    /// real-time thread.
    pub fn remove_dead_peers(&self) {
        let _ = self.node.try_cleanup_dead_nodes();
    }
}

/// Wakes a service when a block arrives on a topic.
pub struct EventListener {
    listener: Listener<ipc::Service>,
}

impl Inputs for EventListener {
    fn descriptors(&self) -> [RawFd; INPUTS] {
        // SAFETY: the descriptor is only polled, and only while the listener lives.
        #[allow(unsafe_code)]
        let descriptor = unsafe { self.listener.file_descriptor().native_handle() };
        [descriptor, NOTHING, NOTHING]
    }

    fn drain(&self) {
        let _ = self.listener.try_wait(|_| {});
    }
}

/// Wakes the readers of a topic.
pub struct EventNotifier {
    notifier: Notifier<ipc::Service>,
}

impl EventNotifier {
    /// Wakes them; false if the transport refused.
    #[must_use]
    pub fn notify(&self) -> bool {
        self.notifier.notify().is_ok()
    }
}

type LoanedSample<T> = SampleMut<ipc::Service, Wire<T>, ()>;

fn loan<T: Block>(
    publisher: &Publisher<ipc::Service, Wire<T>, ()>,
    path: &str,
) -> Result<LoanedSample<T>, PortError> {
    let mut sample = publisher
        .loan_uninit()
        .map_err(|e| transfer(path, "loan", e))?;
    // Zeroed in place: a block of 80 KiB must not travel over the stack.
    // SAFETY: the slot is writable memory of exactly one `Wire<T>`; all-zero bytes are a valid `T`.
    #[allow(unsafe_code)]
    unsafe {
        sample.payload_mut().as_mut_ptr().write_bytes(0, 1);
        Ok(sample.assume_init())
    }
}

fn transfer(
    path: &str,
    operation: &'static str,
    cause: impl Into<Box<dyn Error + Send + Sync>>,
) -> PortError {
    PortError::Transfer {
        topic: path.to_owned(),
        operation,
        cause: cause.into(),
    }
}

pub(super) struct SharedSender<T: Block> {
    // Fields drop in this order: the loaned block returns before its publisher goes.
    loaned: Option<LoanedSample<T>>,
    /// Written to when the transport refuses a block.
    spare: Box<T>,
    has_refused: bool,
    publisher: Publisher<ipc::Service, Wire<T>, ()>,
    notifier: Notifier<ipc::Service>,
    path: String,
    stamper: Stamper,
}

impl<T: Block> Sender<T> for SharedSender<T> {
    fn block(&mut self) -> &mut T {
        if self.prepare().is_err() {
            // `send` says so.
            self.has_refused = true;
        }
        match &mut self.loaned {
            Some(sample) => &mut sample.payload_mut().0,
            None => &mut self.spare,
        }
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        if self.loaned.is_none() {
            self.loaned = Some(loan(&self.publisher, &self.path)?);
        }
        Ok(())
    }

    fn send(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        if std::mem::take(&mut self.has_refused) {
            let what = "a block was refused when it was to be written";
            return Err(transfer(&self.path, "send", what));
        }
        let mut sample = match self.loaned.take() {
            Some(sample) => sample,
            None => loan(&self.publisher, &self.path)?,
        };
        let published_ns = self
            .stamper
            .stamp(&mut sample.payload_mut().0, stamp, clock);
        sample.send().map_err(|e| transfer(&self.path, "send", e))?;
        self.notifier
            .notify()
            .map_err(|e| transfer(&self.path, "notify", e))?;
        Ok(published_ns)
    }

    fn epoch(&self) -> u64 {
        self.stamper.epoch
    }

    fn next_seq(&self) -> u64 {
        self.stamper.seq
    }
}

pub(super) struct SharedReceiver<T: Block> {
    held: Option<Sample<ipc::Service, Wire<T>, ()>>,
    subscriber: Subscriber<ipc::Service, Wire<T>, ()>,
    buffer: usize,
}

impl<T: Block> Receiver<T> for SharedReceiver<T> {
    fn take_next(&mut self) -> Option<&T> {
        // Dropped before the next is taken, so that one borrowed block is the most ever held.
        self.held = None;
        // A failed read looks like silence: the deadline then counts it.
        self.held = self.subscriber.receive().unwrap_or(None);
        self.held()
    }

    fn held(&self) -> Option<&T> {
        self.held.as_ref().map(|sample| &sample.payload().0)
    }

    fn buffer(&self) -> usize {
        self.buffer
    }

    fn is_waiting(&self) -> bool {
        self.subscriber.has_samples().unwrap_or(false)
    }
}

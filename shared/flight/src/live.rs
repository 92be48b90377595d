//! What a running graph says, as messages that are sent at once.

use std::collections::BTreeMap;

use vigil_blocks::Block;
use vigil_blocks::layout::Layout;
use vigil_cycle::topic::{ServiceName, Topic};
use vigil_setup::Setup;
use vigil_timeline::{TimelineEntry, WallClock};

use crate::block_bytes::block_header;
use crate::cdr::Cdr;
use crate::message_times::MessageTimes;
use crate::messages::message::Message;
use crate::pace::Pace;
use crate::silence::Silence;
use crate::sink::Sink;
use crate::topics::RosTopic;
use crate::translation::{Speaker, Translation, write_event};

/// A message of ROS 2, as it travels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RosMessage<'a> {
    /// Where it stands.
    pub topic: &'static RosTopic,
    /// Its encapsulation of four bytes (CDR, little endian), then its fields.
    pub cdr: &'a [u8],
}

/// Takes messages.
pub type MessageTaker<'a, E> = &'a mut dyn FnMut(RosMessage<'_>) -> Result<(), E>;

/// Turns blocks into the messages that a recording would hold, and says what has fallen silent.
pub struct LiveMessages {
    translation: Translation,
    output: Output,
    faults: Silence,
    diagnosis: Silence,
    health: [Silence; ServiceName::ALL.len()],
}

/// What is kept between two messages.
struct Output {
    clock: WallClock,
    /// Of the topics of each cycle.
    paces: BTreeMap<&'static str, Pace>,
    /// Kept for its memory.
    cdr: Cdr,
}

/// The output with who takes the messages.
struct LiveSink<'a, E> {
    output: &'a mut Output,
    send: MessageTaker<'a, E>,
}

impl<E> Sink for LiveSink<'_, E> {
    type Error = E;

    fn clock(&self) -> &WallClock {
        &self.output.clock
    }

    fn keep<B: Block + Layout>(
        &mut self,
        _topic: Topic,
        bytes: &[u8],
    ) -> Result<Option<MessageTimes>, E> {
        Ok(block_header::<B>(bytes).map(|header| MessageTimes::new(&header, &self.output.clock)))
    }

    fn write(
        &mut self,
        topic: &'static RosTopic,
        times: MessageTimes,
        message: &impl Message,
    ) -> Result<(), E> {
        let Output { paces, cdr, .. } = &mut *self.output;
        let pace = paces.get_mut(topic.name);
        if pace.is_some_and(|pace| !pace.is_due(times.log_ns, 0)) {
            return Ok(());
        }
        cdr.clear();
        message.encode(cdr);
        let cdr = cdr.bytes();
        (self.send)(RosMessage { topic, cdr })
    }
}

impl LiveMessages {
    /// Of a graph whose models give everything its name. `period_ns` is the shortest time between
    /// two messages of a topic that has one for each cycle, `now_ns` an instant of
    /// `CLOCK_MONOTONIC`.
    #[must_use]
    pub fn new(graph: &Setup, period_ns: u64, now_ns: u64) -> Self {
        let topics = RosTopic::ALL.into_iter();
        let paced = topics.filter(|topic| topic.is_of_each_cycle);
        let pace = |topic: &RosTopic| (topic.name, Pace::every_ns(period_ns.max(1)));
        let silence = Silence::since(now_ns);
        Self {
            translation: Translation::new(graph),
            output: Output {
                clock: WallClock::now(),
                paces: paced.map(pace).collect(),
                cdr: Cdr::new(),
            },
            faults: silence,
            diagnosis: silence,
            health: [silence; ServiceName::ALL.len()],
        }
    }

    /// The same after a new start of the graph, whose models may be others. A fault that was told
    /// before it and is not there now is told to be over.
    #[must_use]
    pub fn restarted(self, graph: &Setup, now_ns: u64) -> Self {
        let silence = Silence::since(now_ns);
        Self {
            translation: self.translation.restarted(graph),
            output: self.output,
            faults: silence,
            diagnosis: silence,
            health: [silence; ServiceName::ALL.len()],
        }
    }

    /// Sends what follows from a block, as it came from its topic at `now_ns`.
    ///
    /// # Errors
    /// Those of `send`.
    pub fn block<E>(
        &mut self,
        topic: Topic,
        bytes: &[u8],
        now_ns: u64,
        send: MessageTaker<'_, E>,
    ) -> Result<(), E> {
        match topic {
            Topic::Faults => self.faults.hear(now_ns),
            Topic::Diagnosis => self.diagnosis.hear(now_ns),
            Topic::Health(service) => self.health[service.index()].hear(now_ns),
            _ => {}
        }
        let output = &mut self.output;
        let sink = &mut LiveSink { output, send };
        self.translation.write(topic, bytes, sink).map(|_| ())
    }

    /// Sends an event.
    ///
    /// # Errors
    /// Those of `send`.
    pub fn event<E>(&mut self, entry: &TimelineEntry, send: MessageTaker<'_, E>) -> Result<(), E> {
        let output = &mut self.output;
        write_event(entry, &mut LiveSink { output, send }).map(|_| ())
    }

    /// Says that nothing is known of whom it has not heard for two seconds, once a second; and
    /// looks at the calendar.
    ///
    /// # Errors
    /// Those of `send`.
    pub fn look<E>(&mut self, now_ns: u64, send: MessageTaker<'_, E>) -> Result<(), E> {
        self.output.clock = WallClock::now();
        let mut silent = Vec::new();
        // What is named first, for it is told with the faults.
        if self.diagnosis.is_due(now_ns) {
            silent.push(Speaker::Diagnosis);
        }
        if self.faults.is_due(now_ns) {
            silent.push(Speaker::Faults);
        }
        for service in ServiceName::ALL {
            if self.health[service.index()].is_due(now_ns) {
                silent.push(Speaker::Health(service));
            }
        }
        self.tell(&silent, "nothing is heard", now_ns, send)
    }

    /// Says that nothing is known any more, and why: the graph has ended.
    ///
    /// # Errors
    /// Those of `send`.
    pub fn end<E>(&mut self, why: &str, now_ns: u64, send: MessageTaker<'_, E>) -> Result<(), E> {
        let services = ServiceName::ALL.map(Speaker::Health);
        let all = [&[Speaker::Diagnosis, Speaker::Faults][..], &services].concat();
        self.tell(&all, why, now_ns, send)
    }

    fn tell<E>(
        &mut self,
        silent: &[Speaker],
        why: &str,
        now_ns: u64,
        send: MessageTaker<'_, E>,
    ) -> Result<(), E> {
        let output = &mut self.output;
        let times = MessageTimes::at(output.clock.unix_ns(now_ns));
        let sink = &mut LiveSink { output, send };
        let translation = &mut self.translation;
        let mut speakers = silent.iter();
        speakers.try_for_each(|of| translation.write_stale(*of, why, times, sink))
    }
}

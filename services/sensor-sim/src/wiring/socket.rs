//! Frames that arrive as datagrams, checked and passed on; verdicts go back to who sent them.

use std::net::SocketAddr;
use std::os::fd::RawFd;
use std::path::PathBuf;
use std::rc::Rc;

use vigil_blocks::datagram::{self, DATAGRAM_SIZE};
use vigil_blocks::{Cause, Rejection, SensorFrame, fnv1a};
use vigil_cycle::datagrams::{Datagrams, From};
use vigil_cycle::input::SILENT_NS;
use vigil_cycle::port::EventListener;
use vigil_cycle::wake::{INPUTS, Inputs};
use vigil_cycle::{
    Clock, Graph, HealthBoard, Intake, PortError, Sender, Stage, Stamp, Topic, Writer,
};
use vigil_robot::{Description, FrameGuard};

use super::answers::{Answers, VerdictNames};
use crate::arrival_clock::{ArrivalBatch, ArrivalClock};

/// Datagrams that one turn takes at most: a flood must not hold it. At the
/// highest rate, a turn of 6 ms of them.
const TURN_MAX: usize = 64;
/// Starts of the source are told apart in the bits of `run_id` from this one on.
const START_SHIFT: u32 = 16;

/// Where datagrams are to arrive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ListenAddresses {
    /// Address of the UDP socket; `None` for none.
    pub udp: Option<SocketAddr>,
    /// File of the Unix datagram socket; `None` for none.
    pub unix: Option<PathBuf>,
}

/// What wakes the stage: datagrams, and actions to be sent back.
pub struct SocketInputs {
    /// The sockets.
    pub datagrams: Rc<Datagrams>,
    /// Announces actions.
    pub actions: EventListener,
}

impl Inputs for SocketInputs {
    fn descriptors(&self) -> [RawFd; INPUTS] {
        let [udp, unix, _] = self.datagrams.descriptors();
        let [actions, ..] = self.actions.descriptors();
        [udp, unix, actions]
    }

    fn drain(&self) {
        self.actions.drain();
    }
}

/// Takes frames from sockets and publishes those that pass every check. The first source whose
/// frame is taken is the graph's, until it is silent.
pub struct SocketStage {
    datagrams: Rc<Datagrams>,
    guard: FrameGuard,
    clock: ArrivalClock,
    source: Option<From>,
    taken_ns: u64,
    /// Frames that arrived in this turn.
    arrived: Vec<(SensorFrame, From)>,
    /// Datagrams of other sources that waited in the kernel and were dropped unread.
    unread: usize,
    waiting: Vec<SensorFrame>,
    frames: Box<dyn Sender<SensorFrame>>,
    answers: Answers,
}

impl SocketStage {
    /// Publishes on `graph` what arrives at `datagrams`, for frames of `robot`; verdicts that go
    /// back use these names.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(
        datagrams: Rc<Datagrams>,
        robot: &Description,
        names: VerdictNames,
        graph: &Graph,
    ) -> Result<Self, PortError> {
        let frames = graph.sender::<SensorFrame>(Topic::Sensor)?;
        Ok(Self {
            datagrams,
            guard: FrameGuard::new(robot),
            clock: ArrivalClock::default(),
            source: None,
            taken_ns: 0,
            arrived: Vec::with_capacity(TURN_MAX),
            unread: 0,
            waiting: Vec::with_capacity(TURN_MAX),
            answers: Answers::new(names, graph, frames.epoch())?,
            frames,
        })
    }

    /// Reads the datagrams that are here; true if those are all.
    fn receive(&mut self, intake: &mut Intake<'_>) -> bool {
        // One byte more than a datagram has: a longer one shows.
        let mut buffer = [0; DATAGRAM_SIZE + 1];
        self.arrived.clear();
        for _ in 0..std::mem::take(&mut self.unread) {
            intake.count(Rejection::OtherWriter);
        }
        for _ in 0..TURN_MAX {
            let Some((length, from)) = self.datagrams.receive(&mut buffer) else {
                return true;
            };
            if self.source.is_some_and(|source| source != from) {
                intake.reject(Rejection::OtherWriter);
                continue;
            }
            match datagram::decode(&buffer[..length]) {
                Ok(frame) => self.arrived.push((frame, from)),
                // Before a source is chosen, nobody's violations are counted.
                Err(rejection) if self.source.is_none() => intake.count(rejection),
                Err(rejection) => intake.reject(rejection),
            }
        }
        false
    }

    fn choose(&mut self, from: From) {
        self.source = Some(from);
        // If the kernel cannot, the comparison of addresses remains.
        let _ = self.datagrams.only(from);
    }
}

impl Stage for SocketStage {
    fn take(&mut self, intake: &mut Intake<'_>) {
        if self.answers.take() {
            intake.took_further();
        }
        let are_all_here = self.receive(intake);
        let now_ns = intake.now_ns();
        for i in 0..self.arrived.len() {
            let (mut frame, from) = self.arrived[i];
            if self.source.is_some_and(|source| source != from) {
                intake.reject(Rejection::OtherWriter);
                continue;
            }
            let here = self.arrived.iter().filter(|(_, other)| *other == from);
            let here = here.map(|(frame, _)| &frame.header);
            let here = ArrivalBatch {
                headers: here,
                is_complete: are_all_here,
            };
            let clock = self.clock.date(&mut frame.header, here, now_ns);
            frame.header.t_publish_ns = now_ns;
            let content = || self.guard.check(&frame);
            if !intake.admit::<SensorFrame>(&frame.header, content) {
                continue;
            }
            self.clock = clock;
            if self.source.is_none() {
                self.choose(from);
            }
            self.taken_ns = now_ns;
            // Readers see this service's epoch: a new start of the source must change the run, and
            // one of this service must not.
            frame.run_id ^= fnv1a::hash_u64(fnv1a::BASIS, frame.header.epoch) << START_SHIFT;
            self.waiting.push(frame);
            intake.stepped(&frame.header, frame.header.id());
        }
    }

    fn miss(&mut self, _count: u32) {}

    fn publish(
        &mut self,
        _cause: Cause,
        _stamp: Stamp,
        clock: &dyn Clock,
    ) -> Result<u64, PortError> {
        let mut published_ns = clock.now_ns();
        for frame in self.waiting.drain(..) {
            *self.frames.block() = frame;
            published_ns = self.frames.send(Stamp::from_header(&frame.header), clock)?;
        }
        Ok(published_ns)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.frames.prepare()
    }

    /// A missing frame is not predicted.
    fn predicts(&self) -> bool {
        false
    }

    fn writer(&self) -> Writer {
        Writer::Socket
    }

    fn after(&mut self, _health: &mut HealthBoard, now_ns: u64) {
        self.answers.send(&self.datagrams, self.source, now_ns);
        if self.source.is_some() && now_ns.saturating_sub(self.taken_ns) > SILENT_NS {
            self.source = None;
            self.unread += self.datagrams.from_anywhere();
        }
    }
}

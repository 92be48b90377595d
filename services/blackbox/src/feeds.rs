//! What the black box hears: every topic of its graph.

use std::io;

use vigil_blocks::{
    Action, Block, BlockId, CheckpointPart, Control, DetectionBelief, Event, FaultBelief, Faults,
    Health, Journal, ParticleBlock, SensorFrame, Truth,
};
use vigil_cycle::port::TopicBlock;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Clock, Graph, Monotonic, PortError, Receiver, Topic, health};

use crate::ring::RingWriter;

/// Time between two particle blocks that are kept, ns: they are large, and a belief of each cycle
/// says the rest.
const PARTICLES_APART_NS: u64 = 1_000_000_000;
/// Silence of a service, which reports 20 times a second, after which it counts as gone, ns.
const SILENCE_NS: u64 = 2_000_000_000;
/// Time without a frame after which missed cycles are the publisher's, ns.
const FRAMELESS_NS: u64 = 200_000_000;

/// What a look has brought that may be the reason of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum News {
    /// A service reports an event.
    Event(ServiceName, Event),
    /// A service was replaced by a new process.
    Replaced(ServiceName),
    /// A service no longer reports.
    Silent(ServiceName),
}

/// One look at all topics.
struct Look<'a> {
    ring: &'a mut RingWriter,
    now_ns: u64,
    /// True if an alarm has risen: all that came is kept.
    is_alarm: bool,
}

/// One topic.
struct Feed<T: Block> {
    code: u16,
    receiver: Box<dyn Receiver<T>>,
    /// Blocks closer than this to the last one are passed over, ns.
    apart_ns: u64,
    kept_ns: u64,
    last: Option<BlockId>,
    lost: u64,
}

impl<T: TopicBlock> Feed<T> {
    fn open(graph: &Graph, topic: Topic, apart_ns: u64) -> Result<Self, PortError> {
        let code = Topic::ALL.iter().position(|of| *of == topic);
        Ok(Self {
            code: code.unwrap_or_default() as u16,
            receiver: graph.receiver(topic)?,
            apart_ns,
            kept_ns: 0,
            last: None,
            lost: 0,
        })
    }

    /// Puts what has come into the ring; `see` is shown each block that is kept.
    fn drain(&mut self, look: &mut Look<'_>, mut see: impl FnMut(&T)) -> io::Result<()> {
        for _ in 0..self.receiver.buffer() {
            let Some(block) = self.receiver.take_next() else {
                break;
            };
            let id = block.header().id();
            if let Some(last) = self.last.replace(id)
                && last.epoch == id.epoch
            {
                let between = id.seq.saturating_sub(last.seq).saturating_sub(1);
                self.lost = self.lost.saturating_add(between);
            }
            let is_early = self.kept_ns > 0 && look.now_ns < self.kept_ns + self.apart_ns;
            if is_early && !look.is_alarm {
                continue;
            }
            self.kept_ns = look.now_ns;
            let bytes = bytemuck::bytes_of(block);
            look.ring.push(self.code, look.now_ns, bytes)?;
            see(block);
        }
        Ok(())
    }
}

/// The Health of a service, and the events that it reports.
struct HealthFeed {
    service: ServiceName,
    feed: Feed<Health>,
    next_event: u64,
    epoch: u64,
    is_silent: bool,
}

impl HealthFeed {
    /// Puts what has come into the ring, and says what is new. Events before `began_ns` are old.
    fn drain(
        &mut self,
        look: &mut Look<'_>,
        began_ns: u64,
        news: &mut Vec<News>,
    ) -> io::Result<()> {
        let (service, next_event, epoch) = (self.service, &mut self.next_event, &mut self.epoch);
        self.feed.drain(look, |block| {
            let before = std::mem::replace(epoch, block.header.epoch);
            if before != *epoch {
                *next_event = 0;
                if before != 0 {
                    news.push(News::Replaced(service));
                }
            }
            health::new_events(block, next_event, |event| {
                if event.t_ns >= began_ns {
                    news.push(News::Event(service, *event));
                }
            });
        })?;
        let heard_ns = self.feed.kept_ns;
        let was_silent = self.is_silent;
        self.is_silent = heard_ns > 0 && look.now_ns > heard_ns + SILENCE_NS;
        if self.is_silent && !was_silent {
            news.push(News::Silent(service));
        }
        Ok(())
    }
}

/// Every topic of a graph.
pub struct Feeds {
    sensor: Feed<SensorFrame>,
    detection: Feed<DetectionBelief>,
    detection_particles: Feed<ParticleBlock>,
    diagnosis: Feed<FaultBelief>,
    diagnosis_particles: Feed<ParticleBlock>,
    faults: Feed<Faults>,
    action: Feed<Action>,
    truth: Feed<Truth>,
    health: Vec<HealthFeed>,
    control: Vec<Feed<Control>>,
    journals: Vec<Feed<Journal>>,
    checkpoints: Vec<Feed<CheckpointPart>>,
    began_ns: u64,
    /// True while the detector's alarm stands.
    is_alarm: bool,
}

impl Feeds {
    /// Opens every topic.
    ///
    /// # Errors
    /// The transport's.
    pub fn open(graph: &Graph) -> Result<Self, PortError> {
        let health = |service| {
            Ok(HealthFeed {
                service,
                feed: Feed::open(graph, Topic::Health(service), 0)?,
                next_event: 0,
                epoch: 0,
                is_silent: false,
            })
        };
        let controlled = [ServiceName::SensorSim, ServiceName::Supervisor];
        let control = |service| Feed::open(graph, Topic::Control(service), 0);
        let journal = |service| Feed::open(graph, Topic::Journal(service), 0);
        let checkpoint = |service| Feed::open(graph, Topic::Checkpoint(service), 0);
        let particles = |topic| Feed::open(graph, topic, PARTICLES_APART_NS);
        Ok(Self {
            sensor: Feed::open(graph, Topic::Sensor, 0)?,
            detection: Feed::open(graph, Topic::Detection, 0)?,
            detection_particles: particles(Topic::DetectionParticles)?,
            diagnosis: Feed::open(graph, Topic::Diagnosis, 0)?,
            diagnosis_particles: particles(Topic::DiagnosisParticles)?,
            faults: Feed::open(graph, Topic::Faults, 0)?,
            action: Feed::open(graph, Topic::Action, 0)?,
            truth: Feed::open(graph, Topic::Truth, 0)?,
            health: ServiceName::ALL
                .into_iter()
                .map(health)
                .collect::<Result<_, _>>()?,
            control: controlled
                .into_iter()
                .map(control)
                .collect::<Result<_, _>>()?,
            journals: ServiceName::STEPPING
                .into_iter()
                .map(journal)
                .collect::<Result<_, _>>()?,
            checkpoints: ServiceName::STEPPING
                .into_iter()
                .map(checkpoint)
                .collect::<Result<_, _>>()?,
            began_ns: Monotonic.now_ns(),
            is_alarm: false,
        })
    }

    /// Puts what has come into the ring, and says what is new.
    ///
    /// # Errors
    /// The ring's.
    pub fn drain(&mut self, ring: &mut RingWriter, news: &mut Vec<News>) -> io::Result<()> {
        let mut look = Look {
            ring,
            now_ns: Monotonic.now_ns(),
            is_alarm: false,
        };
        for health in &mut self.health {
            health.drain(&mut look, self.began_ns, news)?;
        }
        self.sensor.drain(&mut look, |_| {})?;
        // Before the particles, so that those at an alarm are kept.
        let (was_alarm, is_alarm) = (self.is_alarm, &mut self.is_alarm);
        self.detection
            .drain(&mut look, |belief| *is_alarm = belief.alarm != 0)?;
        look.is_alarm = self.is_alarm && !was_alarm;
        self.detection_particles.drain(&mut look, |_| {})?;
        self.diagnosis.drain(&mut look, |_| {})?;
        self.diagnosis_particles.drain(&mut look, |_| {})?;
        self.faults.drain(&mut look, |_| {})?;
        self.action.drain(&mut look, |_| {})?;
        self.truth.drain(&mut look, |_| {})?;
        for control in &mut self.control {
            control.drain(&mut look, |_| {})?;
        }
        for journal in &mut self.journals {
            journal.drain(&mut look, |_| {})?;
        }
        for checkpoint in &mut self.checkpoints {
            checkpoint.drain(&mut look, |_| {})?;
        }
        ring.commit()
    }

    /// True while frames come: else missed cycles are the publisher's.
    pub fn has_frames(&self) -> bool {
        Monotonic.now_ns() < self.sensor.kept_ns + FRAMELESS_NS
    }

    /// True if services were heard, and none is any more.
    pub fn is_deserted(&self) -> bool {
        let heard = || self.health.iter().filter(|health| health.epoch != 0);
        heard().count() > 0 && heard().all(|health| health.is_silent)
    }

    /// Blocks that came and were overwritten before they were taken.
    pub fn lost(&self) -> u64 {
        let health = self.health.iter().map(|health| health.feed.lost);
        let control = self.control.iter().map(|control| control.lost);
        let journals = self.journals.iter().map(|journal| journal.lost);
        let checkpoints = self.checkpoints.iter().map(|checkpoint| checkpoint.lost);
        let others = [
            self.sensor.lost,
            self.detection.lost,
            self.detection_particles.lost,
            self.diagnosis.lost,
            self.diagnosis_particles.lost,
            self.faults.lost,
            self.action.lost,
            self.truth.lost,
        ];
        let kept = journals.chain(checkpoints);
        let all = health.chain(control).chain(kept).chain(others);
        all.fold(0, u64::saturating_add)
    }
}

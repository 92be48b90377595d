//! What the black box hears: every topic of its graph.

use std::io;

use vigil_blocks::{
    Action, Block, Control, DetectionBelief, Event, FaultBelief, Faults, Health, ParticleBlock,
    SensorFrame, Truth,
};
use vigil_cycle::port::TopicBlock;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, PortError, Receiver, Topic, health};

use crate::ring::RingWriter;

/// Time between two particle blocks that are kept, ns: they are large, and a belief of each cycle
/// says the rest.
const PARTICLES_APART_NS: u64 = 1_000_000_000;

/// The topics, in the order of their codes in the ring.
pub const TOPICS: [Topic; 14] = [
    Topic::Sensor,
    Topic::Detection,
    Topic::DetectionParticles,
    Topic::Diagnosis,
    Topic::DiagnosisParticles,
    Topic::Faults,
    Topic::Action,
    Topic::Truth,
    Topic::Health(ServiceName::SensorSim),
    Topic::Health(ServiceName::Detector),
    Topic::Health(ServiceName::Identifier),
    Topic::Health(ServiceName::Supervisor),
    Topic::Control(ServiceName::SensorSim),
    Topic::Control(ServiceName::Supervisor),
];

/// What a turn has brought that may be the reason of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum News {
    /// A service reports an event.
    Event(ServiceName, Event),
    /// A service was replaced by a new process.
    Replaced(ServiceName),
}

/// One topic.
struct Feed<T: Block> {
    code: u16,
    receiver: Box<dyn Receiver<T>>,
    /// Blocks closer than this to the last one are passed over, ns.
    apart_ns: u64,
    kept_ns: u64,
    /// Epoch and number of the last block.
    last: Option<[u64; 2]>,
    lost: u64,
}

impl<T: TopicBlock> Feed<T> {
    fn open(graph: &Graph, topic: Topic, apart_ns: u64) -> Result<Self, PortError> {
        let code = TOPICS
            .iter()
            .position(|of| *of == topic)
            .unwrap_or_default();
        Ok(Self {
            code: code as u16,
            receiver: graph.receiver(topic)?,
            apart_ns,
            kept_ns: 0,
            last: None,
            lost: 0,
        })
    }

    /// Puts what has come into the ring; `look` sees each block that is kept.
    fn drain(&mut self, ring: &mut RingWriter, mut look: impl FnMut(&T)) -> io::Result<()> {
        for _ in 0..self.receiver.buffer() {
            let Some(block) = self.receiver.take_next() else {
                break;
            };
            let bytes = bytemuck::bytes_of(block);
            let header = *block.header();
            let (epoch, seq, now_ns) = (header.epoch, header.seq, header.t_publish_ns);
            if let Some([last_epoch, last_seq]) = self.last.replace([epoch, seq])
                && last_epoch == epoch
            {
                self.lost += seq.saturating_sub(last_seq + 1);
            }
            if self.kept_ns > 0 && now_ns < self.kept_ns + self.apart_ns {
                continue;
            }
            self.kept_ns = now_ns;
            ring.push(self.code, bytes)?;
            look(block);
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
            })
        };
        let controlled = [ServiceName::SensorSim, ServiceName::Supervisor];
        let control = |service| Feed::open(graph, Topic::Control(service), 0);
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
        })
    }

    /// Puts what has come into the ring, and says what is new.
    ///
    /// # Errors
    /// The ring's.
    pub fn drain(&mut self, ring: &mut RingWriter, news: &mut Vec<News>) -> io::Result<()> {
        for health in &mut self.health {
            let (service, next_event, epoch) =
                (health.service, &mut health.next_event, &mut health.epoch);
            health.feed.drain(ring, |block| {
                let before = std::mem::replace(epoch, block.header.epoch);
                if before != *epoch {
                    *next_event = 0;
                    if before != 0 {
                        news.push(News::Replaced(service));
                    }
                }
                health::new_events(block, next_event, |event| {
                    news.push(News::Event(service, *event));
                });
            })?;
        }
        self.sensor.drain(ring, |_| {})?;
        let is_alarm = |item: &News| matches!(item, News::Event(_, event) if is_alarm(event));
        if news.iter().any(is_alarm) {
            // The one at the alarm is kept, whenever the last was.
            self.detection_particles.kept_ns = 0;
            self.diagnosis_particles.kept_ns = 0;
        }
        self.detection.drain(ring, |_| {})?;
        self.detection_particles.drain(ring, |_| {})?;
        self.diagnosis.drain(ring, |_| {})?;
        self.diagnosis_particles.drain(ring, |_| {})?;
        self.faults.drain(ring, |_| {})?;
        self.action.drain(ring, |_| {})?;
        self.truth.drain(ring, |_| {})?;
        for control in &mut self.control {
            control.drain(ring, |_| {})?;
        }
        ring.commit()
    }

    /// Blocks that came and were overwritten before they were taken.
    pub fn lost(&self) -> u64 {
        let health = self.health.iter().map(|health| health.feed.lost);
        let control = self.control.iter().map(|control| control.lost);
        health.chain(control).sum::<u64>()
            + self.sensor.lost
            + self.detection.lost
            + self.detection_particles.lost
            + self.diagnosis.lost
            + self.diagnosis_particles.lost
            + self.faults.lost
            + self.action.lost
            + self.truth.lost
    }
}

/// True of an alarm.
pub fn is_alarm(event: &Event) -> bool {
    event.kind == vigil_blocks::EventKind::Alarm as u32
}

//! The monitors' counts in the live graph equal an independent recount from the blocks' stamps.

use std::collections::BTreeMap;
use std::fs;

use vigil_blocks::{Action, Cause, CauseKind, DetectionBelief, FaultBelief, Health, SensorFrame};
use vigil_cycle::port::TopicBlock;
use vigil_cycle::{Graph, Receiver, Topic};

use crate::harness::{HealthWatch, RunningGraph, config_with, drain, machine, unique};

/// Publication instants of the frame-caused blocks of a topic, by their scheduled instant.
struct Tap<T> {
    receiver: Box<dyn Receiver<T>>,
    cause: fn(&T) -> Option<Cause>,
    published_ns: BTreeMap<u64, u64>,
    next: Option<(u64, u64)>,
    lost: u64,
    anchor: Option<Health>,
}

impl<T: TopicBlock> Tap<T> {
    fn new(graph: &Graph, topic: Topic, cause: fn(&T) -> Option<Cause>) -> Self {
        let receiver = graph.receiver(topic).unwrap();
        Self {
            receiver,
            cause,
            published_ns: BTreeMap::new(),
            next: None,
            lost: 0,
            anchor: None,
        }
    }

    fn poll(&mut self) {
        let Self {
            receiver,
            cause,
            published_ns,
            next,
            lost,
            ..
        } = self;
        drain(receiver.as_mut(), |block: &T| {
            let header = *block.header();
            if let Some((epoch, seq)) = *next
                && epoch == header.epoch
            {
                *lost += header.seq - seq;
            }
            *next = Some((header.epoch, header.seq + 1));
            if cause(block).is_none_or(|c| c.kind() == Some(CauseKind::Frame)) {
                published_ns
                    .entry(header.t_schedule_ns)
                    .or_insert(header.t_publish_ns);
            }
        });
    }

    /// Keeps the first account of the service whose last instant this tap has seen: every later
    /// block is seen too.
    fn anchor(&mut self, health: Option<&Health>) {
        let (Some(health), Some((first_ns, _))) = (health, self.published_ns.first_key_value())
        else {
            return;
        };
        if self.anchor.is_none() && health.accounted_ns[1] >= *first_ns {
            self.anchor = Some(*health);
        }
    }

    /// Instants without a block in time, of those accounted after the anchor and up to `end`;
    /// and what the monitor says of them.
    fn recount(&self, end: &Health) -> (u64, u64) {
        let (anchor, period_ns) = (self.anchor.unwrap(), end.period_ns);
        let [first_ns, last_ns] = [anchor, *end].map(|health| health.accounted_ns[1]);
        let missed = (1..=(last_ns - first_ns + period_ns / 2) / period_ns)
            .map(|k| first_ns + k * period_ns)
            .filter(|at_ns| {
                let due_ns = at_ns + end.deadline_ns;
                self.published_ns
                    .get(at_ns)
                    .is_none_or(|&out_ns| out_ns > due_ns)
            })
            .count() as u64;
        (missed, end.missed - anchor.missed)
    }
}

#[test]
fn the_monitors_count_what_the_stamps_say() {
    let _machine = machine();
    // Long queues: this observer is an ordinary process and must not lose a block.
    let folder = std::env::temp_dir().join(unique("recount"));
    let path = config_with(&folder, |text| {
        format!("{text}\n[transport]\nbuffer = 256\nmax_subscribers = 6\n")
    });

    let mut graph =
        RunningGraph::start_with(path, "recount", &["--rate", "1000", "--duration", "8"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let mut sensor = Tap::<SensorFrame>::new(&observed, Topic::Sensor, |_| None);
    let mut detection = Tap::<DetectionBelief>::new(&observed, Topic::Detection, |b| Some(b.cause));
    let mut diagnosis = Tap::<FaultBelief>::new(&observed, Topic::Diagnosis, |b| Some(b.cause));
    let mut action = Tap::<Action>::new(&observed, Topic::Action, |b| Some(b.cause));
    while graph.is_alive() {
        // Health first: the taps then hold every block that it accounts for.
        let latest = health.poll();
        sensor.poll();
        sensor.anchor(latest.get("sensor-sim"));
        detection.poll();
        detection.anchor(latest.get("detector"));
        diagnosis.poll();
        diagnosis.anchor(latest.get("identifier"));
        action.poll();
        action.anchor(latest.get("supervisor"));
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(
        [sensor.lost, detection.lost, diagnosis.lost, action.lost],
        [0; 4]
    );
    let check = |name: &str, recount: &dyn Fn(&Health) -> (u64, u64)| {
        let end = &health.latest[name];
        let (counted, told) = recount(end);
        assert_eq!(told, counted, "{name}: monitor against recount");
        // Enough to count on; a slow machine leaves cycles out.
        assert!(end.cycles > 1000, "{name}: {} cycles", end.cycles);
    };
    check("sensor-sim", &|end| sensor.recount(end));
    check("detector", &|end| detection.recount(end));
    check("identifier", &|end| diagnosis.recount(end));
    check("supervisor", &|end| action.recount(end));
}

//! The monitors' counts in the live graph equal an independent recount from the blocks' stamps.

use std::collections::BTreeMap;
use std::fs;

use vigil_blocks::{Action, Block, Cause, CauseKind, DetectionBelief, FaultBelief, SensorFrame};
use vigil_cycle::{Graph, Receiver, Topic};

use crate::harness::{HealthWatch, Running, drain, machine, root, unique};

/// Publication instants of the frame-caused blocks of a topic, by their scheduled instant.
struct Tap<T> {
    receiver: Box<dyn Receiver<T>>,
    cause: fn(&T) -> Option<Cause>,
    published_ns: BTreeMap<u64, u64>,
    next: Option<(u64, u64)>,
    lost: u64,
}

impl<T: Block> Tap<T> {
    fn new(graph: &Graph, topic: Topic, cause: fn(&T) -> Option<Cause>) -> Self {
        let receiver = graph.receiver(topic).unwrap();
        Self {
            receiver,
            cause,
            published_ns: BTreeMap::new(),
            next: None,
            lost: 0,
        }
    }

    fn poll(&mut self) {
        let Self {
            receiver,
            cause,
            published_ns,
            next,
            lost,
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

    /// Instants from `first_ns` to `last_ns` without a block in time.
    fn recount(&self, [first_ns, last_ns]: [u64; 2], period_ns: u64, deadline_ns: u64) -> u64 {
        (0..=(last_ns - first_ns + period_ns / 2) / period_ns)
            .map(|k| first_ns + k * period_ns)
            .filter(|at_ns| {
                let due_ns = at_ns + deadline_ns;
                self.published_ns
                    .get(at_ns)
                    .is_none_or(|&out_ns| out_ns > due_ns)
            })
            .count() as u64
    }
}

#[test]
fn the_monitors_count_what_the_stamps_say() {
    let _machine = machine();
    // Long queues: this observer is an ordinary process and must not lose a block.
    let folder = std::env::temp_dir().join(unique("recount"));
    fs::create_dir_all(&folder).unwrap();
    let config = root().join("config");
    let text = fs::read_to_string(config.join("rover.toml")).unwrap();
    let absolute = |text: String, name: &str| {
        let path = config.join(name).display().to_string();
        text.replacen(&format!("\"{name}\""), &format!("\"{path}\""), 1)
    };
    let text = [
        "robots/rover.toml",
        "trees/rover.toml",
        "models/rover.toml",
        "rover.pomdp",
    ]
    .into_iter()
    .fold(text, absolute);
    let path = folder.join("rover.toml");
    fs::write(
        &path,
        format!("{text}\n[transport]\nbuffer = 256\nmax_subscribers = 4\n"),
    )
    .unwrap();

    let mut graph = Running::start_with(path, "recount", &["--rate", "1000", "--duration", "8"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    let mut sensor = Tap::<SensorFrame>::new(&observed, Topic::Sensor, |_| None);
    let mut detection = Tap::<DetectionBelief>::new(&observed, Topic::Detection, |b| Some(b.cause));
    let mut diagnosis = Tap::<FaultBelief>::new(&observed, Topic::Diagnosis, |b| Some(b.cause));
    let mut action = Tap::<Action>::new(&observed, Topic::Action, |b| Some(b.cause));
    while graph.is_alive() {
        // Health first: the taps then hold every block that it accounts for.
        health.poll();
        sensor.poll();
        detection.poll();
        diagnosis.poll();
        action.poll();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(
        [sensor.lost, detection.lost, diagnosis.lost, action.lost],
        [0; 4]
    );
    let check = |name: &str, recount: &dyn Fn([u64; 2], u64, u64) -> u64| {
        let h = health.latest[name];
        let counted = recount(h.accounted_ns, h.period_ns, h.deadline_ns);
        assert_eq!(h.missed, counted, "{name}: monitor against recount");
        assert!(h.cycles > 6000, "{name}: {} cycles", h.cycles);
    };
    check("sensor-sim", &|window, p, d| sensor.recount(window, p, d));
    check("detector", &|window, p, d| detection.recount(window, p, d));
    check("identifier", &|window, p, d| {
        diagnosis.recount(window, p, d)
    });
    check("supervisor", &|window, p, d| action.recount(window, p, d));
}

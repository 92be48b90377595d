//! The four-stage chain under the virtual clock: delays injected into any stage are reported
//! exactly, by the monitors and by an independent recount from the blocks' stamps.

use std::cell::Cell;
use std::rc::Rc;

use vigil_blocks::{
    Action, BlockId, Cause, CauseKind, DetectionBelief, FaultBelief, Header, Health, SensorFrame,
};
use vigil_cycle::placement::{Placement, PlacementRequest};
use vigil_cycle::port::Bus;
use vigil_cycle::port::TopicBlock;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, CycleAccount, DeadlineMonitor, Graph, HealthBoard, Intake, PortError, Receiver,
    Recorder, Schedule, Sender, Source, SourceCycle, SourceOutcome, Stage, StageCycle, Stamp,
    Topic, VirtualClock,
};

const PERIOD_NS: u64 = 1_000_000;
const BUDGET_NS: u64 = 300_000;
const DEADLINES_NS: [u64; 4] = [200_000, 500_000, 750_000, 950_000];
/// The cycle into which a delay is injected.
const DELAYED: u64 = 20;
const CYCLES: u64 = 60;

/// A delay for the step of one cycle: (scheduled instant, compute time), ns.
type Delay = Rc<Cell<Option<(u64, u64)>>>;

/// The compute time of the cycle scheduled at `t_schedule_ns`.
fn compute_ns(delay: &Delay, t_schedule_ns: u64) -> u64 {
    delay
        .get()
        .filter(|&(at, _)| at == t_schedule_ns)
        .map_or(0, |(_, ns)| ns)
}

/// A block that says which frame it comes from.
trait Caused: TopicBlock {
    fn cause(&mut self) -> &mut Cause;
}

macro_rules! caused {
    ($($block:ty),*) => { $(impl Caused for $block {
        fn cause(&mut self) -> &mut Cause { &mut self.cause }
    })* };
}
caused!(DetectionBelief, FaultBelief, Action);

/// Passes on what it gets, after the injected delay.
struct Relay<I: TopicBlock, O: Caused> {
    input: Box<dyn Receiver<I>>,
    output: Box<dyn Sender<O>>,
    identity: fn(&I) -> Option<BlockId>,
    clock: VirtualClock,
    delay: Delay,
}

impl<I: TopicBlock, O: Caused> Stage for Relay<I, O> {
    fn take(&mut self, intake: &mut Intake<'_>) {
        for _ in 0..self.input.buffer() {
            let Some(block) = self.input.take_next() else {
                break;
            };
            let identity = (self.identity)(block);
            if let (true, Some(identity)) = (intake.accept::<I>(block.header()), identity) {
                self.clock
                    .advance(compute_ns(&self.delay, block.header().t_schedule_ns));
                intake.stepped(block.header(), identity);
            }
        }
    }

    fn miss(&mut self, _count: u32) {}

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        *self.output.block().cause() = cause;
        self.output.send(stamp, clock)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.output.prepare()
    }

    fn after(&mut self, _health: &mut HealthBoard, _now_ns: u64) {}
}

struct Sensor {
    output: Box<dyn Sender<SensorFrame>>,
    clock: VirtualClock,
    delay: Delay,
}

impl Source for Sensor {
    fn produce(
        &mut self,
        t_schedule_ns: u64,
        clock: &dyn Clock,
    ) -> Result<SourceOutcome, PortError> {
        self.clock.advance(compute_ns(&self.delay, t_schedule_ns));
        let stamp = Stamp {
            t_schedule_ns,
            t_capture_ns: t_schedule_ns,
        };
        self.output.send(stamp, clock).map(SourceOutcome::Frame)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.output.prepare()
    }

    fn after(&mut self, _health: &mut HealthBoard, _now_ns: u64) {}
}

fn from_cause(cause: &Cause) -> Option<BlockId> {
    (cause.kind() == Some(CauseKind::Frame)).then_some(cause.frame())
}

/// Stamps of every frame-caused block on a topic: (schedule, publication).
struct Tap<T> {
    receiver: Box<dyn Receiver<T>>,
    is_frame: fn(&T) -> bool,
    seen: Vec<(u64, u64)>,
}

impl<T: TopicBlock> Tap<T> {
    fn new(graph: &Graph, topic: Topic, is_frame: fn(&T) -> bool) -> Self {
        Self {
            receiver: graph.receiver(topic).unwrap(),
            is_frame,
            seen: Vec::new(),
        }
    }

    fn drain(&mut self) {
        while let Some(block) = self.receiver.take_next() {
            if (self.is_frame)(block) {
                let Header {
                    t_schedule_ns,
                    t_publish_ns,
                    ..
                } = *block.header();
                self.seen.push((t_schedule_ns, t_publish_ns));
            }
        }
    }

    /// Instants of the schedule without a block in time.
    fn recount(&self, deadline_ns: u64, first: u64, last: u64) -> u64 {
        (first..=last)
            .filter(|k| {
                let due_ns = k * PERIOD_NS + deadline_ns;
                !self
                    .seen
                    .iter()
                    .any(|&(s, p)| s == k * PERIOD_NS && p <= due_ns)
            })
            .count() as u64
    }
}

struct World {
    clock: VirtualClock,
    source: SourceCycle,
    sensor: Sensor,
    detector: (StageCycle, Relay<SensorFrame, DetectionBelief>),
    identifier: (StageCycle, Relay<DetectionBelief, FaultBelief>),
    supervisor: (StageCycle, Relay<FaultBelief, Action>),
    taps: (
        Tap<SensorFrame>,
        Tap<DetectionBelief>,
        Tap<FaultBelief>,
        Tap<Action>,
    ),
    delays: [Delay; 4],
    free_ns: [u64; 4],
}

fn board(graph: &Graph, service: ServiceName) -> HealthBoard {
    let placement = Placement {
        core: 0,
        pinned: false,
        policy: 0,
        priority: 0,
        memory_locked: false,
    };
    let wanted = PlacementRequest {
        core: 0,
        priority: 1,
    };
    let sender = graph.sender(Topic::Health(service)).unwrap();
    HealthBoard::new(sender, schedule(service), wanted, placement)
}

fn schedule(service: ServiceName) -> Schedule {
    Schedule {
        period_ns: PERIOD_NS,
        deadline_ns: DEADLINES_NS[service.index()],
        budget_ns: BUDGET_NS,
    }
}

fn account(graph: &Graph, service: ServiceName) -> CycleAccount {
    CycleAccount::new(
        DeadlineMonitor::new(schedule(service)),
        board(graph, service),
        Recorder::new().unwrap(),
    )
}

fn stage<I: TopicBlock, O: Caused>(
    graph: &Graph,
    (service, input, output): (ServiceName, Topic, Topic),
    identity: fn(&I) -> Option<BlockId>,
    (clock, delay): (&VirtualClock, &Delay),
) -> (StageCycle, Relay<I, O>) {
    let cycle = StageCycle::new(account(graph, service));
    let relay = Relay {
        input: graph.receiver(input).unwrap(),
        output: graph.sender(output).unwrap(),
        identity,
        clock: clock.clone(),
        delay: Rc::clone(delay),
    };
    (cycle, relay)
}

impl World {
    fn new() -> Self {
        use ServiceName::{Detector, Identifier, SensorSim, Supervisor};
        let clock = VirtualClock::default();
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let delays: [Delay; 4] = Default::default();
        let sensor = Sensor {
            output: graph.sender(Topic::Sensor).unwrap(),
            clock: clock.clone(),
            delay: Rc::clone(&delays[0]),
        };
        let frame = |f: &SensorFrame| Some(f.header.id());
        Self {
            source: SourceCycle::new(account(&graph, SensorSim), PERIOD_NS),
            sensor,
            detector: stage(
                &graph,
                (Detector, Topic::Sensor, Topic::Detection),
                frame,
                (&clock, &delays[1]),
            ),
            identifier: stage(
                &graph,
                (Identifier, Topic::Detection, Topic::Diagnosis),
                |d: &DetectionBelief| from_cause(&d.cause),
                (&clock, &delays[2]),
            ),
            supervisor: stage(
                &graph,
                (Supervisor, Topic::Diagnosis, Topic::Action),
                |d: &FaultBelief| from_cause(&d.cause),
                (&clock, &delays[3]),
            ),
            taps: (
                Tap::new(&graph, Topic::Sensor, |_| true),
                Tap::new(&graph, Topic::Detection, |b| from_cause(&b.cause).is_some()),
                Tap::new(&graph, Topic::Diagnosis, |b| from_cause(&b.cause).is_some()),
                Tap::new(&graph, Topic::Action, |b| from_cause(&b.cause).is_some()),
            ),
            delays,
            clock,
            free_ns: [0; 4],
        }
    }

    /// One turn of service `i`, beginning at `at_ns`.
    fn turn(&mut self, i: usize, at_ns: u64) {
        self.clock.set(at_ns);
        let flow = match i {
            0 => self.source.turn(&mut self.sensor, &self.clock),
            1 => self.detector.0.turn(&mut self.detector.1, &self.clock),
            2 => self.identifier.0.turn(&mut self.identifier.1, &self.clock),
            _ => self.supervisor.0.turn(&mut self.supervisor.1, &self.clock),
        }
        .unwrap();
        assert!(flow.is_continue());
        self.free_ns[i] = self.clock.now_ns();
    }

    /// Runs until the schedule of the last cycle is over. Services run side by side: the turn
    /// that begins first is simulated first, and woken services take their turn in the order of
    /// the data.
    fn run(&mut self) {
        let end_ns = (CYCLES + 1) * PERIOD_NS - 1;
        let mut waiting_ns: [Vec<u64>; 4] = Default::default();
        loop {
            let due_ns = [
                self.source.next_wake_ns(),
                self.detector.0.next_wake_ns(),
                self.identifier.0.next_wake_ns(),
                self.supervisor.0.next_wake_ns(),
            ];
            let start = |i: usize| {
                let input_ns = i.checked_sub(1).and_then(|up| waiting_ns[up].iter().min());
                due_ns[i]
                    .min(input_ns.copied().unwrap_or(u64::MAX))
                    .max(self.free_ns[i])
            };
            let (at_ns, i) = (0..4).map(|i| (start(i), i)).min().unwrap();
            if at_ns > end_ns {
                return;
            }
            if let Some(up) = i.checked_sub(1) {
                waiting_ns[up].retain(|&ns| ns > at_ns);
            }
            let before = self.outputs()[i];
            self.turn(i, at_ns);
            self.drain_taps();
            if self.outputs()[i] != before {
                waiting_ns[i].push(self.free_ns[i]);
            }
        }
    }

    fn outputs(&self) -> [u64; 4] {
        [
            self.sensor.output.next_seq(),
            self.detector.1.output.next_seq(),
            self.identifier.1.output.next_seq(),
            self.supervisor.1.output.next_seq(),
        ]
    }

    fn health(&self) -> [&Health; 4] {
        [
            self.source.account().health().view(),
            self.detector.0.account().health().view(),
            self.identifier.0.account().health().view(),
            self.supervisor.0.account().health().view(),
        ]
    }

    fn missed(&self) -> [u64; 4] {
        self.health().map(|health| health.missed)
    }

    fn drain_taps(&mut self) {
        self.taps.0.drain();
        self.taps.1.drain();
        self.taps.2.drain();
        self.taps.3.drain();
    }

    fn recount(&mut self) -> [u64; 4] {
        self.clock.set(u64::MAX);
        self.drain_taps();
        [
            self.taps.0.recount(DEADLINES_NS[0], 1, CYCLES),
            self.taps.1.recount(DEADLINES_NS[1], 1, CYCLES),
            self.taps.2.recount(DEADLINES_NS[2], 1, CYCLES),
            self.taps.3.recount(DEADLINES_NS[3], 1, CYCLES),
        ]
    }
}

/// Instants k + m that a delay of `delay_ns` in cycle k makes late: those due before it is over.
fn expected_misses(delay_ns: u64, deadline_ns: u64) -> u64 {
    (0..10)
        .filter(|m| delay_ns > m * PERIOD_NS + deadline_ns)
        .count() as u64
}

#[test]
fn without_delays_nothing_is_missed() {
    let mut world = World::new();
    world.run();
    assert_eq!(world.missed(), [0; 4]);
    assert_eq!(world.outputs(), [CYCLES; 4]);
}

#[test]
fn injected_delays_are_reported_exactly_in_every_stage() {
    for (delayed, deadline_ns) in DEADLINES_NS.into_iter().enumerate() {
        for tenths in [5, 9, 10, 11, 15, 20, 25, 30] {
            let delay_ns = deadline_ns * tenths / 10;
            let mut world = World::new();
            world.delays[delayed].set(Some((DELAYED * PERIOD_NS, delay_ns)));
            world.run();
            let expected: [u64; 4] = std::array::from_fn(|i| {
                if i < delayed {
                    0
                } else {
                    expected_misses(delay_ns, DEADLINES_NS[i])
                }
            });
            let case = format!("stage {delayed}, delay {delay_ns} ns");
            assert_eq!(world.missed(), expected, "monitors: {case}");
            assert_eq!(world.recount(), expected, "recount: {case}");
        }
    }
}

#[test]
fn a_stall_shows_in_the_latencies_of_every_cycle_that_it_delayed() {
    let mut world = World::new();
    let stall_ns = 5 * PERIOD_NS + PERIOD_NS / 2;
    world.delays[2].set(Some((DELAYED * PERIOD_NS, stall_ns)));
    world.run();
    let end_to_end = world
        .supervisor
        .0
        .account()
        .recorder()
        .timing
        .from_schedule
        .percentiles();
    assert_eq!((end_to_end.n, end_to_end.max_ns), (CYCLES, stall_ns));
    let late = world
        .supervisor
        .0
        .account()
        .recorder()
        .timing
        .from_schedule
        .histogram();
    // Six cycles waited: 5.5, 4.5, ... 0.5 periods.
    assert_eq!(late.count_between(PERIOD_NS / 4, u64::MAX / 2), 6);
}

#[test]
fn a_cycle_over_its_budget_is_counted_once_and_only_in_its_stage() {
    for (delayed, over) in [(BUDGET_NS, 0), (BUDGET_NS + 1, 1)] {
        for stage in 0..4 {
            let mut world = World::new();
            world.delays[stage].set(Some((DELAYED * PERIOD_NS, delayed)));
            world.run();
            let counted = world.health().map(|health| health.over_budget);
            let expected: [u64; 4] = std::array::from_fn(|i| u64::from(i == stage) * over);
            assert_eq!(counted, expected, "stage {stage}, {delayed} ns");
        }
    }
}

#[test]
fn a_silent_sensor_is_counted_by_every_stage_and_told_at_once() {
    let mut world = World::new();
    world.delays[0].set(Some((DELAYED * PERIOD_NS, 1_000 * PERIOD_NS)));
    world.run();
    let silent = CYCLES - DELAYED;
    for cycle in [&world.detector.0, &world.identifier.0, &world.supervisor.0] {
        let health = cycle.account().health().view();
        assert_eq!(health.missed, silent + 1);
        assert_eq!(health.degraded, 1);
    }
}

//! What a stage does about a missed deadline is what its configuration says, and the time that a
//! stage has decides its number of particles; under the virtual clock.

use std::ops::ControlFlow;

use vigil_blocks::{Action, Cause, CauseKind, Degraded, EventKind, Health, SensorFrame};
use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::port::Bus;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, CycleAccount, DeadlineMonitor, Graph, HealthBoard, Intake, OnMiss, PortError, Receiver,
    Recorder, Schedule, Sender, Shedder, Stage, StageCycle, Stamp, Topic, VirtualClock,
};

const PERIOD_NS: u64 = 1_000_000;
const SCHEDULE: Schedule = Schedule {
    period_ns: PERIOD_NS,
    deadline_ns: 400_000,
    budget_ns: 300_000,
};

/// Takes `ns_a_particle` for each of its particles.
struct Worker {
    input: Box<dyn Receiver<SensorFrame>>,
    output: Box<dyn Sender<Action>>,
    clock: VirtualClock,
    particles: u32,
    ns_a_particle: u64,
    predictions: u32,
    /// Once: the source goes on for so many periods while this one is held up in its turn.
    held_up: Option<(Box<dyn Sender<SensorFrame>>, u64)>,
}

impl Stage for Worker {
    fn take(&mut self, intake: &mut Intake<'_>) {
        while let Some(frame) = self.input.take_next() {
            let header = frame.header;
            if intake.accept::<SensorFrame>(&header) {
                self.clock
                    .advance(self.ns_a_particle * u64::from(self.particles));
                intake.stepped(&header, header.id());
            }
            if let Some((mut sensor, periods)) = self.held_up.take() {
                for _ in 0..periods {
                    self.clock.advance(PERIOD_NS);
                    let stamp = Stamp {
                        t_schedule_ns: self.clock.now_ns(),
                        t_capture_ns: self.clock.now_ns(),
                    };
                    sensor.send(stamp, &self.clock).unwrap();
                }
            }
        }
    }

    fn miss(&mut self, count: u32) {
        self.predictions += count;
    }

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        self.output.block().cause = cause;
        self.output.send(stamp, clock)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.output.prepare()
    }

    fn particles(&self) -> u32 {
        1000
    }

    fn limit(&mut self, particles: u32) {
        self.particles = particles;
    }

    fn has_input(&self) -> bool {
        self.input.is_waiting()
    }

    fn after(&mut self, _health: &mut HealthBoard, _now_ns: u64) {}
}

struct World {
    graph: Graph,
    clock: VirtualClock,
    sensor: Box<dyn Sender<SensorFrame>>,
    actions: Box<dyn Receiver<Action>>,
    cycle: StageCycle,
    worker: Worker,
    k: u64,
}

impl World {
    fn new(on_miss: OnMiss) -> Self {
        let clock = VirtualClock::default();
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let wanted = PlacementRequest {
            core: 0,
            priority: 1,
        };
        let sender = graph.sender(Topic::Health(ServiceName::Detector)).unwrap();
        let board = HealthBoard::new(sender, SCHEDULE, wanted, read_back(0));
        let recorder = Recorder::new().unwrap().with_stamps(8);
        let account = CycleAccount::new(DeadlineMonitor::new(SCHEDULE), board, recorder)
            .with_on_miss(on_miss);
        Self {
            sensor: graph.sender(Topic::Sensor).unwrap(),
            actions: graph.receiver(Topic::Action).unwrap(),
            worker: Worker {
                input: graph.receiver(Topic::Sensor).unwrap(),
                output: graph.sender(Topic::Action).unwrap(),
                clock: clock.clone(),
                particles: 1000,
                ns_a_particle: 10,
                predictions: 0,
                held_up: None,
            },
            cycle: StageCycle::new(account).with_shedder(Shedder::new(1000, SCHEDULE)),
            graph,
            clock,
            k: 0,
        }
    }

    /// The next instant, with a frame or without; without, the deadline passes.
    fn instant(&mut self, has_frame: bool) -> ControlFlow<()> {
        self.k += 1;
        self.clock.set(self.k * PERIOD_NS);
        if has_frame {
            let stamp = Stamp {
                t_schedule_ns: self.k * PERIOD_NS,
                t_capture_ns: self.k * PERIOD_NS,
            };
            self.sensor.send(stamp, &self.clock).unwrap();
            assert!(self.worker.has_input());
        } else {
            assert!(!self.worker.has_input());
            self.clock.advance(SCHEDULE.deadline_ns + 1);
        }
        self.cycle.turn(&mut self.worker, &self.clock).unwrap()
    }

    /// Kinds of the blocks that went out.
    fn published(&mut self) -> Vec<CauseKind> {
        let mut kinds = Vec::new();
        while let Some(action) = self.actions.take_next() {
            kinds.extend(action.cause.kind());
        }
        kinds
    }

    fn health(&self) -> &Health {
        self.cycle.account().health().view()
    }
}

#[test]
fn each_answer_publishes_and_says_what_it_is_to() {
    use CauseKind::{Frame, Missed};
    let cases = [
        (OnMiss::Count, vec![Frame, Frame], 0, false),
        (OnMiss::Predict, vec![Frame, Missed, Frame], 0, false),
        (
            OnMiss::Degrade,
            vec![Frame, Missed, Frame],
            Degraded::LATE,
            false,
        ),
        (OnMiss::Stop, vec![Frame, Frame], 0, true),
    ];
    for (on_miss, published, degraded, ends) in cases {
        let mut world = World::new(on_miss);
        assert!(world.instant(true).is_continue());
        assert_eq!(world.instant(false).is_break(), ends, "{on_miss:?}");
        assert!(world.instant(true).is_continue());
        assert_eq!(world.published(), published, "{on_miss:?}");
        assert_eq!(world.health().missed, 1, "{on_miss:?}");
        assert_eq!(world.health().degraded, degraded, "{on_miss:?}");
        let predictions = u32::from(on_miss.predicts());
        assert_eq!(world.worker.predictions, predictions, "{on_miss:?}");
        // A prediction is no cycle: it has no stamps of its own.
        assert_eq!(
            world
                .cycle
                .account()
                .recorder()
                .stamps()
                .unwrap()
                .iter()
                .count(),
            2
        );
    }
}

#[test]
fn lateness_ends_after_a_hundred_cycles_in_time() {
    let mut world = World::new(OnMiss::Degrade);
    assert!(world.instant(true).is_continue());
    assert!(world.instant(false).is_continue());
    for _ in 0..99 {
        assert!(world.instant(true).is_continue());
        assert_eq!(world.health().degraded, Degraded::LATE);
    }
    assert!(world.instant(true).is_continue());
    assert_eq!(world.health().degraded, 0);
    let told = world.health().events.iter();
    let told = told.filter(|e| e.kind == EventKind::Degraded as u32);
    assert_eq!(told.count(), 2);
}

#[test]
fn particles_are_shed_before_a_deadline_is_missed_and_that_is_told() {
    let mut world = World::new(OnMiss::Predict);
    world.worker.ns_a_particle = 250; // 83 % of the budget, 63 % of the deadline.
    for _ in 0..50 {
        assert!(world.instant(true).is_continue());
    }
    assert_eq!((world.health().missed, world.health().over_budget), (0, 0));
    assert_eq!(world.worker.particles, 600, "half the budget");
    let health = world.health();
    assert_eq!((health.particles, health.particles_configured), (600, 1000));
    assert_eq!(health.degraded, Degraded::FEWER_PARTICLES);
    world.worker.ns_a_particle = 100;
    for _ in 0..9000 {
        assert!(world.instant(true).is_continue());
    }
    assert_eq!(
        (world.health().particles, world.health().degraded),
        (1000, 0)
    );
    assert_eq!(world.worker.particles, 1000);
}

#[test]
fn what_came_while_a_stage_was_held_up_in_its_turn_is_taken_in_that_turn() {
    let mut world = World::new(OnMiss::Count);
    assert!(world.instant(true).is_continue());
    world.worker.held_up = Some((world.graph.sender(Topic::Sensor).unwrap(), 6));
    assert!(world.instant(true).is_continue());
    let mut answered_ns = 0;
    while let Some(action) = world.actions.take_next() {
        answered_ns = action.header.t_schedule_ns;
    }
    // The first of the turn took 10 us before the others came.
    assert_eq!(answered_ns, 8 * PERIOD_NS + 10_000);
    let health = world.health();
    assert_eq!((health.cycles, health.lost, health.invalid), (2, 0, 0));
    // With their deadlines, the seven instants of that turn but the last were missed.
    assert_eq!(health.missed, 6);
}

#[test]
fn input_is_expected_a_period_after_the_last_and_not_while_it_is_lost() {
    let mut world = World::new(OnMiss::Predict);
    assert_eq!(world.cycle.expected_input_ns(), None);
    assert!(world.instant(true).is_continue());
    assert_eq!(world.cycle.expected_input_ns(), Some(2 * PERIOD_NS));
    assert!(world.instant(false).is_continue());
    assert_eq!(world.cycle.expected_input_ns(), None);
}

#[test]
fn a_wake_up_for_nothing_makes_deaf_until_shortly_before_the_next_input() {
    let mut world = World::new(OnMiss::Predict);
    let pause_ns = PERIOD_NS / 32;
    // Nothing is known yet: a breath, and never past the time at which something is due.
    world.clock.set(500_000);
    let next_ns = world.cycle.next_wake_ns();
    let expected_ns = (500_000 + pause_ns).min(next_ns);
    assert_eq!(world.cycle.listens_again_ns(500_000), expected_ns);
    world.k = 99;
    assert!(world.instant(true).is_continue());
    let now_ns = world.clock.now_ns();
    assert_eq!(
        world.cycle.listens_again_ns(now_ns),
        101 * PERIOD_NS - PERIOD_NS / 16
    );
    // The input is late: a breath at a time.
    let late_ns = 101 * PERIOD_NS + 10_000;
    assert_eq!(world.cycle.listens_again_ns(late_ns), late_ns + pause_ns);
    // And never past the deadline.
    let close_ns = world.cycle.next_wake_ns() - 10;
    assert_eq!(world.cycle.listens_again_ns(close_ns), close_ns + 10);
}

//! No input fires an assertion: blocks that lie, clocks that jump in capture time, and full queues
//! drive a whole stage, a source and the watchdog.

use std::ops::ControlFlow;

use proptest::prelude::*;
use vigil_blocks::{Action, Block, BlockId, Cause, Header, Health, Rejection, SensorFrame};
use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::port::Bus;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::watchdog::Settings;
use vigil_cycle::{
    Clock, CycleAccount, DeadlineMonitor, Graph, HealthBoard, InputAccount, Intake, OnMiss,
    PortError, Recorder, Schedule, Sender, Shedder, Source, SourceCycle, SourceOutcome, Stage,
    StageCycle, Stamp, Topic, VirtualClock, Watchdog, Writer,
};

const START_NS: u64 = 60_000_000_000;
const SCHEDULE: Schedule = Schedule {
    period_ns: 1_000_000,
    deadline_ns: 750_000,
    budget_ns: 300_000,
};

/// Any number, and those at which something changes.
fn any_ns() -> impl Strategy<Value = u64> {
    prop_oneof![
        6 => START_NS..START_NS + 200_000_000,
        1 => Just(0),
        1 => Just(u64::MAX),
        1 => any::<u64>(),
    ]
}

/// A block as a liar may send it; its schedule is relative to the receiver's clock, or anything.
#[derive(Debug, Clone)]
struct Lie {
    header: Header,
    due_after_ns: Option<i64>,
    frame: BlockId,
    content: Result<(), Rejection>,
    compute_ns: u64,
}

fn lie() -> impl Strategy<Value = Lie> {
    let schema = prop_oneof![9 => Just(SensorFrame::SCHEMA), 1 => any::<u64>()];
    let epoch = prop_oneof![6 => Just(1_u64), 2 => 0..4_u64, 1 => any::<u64>()];
    let seq = prop_oneof![6 => 0..40_u64, 1 => any::<u64>(), 1 => Just(u64::MAX)];
    let due = prop_oneof![
        6 => (-20_000_000..3_000_000_i64).prop_map(Some),
        1 => (-10_000_000_000..0_i64).prop_map(Some),
        1 => Just(None),
    ];
    let content = prop_oneof![8 => Just(Ok(())), 1 => Just(Err(Rejection::NotFinite))];
    let compute_ns = prop_oneof![6 => 0..400_000_u64, 1 => 0..5_000_000_000_u64];
    let header = (schema, epoch, seq, any_ns(), any_ns(), any_ns());
    (header, due, any::<(u64, u64)>(), content, compute_ns).prop_map(
        |(
            (schema, epoch, seq, t_schedule_ns, t_capture_ns, t_publish_ns),
            due,
            frame,
            content,
            compute_ns,
        )| {
            Lie {
                header: Header {
                    schema,
                    epoch,
                    seq,
                    t_schedule_ns,
                    t_capture_ns,
                    t_publish_ns,
                },
                due_after_ns: due,
                frame: BlockId {
                    epoch: frame.0,
                    seq: frame.1,
                },
                content,
                compute_ns,
            }
        },
    )
}

/// One turn of the cycle: how long nothing happened before it, and what lies in the queue then.
fn turns() -> impl Strategy<Value = Vec<(u64, Vec<Lie>)>> {
    let idle_ns = prop_oneof![
        8 => 0..2_000_000_u64,
        1 => 0..200_000_000_u64,
        1 => 0..20_000_000_000_u64,
    ];
    let queue = prop_oneof![8 => prop::collection::vec(lie(), 0..4),
                            1 => prop::collection::vec(lie(), 0..40)];
    prop::collection::vec((idle_ns, queue), 1..60)
}

/// Steps whatever is taken.
struct Worker {
    queue: Vec<Lie>,
    further: InputAccount,
    clock: VirtualClock,
    output: Box<dyn Sender<Action>>,
    allowed: u32,
}

impl Stage for Worker {
    fn take(&mut self, intake: &mut Intake<'_>) {
        for lie in std::mem::take(&mut self.queue) {
            let mut header = lie.header;
            if let Some(due_after_ns) = lie.due_after_ns {
                header.t_schedule_ns = intake.now_ns().saturating_add_signed(due_after_ns);
            }
            intake.admit_further::<SensorFrame>(&mut self.further, &header, || lie.content);
            if intake.admit::<SensorFrame>(&header, || lie.content) {
                self.clock.advance(lie.compute_ns);
                intake.stepped(&header, lie.frame);
            } else if lie.content.is_err() {
                intake.reject(Rejection::Corrupt);
                intake.count(Rejection::OtherWriter);
            }
        }
    }

    fn miss(&mut self, _count: u32) {}

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

    fn particles_in_use(&self) -> u32 {
        self.allowed
    }

    fn limit(&mut self, particles: u32) {
        self.allowed = particles;
    }

    fn after(&mut self, health: &mut HealthBoard, _now_ns: u64) {
        health.add_input(&self.further);
    }
}

fn account(graph: &Graph, on_miss: OnMiss) -> CycleAccount {
    let wanted = PlacementRequest {
        core: 0,
        priority: 0,
    };
    let sender = graph.sender(Topic::Health(ServiceName::Detector)).unwrap();
    let board = HealthBoard::new(sender, SCHEDULE, wanted, read_back(0));
    let recorder = Recorder::new().unwrap().with_stamps(4);
    CycleAccount::new(DeadlineMonitor::new(SCHEDULE), board, recorder).with_on_miss(on_miss)
}

fn answers() -> impl Strategy<Value = OnMiss> {
    prop::sample::select(vec![OnMiss::Count, OnMiss::Predict, OnMiss::Degrade])
}

proptest! {
    #[test]
    fn no_block_fires_an_assertion_of_a_stage(
        writer in prop::sample::select(vec![Writer::Service, Writer::Publisher, Writer::Socket]),
        on_miss in answers(),
        turns in turns(),
    ) {
        let clock = VirtualClock::default();
        clock.set(START_NS);
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let mut cycle = StageCycle::new(account(&graph, on_miss))
            .with_input_of(writer)
            .with_shedder(Shedder::new(1000, SCHEDULE));
        let mut worker = Worker {
            queue: Vec::new(),
            further: InputAccount::new(writer),
            clock: clock.clone(),
            output: graph.sender(Topic::Action).unwrap(),
            allowed: 1000,
        };
        cycle.account_mut().ready(&clock).unwrap();
        for (idle_ns, queue) in turns {
            clock.advance(idle_ns);
            worker.queue = queue;
            let next = cycle.turn(&mut worker, &clock).unwrap();
            prop_assert_eq!(next, ControlFlow::Continue(()));
            let listens_ns = cycle.listens_again_ns(clock.now_ns());
            prop_assert!(listens_ns <= cycle.next_wake_ns());
        }
        let (health, recorder) = (cycle.account().health().view(), cycle.account().recorder());
        prop_assert_eq!(recorder.timing.step.percentiles().n, health.cycles);
        cycle.account_mut().stop(&clock).unwrap();
    }

    #[test]
    fn no_delay_fires_an_assertion_of_a_source(
        on_miss in answers(),
        turns in prop::collection::vec((0..5_000_000_000_u64, 0..3_000_000_u64, 0..10_u8), 1..60),
    ) {
        let clock = VirtualClock::default();
        clock.set(START_NS);
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let mut cycle = SourceCycle::new(account(&graph, on_miss), START_NS);
        let mut source = Producer {
            output: graph.sender(Topic::Sensor).unwrap(),
            clock: clock.clone(),
            compute_ns: 0,
            outcome: 0,
        };
        for (idle_ns, compute_ns, outcome) in turns {
            // Most turns come in time.
            clock.advance(if outcome < 8 { idle_ns % 2_000_000 } else { idle_ns });
            (source.compute_ns, source.outcome) = (compute_ns, outcome);
            prop_assert!(cycle.turn(&mut source, &clock).unwrap().is_continue());
        }
    }

    #[test]
    fn no_report_fires_an_assertion_of_the_watchdog(
        reports in prop::collection::vec(
            (0..400_000_000_u64, 0..5_usize, any::<[u64; 6]>(), any::<[u32; 2]>(), 0..8_u8),
            1..200,
        ),
    ) {
        let settings = Settings {
            startup_s: 1.0,
            alive_s: 0.5,
            logical_s: 0.4,
            deadline_percent: 50.0,
        };
        let mut watchdog = Watchdog::new(&settings, 4, START_NS);
        let mut now_ns = START_NS;
        for (idle_ns, service, numbers, words, what) in reports {
            now_ns += idle_ns;
            watchdog.look(now_ns);
            match what {
                0 => watchdog.started(service, now_ns),
                1 => watchdog.ended(service),
                _ => {}
            }
            let [epoch, seq, missed, period_ns, answered_epoch, answered_seq] = numbers;
            let mut health = Health {
                missed,
                period_ns,
                answered_epoch,
                answered_seq,
                ..Health::default()
            };
            // Few epochs and numbers, so that reports of one start follow each other.
            (health.header.epoch, health.header.seq) = (epoch % 4, seq % 8);
            [health.state, health.degraded] = words;
            watchdog.take(service, &health, now_ns);
            while watchdog.failed(now_ns).is_some() {}
        }
    }
}

/// Publishes a frame, nothing, or the end.
struct Producer {
    output: Box<dyn Sender<SensorFrame>>,
    clock: VirtualClock,
    compute_ns: u64,
    outcome: u8,
}

impl Source for Producer {
    fn produce(
        &mut self,
        t_schedule_ns: u64,
        clock: &dyn Clock,
    ) -> Result<SourceOutcome, PortError> {
        self.clock.advance(self.compute_ns);
        let stamp = Stamp {
            t_schedule_ns,
            t_capture_ns: t_schedule_ns,
        };
        match self.outcome {
            0 => Ok(SourceOutcome::Nothing),
            _ => self.output.send(stamp, clock).map(SourceOutcome::Frame),
        }
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.output.prepare()
    }

    fn after(&mut self, _health: &mut HealthBoard, _now_ns: u64) {}
}

/// Runs one turn of a stage that takes so, and says when it has published.
fn turn(take: impl FnMut(&mut Intake<'_>) -> u64 + 'static) {
    let clock = VirtualClock::default();
    clock.set(START_NS);
    let graph = Graph::InProcess(Bus::new(clock.clone()));
    let mut cycle = StageCycle::new(account(&graph, OnMiss::Count));
    let mut liar = Liar {
        take: Box::new(take),
        published_ns: 0,
    };
    let _ = cycle.turn(&mut liar, &clock);
}

/// A stage that breaks its contract with the cycle.
struct Liar {
    take: Box<dyn FnMut(&mut Intake<'_>) -> u64>,
    published_ns: u64,
}

impl Stage for Liar {
    fn take(&mut self, intake: &mut Intake<'_>) {
        self.published_ns = (self.take)(intake);
    }

    fn miss(&mut self, _count: u32) {}

    fn publish(&mut self, _: Cause, _: Stamp, _: &dyn Clock) -> Result<u64, PortError> {
        Ok(self.published_ns)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    fn after(&mut self, _health: &mut HealthBoard, _now_ns: u64) {}
}

fn frame_header() -> Header {
    Header {
        schema: SensorFrame::SCHEMA,
        epoch: 1,
        t_schedule_ns: START_NS,
        ..Header::default()
    }
}

#[test]
#[should_panic(expected = "a stage steps only frames behind blocks that it has accepted")]
fn a_stage_that_steps_what_it_has_not_accepted_is_found() {
    turn(|intake| {
        intake.stepped(&frame_header(), frame_header().id());
        START_NS
    });
}

#[test]
#[should_panic(expected = "a block is published after the wake-up")]
fn a_stage_that_publishes_before_it_wakes_is_found() {
    turn(|intake| {
        assert!(intake.accept::<SensorFrame>(&frame_header()));
        intake.stepped(&frame_header(), frame_header().id());
        START_NS - 1
    });
}

#[test]
#[should_panic(expected = "a frame is published after the wake-up")]
fn a_source_that_publishes_before_it_wakes_is_found() {
    /// Publishes a nanosecond before it is due.
    struct Early;
    impl Source for Early {
        fn produce(&mut self, due_ns: u64, _: &dyn Clock) -> Result<SourceOutcome, PortError> {
            Ok(SourceOutcome::Frame(due_ns - 1))
        }

        fn prepare(&mut self) -> Result<(), PortError> {
            Ok(())
        }

        fn after(&mut self, _health: &mut HealthBoard, _now_ns: u64) {}
    }
    let clock = VirtualClock::default();
    clock.set(START_NS);
    let graph = Graph::InProcess(Bus::new(clock.clone()));
    let mut cycle = SourceCycle::new(account(&graph, OnMiss::Count), START_NS);
    let _ = cycle.turn(&mut Early, &clock);
}

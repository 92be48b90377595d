//! A steady cycle of every service, its wiring and accounting included, allocates nothing (over
//! the in-process bus; what the transport itself does is bounded and documented).
#![cfg(test)]

use std::path::PathBuf;

use vigil_blocks::{Entry, EventKind};
use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::port::Bus;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    CycleAccount, DeadlineMonitor, Graph, HealthBoard, Recorder, SourceCycle, Stage, StageCycle,
    Topic, VirtualClock,
};
use vigil_detector::DetectorStage;
use vigil_diagnosis::identify::Input;
use vigil_identifier::IdentifierStage;
use vigil_sensor_sim::{SensorSource, SimulatorSource};
use vigil_setup::{GraphArgs, Setup};
use vigil_supervisor::SupervisorStage;

#[path = "virtual_graph/kobuki.rs"]
mod kobuki;

use kobuki::Kobuki;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Cycles until the first action has come back.
const WARM_UP: u64 = 5;
const CYCLES: u64 = 1200;
/// A sensor frame is held back in this cycle: the deadlines pass.
const SILENT: u64 = 900;

fn load(config: &str) -> Setup {
    let config = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../config")
        .join(config);
    let args = GraphArgs {
        config,
        ..GraphArgs::default()
    };
    args.load().unwrap()
}

/// The default graph, by its solved policy or by a heuristic.
fn setup(is_solved: bool) -> Setup {
    let mut setup = load("rover.toml");
    if !is_solved {
        setup.policy = None;
        setup.file.supervisor.policy = "qmdp".to_owned();
        setup.file.supervisor.policy_file = None;
    }
    setup
}

fn cycle_parts(setup: &Setup, graph: &Graph, name: ServiceName) -> (DeadlineMonitor, HealthBoard) {
    let schedule = setup
        .plan(name, vigil_cycle::serve::Leave::default())
        .schedule;
    let wanted = PlacementRequest {
        core: 0,
        priority: 1,
    };
    let sender = graph.sender(Topic::Health(name)).unwrap();
    let board = HealthBoard::new(sender, schedule, wanted, read_back(0));
    (DeadlineMonitor::new(schedule), board)
}

/// The simulated rover, one of whose wheels will stick.
fn simulator(setup: &Setup, graph: &Graph) -> SimulatorSource {
    let inject = ["stuck:RM@3".to_owned()];
    match vigil_sensor_sim::assemble(setup, &inject).unwrap() {
        SensorSource::Simulator(simulation, schedule) => {
            let period_ns = setup.period_ns();
            SimulatorSource::new(*simulation, schedule, true, period_ns, graph).unwrap()
        }
        _ => unreachable!("the default graph simulates"),
    }
}

/// Allocations of one turn.
fn turn(cycle: &mut StageCycle, stage: &mut impl Stage, clock: &VirtualClock) -> u64 {
    let before = allocations();
    assert!(cycle.turn(stage, clock).unwrap().is_continue());
    allocations() - before
}

#[test]
fn steady_cycles_of_every_service_allocate_nothing() {
    demand_steady(&setup(false));
}

#[test]
fn nor_do_they_with_a_policy_that_was_solved_beforehand() {
    demand_steady(&setup(true));
}

#[test]
fn nor_do_those_of_a_robot_that_was_learned_from_its_log() {
    let setup = load("kobuki.toml");
    let mut detector = vigil_detector::assemble(&setup).unwrap();
    let mut identifier = vigil_identifier::assemble(&setup).unwrap();
    let (mut detection, mut diagnosis) = (Box::default(), Box::default());
    let (mut particles, mut further) = (Box::default(), Box::default());
    let kobuki = Kobuki::new(&setup.robot, &["stuck:L@6"], 1);
    let run = kobuki.drive(setup.file.graph.rate_hz, 24.0);
    let (mut p_fault_max, mut pairs) = (0.0_f64, 0);
    for (k, mut frame) in (1..).zip(run.frames) {
        // Then two sensors break, and one is silent.
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if t_s > 12.0 {
            frame.set_channel(1, 9.0);
            frame.set_channel(2, -1.5);
        }
        if t_s > 18.0 {
            frame.channel_valid &= !0b1000;
        }
        let before = allocations();
        detector.step(Entry::Frame(&frame), &mut detection, &mut particles);
        let input = Input {
            frame: &frame,
            detection: Some((&detection, &particles)),
        };
        identifier.step(Entry::Frame(input), &mut diagnosis, &mut further);
        let found = allocations() - before;
        assert!(k <= WARM_UP || found == 0, "cycle {k}: {found}");
        p_fault_max = p_fault_max.max(detection.p_fault);
        pairs += u32::from(diagnosis.sets[0].leaves.count_ones() > 1);
    }
    assert!(
        p_fault_max > 0.99 && pairs > 10,
        "{p_fault_max}, {pairs} pairs"
    );
}

fn demand_steady(setup: &Setup) {
    use ServiceName::{Detector, Identifier, SensorSim, Supervisor};
    let period_ns = setup.period_ns();
    let clock = VirtualClock::default();
    let graph = Graph::InProcess(Bus::new(clock.clone()));
    let parts = |name| cycle_parts(setup, &graph, name);
    let stage = |name| {
        let (monitor, board) = parts(name);
        StageCycle::new(CycleAccount::new(monitor, board, Recorder::new().unwrap()))
    };
    let mut sensor = simulator(setup, &graph);
    let (monitor, board) = parts(SensorSim);
    let account = CycleAccount::new(monitor, board, Recorder::new().unwrap());
    let mut source = SourceCycle::new(account, period_ns);
    let detector = vigil_detector::assemble(setup).unwrap();
    let mut detector = (
        stage(Detector),
        DetectorStage::new(detector, &setup.robot, &graph).unwrap(),
    );
    let identifier = vigil_identifier::assemble(setup).unwrap();
    let identifier = IdentifierStage::new(identifier, &setup.robot, &graph).unwrap();
    let mut identifier = (stage(Identifier), identifier);
    let validity_ns = vigil_supervisor::validity_ns(setup);
    let steps = vigil_supervisor::steps(setup).unwrap();
    let supervisor = SupervisorStage::new(steps, &graph, validity_ns, None, &clock).unwrap();
    let mut supervisor = (stage(Supervisor), supervisor);
    clock.set(period_ns);
    detector.0.account_mut().ready(&clock).unwrap();
    identifier.0.account_mut().ready(&clock).unwrap();
    supervisor.0.account_mut().ready(&clock).unwrap();

    for k in 1..=CYCLES {
        clock.set(k * period_ns);
        let before = allocations();
        if k != SILENT {
            assert!(source.turn(&mut sensor, &clock).unwrap().is_continue());
        } else {
            // Later than every deadline of this period.
            clock.advance(period_ns - 1);
        }
        let counts = [
            allocations() - before,
            turn(&mut detector.0, &mut detector.1, &clock),
            turn(&mut identifier.0, &mut identifier.1, &clock),
            turn(&mut supervisor.0, &mut supervisor.1, &clock),
        ];
        assert!(k <= WARM_UP || counts == [0; 4], "cycle {k}: {counts:?}");
    }
    // It did cycle, miss, and see the wheel stick.
    assert_eq!(source.account().health().view().slips, 1);
    for cycle in [&detector.0, &identifier.0, &supervisor.0] {
        let health = cycle.account().health().view();
        assert!(health.cycles > CYCLES - 5 && health.missed >= 1);
    }
    let diagnoses = identifier.0.account().health().view().events;
    assert!(
        diagnoses
            .iter()
            .any(|e| e.kind == EventKind::Diagnosis as u32)
    );
    // The counter counts.
    let before = allocations();
    drop(vec![1_u8]);
    assert_eq!(allocations() - before, 1);
}

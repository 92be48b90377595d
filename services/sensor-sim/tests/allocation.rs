//! A steady cycle of the simulator allocates nothing.

use std::path::Path;

use vigil_blocks::{Action, RecoveryKind, SensorFrame};
use vigil_cycle::allocation::{CountingAllocator, allocations};
use vigil_robot::injection::Change;
use vigil_robot::{Fault, FaultKind};
use vigil_sensor_sim::{ActionGate, InjectionSchedule, Navigator, Simulation, World};
use vigil_setup::graph_file::{DriveSegment, GraphFile, Simulator};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn steady_cycles_with_faults_and_actions_allocate_nothing() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots/rover.toml");
    let robot = vigil_setup::load_robot(&path).unwrap();
    let segment = |curvature_1_m| DriveSegment {
        duration_s: 1.0,
        curvature_1_m,
        speed_m_s: 0.2,
    };
    let drive = [segment(0.5), segment(0.0), segment(-0.5)];
    let mut world = World::new(&robot, &Simulator::default(), &drive, 1000.0, 1).unwrap();
    let mut gate = ActionGate::new(&robot.limits);
    let injection = |kind, wheel, at_s| vigil_robot::Injection {
        change: Change::Inject(Fault { kind, wheel }),
        at_s,
    };
    let disturbance = |spec, at_s| vigil_robot::Injection {
        change: vigil_robot::Injection::parse_change(spec, &robot).unwrap(),
        at_s,
    };
    let mut schedule = InjectionSchedule::new(vec![
        disturbance("pose-delay:0.3", 0.5),
        disturbance("encoder-delay:RF:0.2", 0.6),
        disturbance("tether:5", 0.7),
        disturbance("clear:tether", 0.9),
        injection(FaultKind::Stuck, 4, 1.0),
        injection(FaultKind::EncoderFrozen, 0, 1.5),
        injection(FaultKind::EncoderNoise, 2, 2.0),
        injection(FaultKind::Stuck, 1, 2.5),
    ]);
    let mut action = Action {
        kind: RecoveryKind::GoOn as u32,
        valid_until_ns: 4_000_000_000,
        speed_scale: 1.0,
        curvature_gain: 1.0,
        ..Action::default()
    };
    let mut frame = SensorFrame::default();
    let before = allocations();
    for cycle in 0..5000_u64 {
        let now_ns = cycle * 1_000_000;
        action.decision_seq = cycle;
        while let Some(change) = schedule.due(now_ns) {
            world.change(change).unwrap();
        }
        let command = gate.apply(world.planned(), Some(&action), now_ns);
        world.step(0.001, command);
        world.measure(&mut frame);
    }
    assert_eq!(allocations() - before, 0);
    // It did drive, break and stop.
    assert!(
        world.true_state().stuck[4] && frame.safe_stop == 1 && schedule.due(u64::MAX).is_none()
    );
    assert!(world.true_state().pose[0] > 0.3);
    // The counter counts.
    drop(vec![1_u8]);
    assert!(allocations() > before);
}

#[test]
fn a_robot_on_its_path_allocates_nothing_whatever_it_is_told() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let robot = vigil_setup::load_robot(&config.join("robots/rover.toml")).unwrap();
    let text = std::fs::read_to_string(config.join("corridor-obstacle.toml")).unwrap();
    let file: GraphFile = toml::from_str(&text).unwrap();
    let world = World::new(&robot, &file.simulator, &[], 100.0, 1).unwrap();
    let navigator = Navigator::new(
        file.navigation.as_ref().unwrap(),
        vigil_robot::ChannelMap::new(&robot),
    );
    let gate = ActionGate::new(&robot.limits);
    let mut simulation = Simulation::new(world, gate, Some(navigator));
    let mut action = Action {
        valid_until_ns: u64::MAX,
        speed_scale: 1.0,
        curvature_gain: 1.0,
        ..Action::default()
    };
    let mut frame = SensorFrame::default();
    let mut happenings = 0;
    let before = allocations();
    // Every kind, five times, each for four seconds; following for longer.
    for turn in 0..55_u32 {
        action.decision_seq += 1;
        action.kind = 1 + turn % 11;
        let cycles = if action.kind == 1 { 1000 } else { 400 };
        for _ in 0..cycles {
            simulation.step(0.01, Some(&action), 0);
            simulation.measure(&mut frame);
            happenings += u32::from(simulation.take_event().is_some());
        }
    }
    assert_eq!(allocations() - before, 0);
    assert!(happenings > 20, "{happenings}");
}

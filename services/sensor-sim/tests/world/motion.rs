//! How the rover moves, follows commands, and stops.

use vigil_blocks::{Action, ActionOutcome, RecoveryKind};
use vigil_sensor_sim::{ActionGate, DriveCommand, EffectiveCommand, World};
use vigil_setup::graph_file::Simulator;

use crate::rover::{drive, even_soil, measure, robot, segment, steady};

fn action(kind: RecoveryKind, decision_seq: u64) -> Action {
    Action {
        kind: kind as u32,
        decision_seq,
        valid_until_ns: u64::MAX,
        speed_scale: 1.0,
        curvature_gain: 1.0,
        ..Action::default()
    }
}

#[test]
fn the_executed_command_changes_no_faster_than_the_servos() {
    let segments = [segment(3.0, 0.8, 0.3), segment(3.0, -0.8, 0.1)];
    let mut world = World::new(&robot(), &even_soil(), &segments, 100.0, 1).unwrap();
    let mut before = [0.0; 8];
    let mut reached = false;
    for _ in 0..1200 {
        drive(&mut world, 100.0, 1);
        let now = measure(&mut world).command;
        assert!(
            (now[0] - before[0]).abs() <= 0.005 + 1e-12,
            "{now:?} {before:?}"
        );
        assert!(
            (now[1] - before[1]).abs() <= 0.005 + 1e-12,
            "{now:?} {before:?}"
        );
        reached |= now[..2] == [0.8, 0.3];
        before = now;
    }
    assert!(reached, "the first segment's command is reached, exactly");
}

#[test]
fn the_same_drive_at_any_rate_ends_at_the_same_place() {
    let end = |rate_hz: f64| {
        let segments = [
            segment(8.0, 0.5, 0.2),
            segment(6.0, 0.0, 0.2),
            segment(8.0, -0.4, 0.25),
        ];
        let mut world = World::new(&robot(), &even_soil(), &segments, rate_hz, 1).unwrap();
        drive(&mut world, rate_hz, (20.0 * rate_hz) as usize);
        world.true_state().pose
    };
    let reference = end(1000.0);
    for rate_hz in [20.0, 50.0, 100.0, 333.0] {
        let pose = end(rate_hz);
        for axis in 0..3 {
            let off = (pose[axis] - reference[axis]).abs();
            // A change of segment waits for the next cycle.
            let allowed = 0.001 + 0.5 / rate_hz;
            assert!(
                off < allowed,
                "{rate_hz} Hz, axis {axis}: {pose:?} {reference:?}"
            );
        }
    }
}

#[test]
fn a_nominal_rover_stays_near_its_plan() {
    // Nominal slip is half a per cent; 10 m of path.
    let mut world = steady(0.25, 100.0);
    drive(&mut world, 100.0, 5000);
    let (frame, truth) = (measure(&mut world), world.true_state());
    let off = (frame.planned_pose[0] - truth.pose[0]).hypot(frame.planned_pose[1] - truth.pose[1]);
    assert!(off < 0.15, "{off}");
    // The plan itself is a circle about (0, 4 m), but for the first 0.4 s of acceleration and
    // the half second of steering.
    let [x, y, _] = frame.planned_pose;
    assert!((x.hypot(y - 4.0) - 4.0).abs() < 0.05, "{x} {y}");
}

#[test]
fn without_an_action_nothing_moves_at_all() {
    let segments = [segment(10.0, 0.5, 0.2)];
    let settings = Simulator::default();
    let mut world = World::new(&robot(), &settings, &segments, 100.0, 1).unwrap();
    let mut gate = ActionGate::new(&robot().limits);
    for _ in 0..500 {
        let command = gate.apply(world.planned(), None, 0);
        world.step(0.01, command);
    }
    let (frame, truth) = (measure(&mut world), world.true_state());
    assert_eq!((truth.pose, truth.velocity), ([0.0; 3], [0.0; 3]));
    assert_eq!(truth.wheel_rate_rad_s, [0.0; 6]);
    assert_eq!((frame.safe_stop, frame.action_seq), (1, 0));
    assert_eq!(frame.action_outcome, ActionOutcome::None as u32);
    assert_eq!(frame.planned_pose, [0.0; 3]);
    assert_eq!(frame.command[1], 0.0);
    // The drive has not begun: its first segment lasts its full 10 s from now on.
    drive(&mut world, 100.0, 990);
    assert_eq!(world.planned().speed_m_s, 0.2);
}

#[test]
fn an_expired_action_stops_the_rover_within_its_braking_time() {
    let mut world = steady(0.0, 100.0);
    let mut gate = ActionGate::new(&robot().limits);
    let mut good = action(RecoveryKind::GoOn, 5);
    good.valid_until_ns = 2_000_000_000;
    let mut command_at = Vec::new();
    for cycle in 0..500_u64 {
        let now_ns = cycle * 10_000_000;
        let command = gate.apply(world.planned(), Some(&good), now_ns);
        world.step(0.01, command);
        let frame = measure(&mut world);
        command_at.push(frame.command[1]);
        assert_eq!(
            frame.safe_stop == 1,
            now_ns > 2_000_000_000,
            "cycle {cycle}"
        );
        assert_eq!(frame.action_seq, 5);
    }
    assert_eq!(command_at[200], 0.2);
    // 0.2 m/s at 0.5 m/s²: 40 cycles.
    assert!(command_at[230] > 0.04 && command_at[230] < 0.06);
    assert!(command_at[241..].iter().all(|&speed| speed == 0.0));
    let truth = world.true_state();
    assert_eq!(
        (truth.velocity, truth.wheel_rate_rad_s),
        ([0.0; 3], [0.0; 6])
    );
    let frame = measure(&mut world);
    assert_eq!(frame.action_outcome, ActionOutcome::Failed as u32);
}

#[test]
fn a_stop_is_reported_running_until_it_is_done_and_driving_can_go_on() {
    let mut world = steady(0.5, 100.0);
    let mut gate = ActionGate::new(&robot().limits);
    let mut turn = |world: &mut World, kind, seq, cycles: usize| {
        let mut outcomes = Vec::new();
        for _ in 0..cycles {
            let command = gate.apply(world.planned(), Some(&action(kind, seq)), 0);
            world.step(0.01, command);
            let frame = measure(world);
            assert_eq!((frame.action_seq, frame.safe_stop), (seq, 0));
            outcomes.push(frame.action_outcome);
        }
        outcomes
    };
    turn(&mut world, RecoveryKind::GoOn, 1, 300);
    let outcomes = turn(&mut world, RecoveryKind::Stop, 2, 300);
    let running = ActionOutcome::Running as u32;
    let done = ActionOutcome::Succeeded as u32;
    assert!(outcomes[..38].iter().all(|&outcome| outcome == running));
    assert!(outcomes[41..].iter().all(|&outcome| outcome == done));
    let stopped = world.true_state();
    assert_eq!(stopped.velocity, [0.0; 3]);
    turn(&mut world, RecoveryKind::CallForHelp, 3, 50);
    assert_eq!(
        world.true_state().pose,
        stopped.pose,
        "standing still is exact"
    );
    turn(&mut world, RecoveryKind::GoOn, 4, 300);
    assert!((world.true_state().velocity[0] - 0.19907).abs() < 1e-4);
}

#[test]
fn a_slowed_rover_drives_the_same_path() {
    let path = |speed_scale: f64, cycles: usize| {
        let segments = [segment(6.0, 0.5, 0.2), segment(1e6, -0.25, 0.2)];
        let mut world = World::new(&robot(), &even_soil(), &segments, 100.0, 1).unwrap();
        for _ in 0..cycles {
            let planned = world.planned();
            let target = DriveCommand {
                speed_m_s: planned.speed_m_s * speed_scale,
                ..planned
            };
            let command = EffectiveCommand {
                target,
                progress: speed_scale,
                rejection: None,
                action_seq: 1,
            };
            world.step(0.01, command);
        }
        measure(&mut world).planned_pose
    };
    let (full, half) = (path(1.0, 1500), path(0.5, 3000));
    // Servos take the same time at both speeds, hence not the same distance.
    for axis in 0..3 {
        assert!((full[axis] - half[axis]).abs() < 0.1, "{full:?} {half:?}");
    }
}

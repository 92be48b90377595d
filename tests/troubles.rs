//! Sensors that fall silent, clocks that are set back, and a robot that drives though it should
//! stand: what no filter weighs must not pass for health.
#![cfg(test)]

mod watched;

use vigil_blocks::{MODE_UNKNOWN, SensorFrame};
use vigil_robot::{Fault, FaultKind};
use watched::WatchedRover;

const STUCK: Fault = Fault {
    kind: FaultKind::Stuck,
    wheel: 4,
};

/// True once the alarm stands and the diagnosis is unknown.
fn is_noticed(watched: &WatchedRover) -> bool {
    watched.detection.alarm != 0
        && watched.diagnosis.mode == MODE_UNKNOWN
        && watched.diagnosis.p_unknown > 0.99
}

fn is_well(watched: &WatchedRover) -> bool {
    watched.detection.alarm == 0 && watched.diagnosis.mode == 0 && watched.diagnosis.p[0] > 0.9
}

fn without(bits: u64) -> impl Fn(&mut SensorFrame) {
    move |frame| frame.channel_valid &= !bits
}

#[test]
fn a_sensor_that_falls_silent_is_noticed_and_forgiven_when_it_reads_again() {
    let (pose, encoder_lr) = (0b111, 1 << 5);
    for bits in [pose, encoder_lr] {
        let mut watched = WatchedRover::new(31);
        watched.drive(8.0);
        watched.drive_with(1.5, without(bits));
        assert!(is_well(&watched));
        watched.drive_with(1.0, without(bits));
        assert!(is_noticed(&watched), "{bits}");
        watched.drive_with(5.0, without(bits));
        assert!(is_noticed(&watched), "{bits}");
        watched.drive(6.0);
        assert!(is_well(&watched), "{bits}");
    }
}

#[test]
fn a_robot_that_drives_on_though_it_should_stand_is_noticed() {
    let mut watched = WatchedRover::new(32);
    watched.drive(8.0);
    let commanded_rest = |frame: &mut SensorFrame| frame.command[1] = 0.0;
    watched.drive_with(2.5, commanded_rest);
    assert!(is_noticed(&watched));
}

#[test]
fn watchers_that_begin_beside_a_stuck_wheel_name_nothing_else() {
    for (seed, lead) in (41..).zip([0, 1, 5, 10, 20, 50, 140]) {
        let mut watched = WatchedRover::new(seed);
        watched.drive(3.0);
        watched.world.inject(STUCK).unwrap();
        watched.drive(4.0);
        watched.replace_watchers(lead);
        let leaf = watched.leaf(STUCK) as u32;
        for cycle in 0..400 {
            watched.step();
            let mode = watched.diagnosis.mode;
            assert!(
                [0, leaf].contains(&mode),
                "{lead} cycles before, {cycle} after: {mode}"
            );
        }
        assert_eq!(watched.diagnosis.mode, leaf, "{lead}");
    }
}

#[test]
fn a_clock_that_is_set_back_stops_nobody() {
    let mut watched = WatchedRover::new(33);
    watched.drive(8.0);
    watched.frame_time_back(5.0);
    watched.drive(3.0);
    assert!(is_well(&watched));
    watched.world.inject(STUCK).unwrap();
    // Well before the clock is where it was.
    watched.drive(1.0);
    assert_eq!(watched.diagnosis.mode, watched.leaf(STUCK) as u32);
}

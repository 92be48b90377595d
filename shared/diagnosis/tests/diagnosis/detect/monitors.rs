//! The monitors of the planned pose on exact traces.

use std::f64::consts::{PI, TAU};
use vigil_diagnosis::detect::MonitorSettings;

use vigil_blocks::{SensorFrame, Symptoms};
use vigil_diagnosis::detect::Monitors;
use vigil_robot::{ChannelMap, Description};

/// Time between frames.
const STEP_S: f64 = 0.1;

/// Validity of the pose, whose channels come first.
const POSE: u64 = 0b111;

/// Channels of a robot that measures nothing but its pose.
fn map() -> ChannelMap {
    let text = r#"
name = "point"
kinematics = "differential"
wheel_radius_m = 0.1
command = [{ name = "v", unit = "m/s", limit = 1.0 }, { name = "w", unit = "rad/s", limit = 2.0 }]
wheels = [
  { name = "L", x = 0.0, y = 0.1, steered = false },
  { name = "R", x = 0.0, y = -0.1, steered = false },
]
measured = { pose = true, wheel_rates = false, steer = false }
limits = { speed_m_s = 1.0, yaw_rate_rad_s = 2.0, wheel_rate_rad_s = 50.0 }
"#;
    let robot: Description = toml::from_str(text).unwrap();
    ChannelMap::new(&robot)
}

struct Frames {
    monitors: Monitors,
    frame: SensorFrame,
}

impl Frames {
    fn new() -> Self {
        let settings = MonitorSettings {
            position_error_m: 0.5,
            stopped_after_s: 2.0,
            loop_radius_m: 0.3,
            loop_travel_m: 3.0,
            spin_turn_rad: 6.25,
            spin_radius_m: 0.5,
        };
        let mut frame = SensorFrame {
            channel_valid: POSE,
            planned_pose_valid: 1,
            ..SensorFrame::default()
        };
        frame.header.t_capture_ns = 1_000_000_000;
        Self {
            monitors: Monitors::new(&settings, map()),
            frame,
        }
    }

    /// One frame; what fires then.
    fn at(&mut self, pose: [f64; 3], planned: [f64; 3]) -> u32 {
        self.frame.channel[..3].copy_from_slice(&pose);
        self.frame.planned_pose = planned;
        self.frame.header.t_capture_ns += (STEP_S * 1e9) as u64;
        self.monitors.observe(&self.frame);
        self.monitors.symptoms()
    }
}

#[test]
fn an_error_in_position_is_of_a_moving_or_a_stopped_robot_and_ends_below_half() {
    let mut robot = Frames::new();
    // The plan goes on by 0.05 m a frame, the robot by 0.025 m: 0.5 m apart after 20 frames.
    let mut fired = Vec::new();
    for k in 1..=30 {
        let k = f64::from(k);
        fired.push(robot.at([0.025 * k, 0.0, 0.0], [0.05 * k, 0.0, 0.0]));
    }
    let expected: Vec<u32> = (1..=30)
        .map(|k| if k > 20 { Symptoms::EPM } else { 0 })
        .collect();
    assert_eq!(fired, expected);
    // It stops: stopped after it has stayed within 0.1 m for 2 s. It last was beyond that at
    // 0.65 m (0.125 m, five frames, from place to place), four frames before it stopped.
    let frames = (1..=40).find(|_| robot.at([0.75, 0.0, 0.0], [1.5, 0.0, 0.0]) == Symptoms::EPS);
    assert_eq!(frames, Some(16));
    // Nearer, but not by half; then by half.
    assert_eq!(robot.at([0.75, 0.0, 0.0], [1.01, 0.0, 0.0]), Symptoms::EPS);
    assert_eq!(robot.at([0.75, 0.0, 0.0], [0.99, 0.0, 0.0]), 0);
    assert_eq!(robot.at([0.75, 0.0, 0.0], [1.24, 0.0, 0.0]), 0);
    assert_eq!(robot.at([0.75, 0.0, 0.0], [1.26, 0.0, 0.0]), Symptoms::EPS);
}

/// Round a circle of circumference 4 m, 80 places a round.
fn round(k: u32) -> [f64; 3] {
    let (radius_m, angle) = (4.0 / TAU, TAU * f64::from(k) / 80.0);
    [
        radius_m * angle.sin(),
        radius_m * (1.0 - angle.cos()),
        angle,
    ]
}

#[test]
fn a_loop_is_a_place_come_back_to_that_the_plan_did_not_come_back_to() {
    let mut robot = Frames::new();
    // The plan goes straight on, within half a metre at first: only what loops counts here.
    let first = (0..=160).find(|&k| {
        let planned = [0.05 * f64::from(k), 0.0, 0.0];
        robot.at(round(k), planned) & Symptoms::LD != 0
    });
    // Places are kept each 0.25 m: 5 steps, chords a little less, so 6 for the first. The first
    // place that is back within 0.3 m of the start is the one at or after 3.7 m.
    let k = first.unwrap();
    assert!((74..=80).contains(&k), "{k}");
    // A plan that goes round is no loop.
    let mut planned = Frames::new();
    for k in 0..400 {
        assert_eq!(planned.at(round(k), round(k)), 0);
    }
}

#[test]
fn a_spin_is_a_turn_on_the_spot_that_the_plan_does_not_make() {
    let spins = |robot: &mut Frames, turn: f64, planned: f64, drift_m: f64| {
        (1..=200).find(|k| {
            let k = f64::from(*k);
            let yaw = |turn: f64| (k * turn + PI).rem_euclid(TAU) - PI;
            let place = [k * drift_m, 0.0];
            let fires = robot.at([place[0], 0.0, yaw(turn)], [place[0], 0.0, yaw(planned)]);
            fires & Symptoms::SD != 0
        })
    };
    // From the first frame on; 6.25 rad by 0.1 rad a frame: 63 more.
    assert_eq!(spins(&mut Frames::new(), 0.1, 0.0, 0.0), Some(64));
    assert_eq!(spins(&mut Frames::new(), -0.1, 0.0, 0.0), Some(64));
    // Planned turns do not count; a robot that leaves the spot does not spin.
    assert_eq!(spins(&mut Frames::new(), 0.1, 0.1, 0.0), None);
    assert_eq!(spins(&mut Frames::new(), 0.1, 0.0, 0.02), None);
    // To and fro is no spin.
    let mut robot = Frames::new();
    for k in 0..400 {
        let yaw = 1.5 * (0.1 * f64::from(k)).sin();
        assert_eq!(robot.at([0.0, 0.0, yaw], [0.0; 3]), 0);
    }
}

#[test]
fn a_jump_of_the_frame_begins_anew_and_half_a_frame_changes_nothing() {
    let mut robot = Frames::new();
    assert_eq!(robot.at([0.0; 3], [0.0; 3]), 0);
    assert_eq!(robot.at([2.0, 0.0, 0.0], [0.0; 3]), Symptoms::EPM);
    for (valid, x) in [((POSE, 0), 0.0), ((0, 1), 0.0), ((POSE, 1), f64::NAN)] {
        (robot.frame.channel_valid, robot.frame.planned_pose_valid) = valid;
        assert_eq!(
            robot.at([x, 0.0, 0.0], [0.0; 3]),
            Symptoms::EPM,
            "{valid:?} {x}"
        );
    }
    (robot.frame.channel_valid, robot.frame.planned_pose_valid) = (POSE, 1);
    robot.frame.pose_reset_count += 1;
    assert_eq!(robot.at([0.3, 0.0, 0.0], [0.0; 3]), 0);
    // With the old trace, this would be a stop for a long time.
    robot.monitors.reset();
    assert_eq!(robot.monitors.symptoms(), 0);
}

#[test]
fn without_a_plan_for_long_the_robot_is_not_where_it_should_be() {
    let mut robot = Frames::new();
    // A planner that has never spoken says nothing.
    robot.frame.planned_pose_valid = 0;
    assert!((0..50).all(|_| robot.at([0.0; 3], [0.0; 3]) == 0));
    robot.frame.planned_pose_valid = 1;
    assert_eq!(robot.at([0.0; 3], [0.0; 3]), 0);
    // It dies. The robot goes on, then stops.
    robot.frame.planned_pose_valid = 0;
    let fired: Vec<u32> = (1..=12)
        .map(|k| robot.at([0.05 * f64::from(k), 0.0, 0.0], [0.0; 3]))
        .collect();
    assert_eq!(fired[..9], [0; 9]);
    assert_eq!(fired[9..], [Symptoms::EPM; 3]);
    let stopped = (1..=40).find(|_| robot.at([0.6, 0.0, 0.0], [0.0; 3]) == Symptoms::EPS);
    assert!(stopped.is_some_and(|k| k > 15), "{stopped:?}");
    // Without a pose nothing can be said.
    (robot.frame.channel_valid, robot.frame.planned_pose_valid) = (0, 1);
    assert_eq!(robot.at([0.6, 0.0, 0.0], [0.0; 3]), 0);
    // Both are back: everything begins anew.
    robot.frame.channel_valid = POSE;
    assert_eq!(robot.at([0.6, 0.0, 0.0], [0.3, 0.0, 0.0]), 0);
    assert_eq!(robot.at([0.6, 0.0, 0.0], [0.0; 3]), Symptoms::EPM);
}

#[test]
fn an_error_in_position_does_not_outlive_the_pose() {
    let mut robot = Frames::new();
    robot.at([0.0; 3], [0.0; 3]);
    assert_eq!(robot.at([2.0, 0.0, 0.0], [0.0; 3]), Symptoms::EPM);
    robot.frame.channel_valid = 0;
    let fired: Vec<u32> = (0..11)
        .map(|_| robot.at([2.0, 0.0, 0.0], [0.0; 3]))
        .collect();
    assert_eq!(fired[..9], [Symptoms::EPM; 9]);
    assert_eq!(fired[9..], [0; 2]);
}

#[test]
fn a_loop_and_a_spin_end_when_the_robot_stands() {
    let mut robot = Frames::new();
    for k in 0..=80 {
        robot.at(round(k), [0.05 * f64::from(k), 0.0, 0.0]);
    }
    let planned = [4.0, 0.0, 0.0];
    let fires = |robot: &mut Frames, pose, symptom| {
        let fired: Vec<bool> = (0..150)
            .map(|_| robot.at(pose, planned) & symptom != 0)
            .collect();
        assert!(fired[..90].iter().all(|fires| *fires));
        assert!(fired[100..].iter().all(|fires| !fires));
    };
    fires(&mut robot, round(80), Symptoms::LD);
    // On the spot, once round; then it stands; then once round again.
    let mut robot = Frames::new();
    let spin = |robot: &mut Frames| {
        (1..=64)
            .map(|k| robot.at([4.0, 0.0, wrapped(0.1 * f64::from(k))], planned))
            .last()
    };
    for _ in 0..2 {
        robot.at([4.0, 0.0, 0.0], planned);
        assert_eq!(spin(&mut robot), Some(Symptoms::SD));
        fires(&mut robot, [4.0, 0.0, wrapped(6.4)], Symptoms::SD);
    }
}

fn wrapped(yaw_rad: f64) -> f64 {
    (yaw_rad + PI).rem_euclid(TAU) - PI
}

#[test]
fn of_more_places_than_are_kept_the_oldest_are_forgotten() {
    let mut robot = Frames::new();
    // 140 places, 12 more than are kept; then 1.8 m aside and back.
    for k in 0..140 {
        let pose = [0.3 * f64::from(k), 0.0, 0.0];
        assert_eq!(robot.at(pose, pose) & Symptoms::LD, 0);
    }
    let aside = [0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 1.5, 1.2, 0.9, 0.6];
    for y in aside {
        assert_eq!(robot.at([41.7, y, 0.0], [50.0, y, 0.0]) & Symptoms::LD, 0);
    }
    assert_eq!(
        robot.at([41.7, 0.2, 0.0], [50.0, 0.0, 0.0]) & Symptoms::LD,
        Symptoms::LD
    );
    // The start is no longer known.
    assert_eq!(
        robot.at([0.0, 0.0, 0.0], [50.0, 0.0, 0.0]) & Symptoms::LD,
        0
    );
}

//! Rules of `[navigation]` and `[monitors]`.

use std::f64::consts::PI;

use vigil_robot::Description;
use vigil_robot::description::Kinematics;

use crate::schema::{GraphFile, Monitors, Navigation, Source};

/// Coordinates beyond this are no corridor, m.
const COORDINATE_MAX_M: f64 = 1e3;
/// Points of a path, walls, obstacles: what a cycle may have to look at.
const COUNT_MAX: usize = 256;
/// A year is never, s.
const TIME_MAX_S: f64 = 3e7;

/// Checks both tables, where they are.
pub(super) fn check(
    file: &GraphFile,
    robot: Option<&Description>,
    report: &mut impl FnMut(&str, String),
) {
    if let Some(monitors) = &file.monitors {
        ranges("monitors", &monitor_ranges(monitors), report);
    }
    let Some(navigation) = &file.navigation else {
        return;
    };
    if file.sensor.source != Source::Simulator {
        let message = "has a meaning only for sensor.source = \"simulator\"".to_owned();
        report("navigation", message);
    }
    if !file.drive.is_empty() {
        report(
            "drive",
            "is not driven with [navigation]: leave one out".into(),
        );
    }
    if robot.is_some_and(|robot| robot.kinematics != Kinematics::Ackermann6) {
        let message = "the simulator drives robots of kinematics \"ackermann6\" only".to_owned();
        report("navigation", message);
    }
    let speed_max_m_s = robot.map_or(f64::MAX, |robot| robot.limits.speed_m_s);
    let of = navigation_ranges(navigation, speed_max_m_s);
    ranges("navigation", &of, report);
    paths(navigation, report);
    things(navigation, report);
}

type Range = (&'static str, f64, f64, f64);

fn ranges(table: &str, of: &[Range], report: &mut impl FnMut(&str, String)) {
    for &(key, value, low, high) in of {
        if !(low..=high).contains(&value) {
            let message = format!("{value} is out of range: allowed is {low} to {high}");
            report(&format!("{table}.{key}"), message);
        }
    }
}

const fn monitor_ranges(monitors: &Monitors) -> [Range; 6] {
    let loop_min_m = 2.0 * monitors.loop_radius_m;
    [
        ("position_error_m", monitors.position_error_m, 0.05, 10.0),
        ("stopped_after_s", monitors.stopped_after_s, 0.1, 60.0),
        ("loop_radius_m", monitors.loop_radius_m, 0.05, 5.0),
        ("loop_travel_m", monitors.loop_travel_m, loop_min_m, 30.0),
        ("spin_turn_rad", monitors.spin_turn_rad, 1.0, 100.0),
        ("spin_radius_m", monitors.spin_radius_m, 0.05, 5.0),
    ]
}

const fn navigation_ranges(navigation: &Navigation, speed_max_m_s: f64) -> [Range; 8] {
    [
        ("speed_m_s", navigation.speed_m_s, 0.01, speed_max_m_s),
        ("body_radius_m", navigation.body_radius_m, 0.05, 2.0),
        ("stop_m", navigation.stop_m, 0.1, 10.0),
        ("slow_m", navigation.slow_m, navigation.stop_m + 0.1, 20.0),
        ("look_s", navigation.look_s, 0.1, 60.0),
        ("think_s", navigation.think_s, 0.1, 60.0),
        ("help_s", navigation.help_s, 0.1, 600.0),
        ("away_m", navigation.away_m, 0.1, 5.0),
    ]
}

fn paths(navigation: &Navigation, report: &mut impl FnMut(&str, String)) {
    let counts = [
        ("path", navigation.path.len(), 2),
        ("alternative", navigation.alternative.len(), 0),
        ("walls", navigation.walls.len(), 0),
        ("obstacle", navigation.obstacle.len(), 0),
        ("trouble", navigation.trouble.len(), 0),
    ];
    for (key, count, least) in counts {
        if !(least..=COUNT_MAX).contains(&count) {
            let message = format!("{count} entries: allowed are {least} to {COUNT_MAX}");
            report(&format!("navigation.{key}"), message);
        }
    }
    if navigation
        .path
        .first()
        .is_some_and(|first| *first != [0.0; 2])
    {
        let message = "must begin at [0.0, 0.0], where the robot stands".to_owned();
        report("navigation.path", message);
    }
    let points = navigation.path.iter().chain(&navigation.alternative);
    let numbers = points.flatten().chain(navigation.walls.iter().flatten());
    let is_near = |m: &&f64| (-COORDINATE_MAX_M..=COORDINATE_MAX_M).contains(*m);
    if let Some(far) = numbers.into_iter().find(|m| !is_near(m)) {
        let message = format!("{far} is out of range: allowed is up to {COORDINATE_MAX_M} m");
        report("navigation.path", message);
    }
    for (key, path) in [
        ("path", &navigation.path),
        ("alternative", &navigation.alternative),
    ] {
        if path.windows(2).any(|pair| pair[0] == pair[1]) {
            let message = "a point follows upon itself: leave one out".to_owned();
            report(&format!("navigation.{key}"), message);
        }
    }
}

fn things(navigation: &Navigation, report: &mut impl FnMut(&str, String)) {
    let coordinate = |key, m| (key, m, -COORDINATE_MAX_M, COORDINATE_MAX_M);
    for (i, obstacle) in navigation.obstacle.iter().enumerate() {
        let until_s = obstacle.until_s.unwrap_or(TIME_MAX_S);
        let of = [
            coordinate("x_m", obstacle.x_m),
            coordinate("y_m", obstacle.y_m),
            ("radius_m", obstacle.radius_m, 0.01, 20.0),
            ("from_s", obstacle.from_s, 0.0, TIME_MAX_S),
            ("until_s", until_s, obstacle.from_s, TIME_MAX_S),
        ];
        ranges(&format!("navigation.obstacle.{i}"), &of, report);
    }
    for (i, trouble) in navigation.trouble.iter().enumerate() {
        let of = [
            coordinate("x_m", trouble.x_m),
            coordinate("y_m", trouble.y_m),
            ("at_s", trouble.at_s, 0.0, TIME_MAX_S),
            ("yaw_rad", trouble.yaw_rad, -PI, PI),
        ];
        ranges(&format!("navigation.trouble.{i}"), &of, report);
    }
}

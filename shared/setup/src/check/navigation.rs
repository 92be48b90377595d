//! Rules of `[navigation]` and `[monitors]`.

use vigil_diagnosis::detect::MonitorSettings;
use vigil_robot::Description;
use vigil_robot::description::Kinematics;

use crate::graph_file::{GraphFile, Navigation, Source};

/// Way in which a robot slows down before it stands, m: chosen by hand; at 0 it would stop at once.
const SLOW_BEFORE_STOP_M: f64 = 0.1;

/// Checks both tables, where they are.
pub(super) fn check(
    file: &GraphFile,
    robot: Option<&Description>,
    report: &mut impl FnMut(&str, String),
) {
    if let Some(monitors) = &file.monitors {
        monitor_distances(monitors, report);
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
    let speed_m_s = navigation.speed_m_s;
    if let Some(robot) = robot.filter(|robot| speed_m_s > robot.limits.speed_m_s) {
        let message = format!(
            "{speed_m_s} is out of range: allowed is up to {}, the robot's limit",
            robot.limits.speed_m_s
        );
        report("navigation.speed_m_s", message);
    }
    // The robot stands at stop_m: it cannot slow down later.
    let slow_min_m = navigation.stop_m + SLOW_BEFORE_STOP_M;
    at_least(
        "navigation.slow_m",
        navigation.slow_m,
        slow_min_m,
        "stop_m + 0.1",
        report,
    );
    for (i, obstacle) in navigation.obstacle.iter().enumerate() {
        let key = format!("navigation.obstacle.{i}.until_s");
        if let Some(until_s) = obstacle.until_s {
            at_least(&key, until_s, obstacle.from_s, "from_s", report);
        }
    }
    paths(navigation, report);
}

/// A place counts as another from twice the radius within which two are one.
fn monitor_distances(monitors: &MonitorSettings, report: &mut impl FnMut(&str, String)) {
    let least_m = 2.0 * monitors.loop_radius_m;
    let travel_m = monitors.loop_travel_m;
    at_least(
        "monitors.loop_travel_m",
        travel_m,
        least_m,
        "twice loop_radius_m",
        report,
    );
}

fn at_least(key: &str, value: f64, least: f64, what: &str, report: &mut impl FnMut(&str, String)) {
    if value < least {
        let message = format!("{value} is out of range: allowed is {least} or more, {what}");
        report(key, message);
    }
}

fn paths(navigation: &Navigation, report: &mut impl FnMut(&str, String)) {
    let first = navigation.path.first();
    if first.is_some_and(|first| *first != [0.0; 2]) {
        let message = "must begin at [0.0, 0.0], where the robot stands".to_owned();
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

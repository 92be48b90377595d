//! Rules that span keys, rooms or the machine, beyond the ranges of single values.

use std::path::Path;

use vigil_cycle::service;
use vigil_pomdp::{PointBased, Pomdp};
use vigil_robot::channel_model::AXES;
use vigil_robot::channel_model::component::unfit;
use vigil_robot::description::{Kinematics, Limits};
use vigil_robot::kinematics::GeometryError;
use vigil_robot::slip::SlipModel;
use vigil_robot::{AlarmError, Description, RobotModel, declared};

use crate::graph_file::{GraphFile, Socket, Source};

mod navigation;
mod planning;
mod supervisor;

/// Largest length of a graph's name. It stands twice in the paths of sockets, and a longer one has
/// no room below `/run/vigil`; a longer runtime folder leaves less (`vigil_cycle::Domain`).
pub const NAME_LENGTH_MAX: usize = 22;
/// Largest length of the file name of a socket that takes frames. Chosen: as long as anyone needs.
const SOCKET_NAME_LENGTH_MAX: usize = 24;

/// Checks a graph file; `report` gets the key and a message for each problem.
pub(crate) fn graph(
    file: &GraphFile,
    robot: Option<&Description>,
    path: &Path,
    mut report: impl FnMut(&str, String),
) {
    let name = &file.graph.name;
    let legal = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if name.is_empty() || name.len() > NAME_LENGTH_MAX || !name.chars().all(legal) {
        let allowed = format!("1 to {NAME_LENGTH_MAX} letters, digits or '-'");
        report(
            "graph.name",
            format!("'{name}' is not a name: allowed are {allowed}"),
        );
    }
    services(file, &mut report);
    sensor(file, path, &mut report);
    drive(file, robot, &mut report);
    navigation::check(file, robot, &mut report);
    supervisor::check(file, &mut report);
    let blackbox = &file.blackbox;
    if blackbox.folder_mib < 2 * blackbox.memory_mib {
        let least = 2 * blackbox.memory_mib;
        let message = format!("allowed is {least} or more, twice blackbox.memory_mib");
        report("blackbox.folder_mib", message);
    }
}

/// What a planner spends on a decision model; `report` gets the key and a message if that is more
/// than a cycle has time for.
pub(crate) fn planning(
    file: &GraphFile,
    model: &Pomdp,
    solved: Option<&PointBased>,
    report: impl FnOnce(&str, String),
) {
    planning::check(&file.supervisor, model, solved, report);
}

fn services(file: &GraphFile, report: &mut impl FnMut(&str, String)) {
    let stages = [
        ("sensor-sim", &file.services.sensor_sim),
        ("detector", &file.services.detector),
        ("identifier", &file.services.identifier),
        ("supervisor", &file.services.supervisor),
    ];
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let online = online_cores().unwrap_or_else(|| (0..cores).collect());
    for (name, service) in stages {
        if !online.contains(&service.core) {
            let core = service.core;
            let message = format!("core {core} does not exist: this machine has {online:?}");
            report(&format!("services.{name}.core"), message);
        }
        spin((name, service), &stages, file.graph.rate_hz, report);
    }
    for pair in stages.windows(2) {
        let ((before, first), (after, second)) = (pair[0], pair[1]);
        if second.deadline_percent <= first.deadline_percent {
            let key = format!("services.{after}.deadline_percent");
            let message = format!(
                "{} must be above {before}'s {}: a stage cannot be due before its input",
                second.deadline_percent, first.deadline_percent
            );
            report(&key, message);
        }
    }
}

/// One that spins keeps the others off its core. By default the kernel stops real-time threads that
/// take 95 % of a core: a spin of a fifth leaves three quarters of the period for the work.
fn spin(
    (name, service): (&str, &service::Settings),
    all: &[(&str, &service::Settings)],
    rate_hz: f64,
    report: &mut impl FnMut(&str, String),
) {
    let (key, spin_us) = (format!("services.{name}.spin_us"), service.spin_us);
    let longest_us = 0.2e6 / rate_hz;
    if spin_us > longest_us {
        let allowed = format!("0 to {longest_us}, a fifth of the period");
        report(
            &key,
            format!("{spin_us} is out of range: allowed is {allowed}"),
        );
    }
    let shares =
        |(other, o): &&(&str, &service::Settings)| *other != name && o.core == service.core;
    if let Some((other, _)) = all.iter().find(shares).filter(|_| spin_us > 0.0) {
        let core = service.core;
        report(
            &key,
            format!(
                "{spin_us} needs a core of its own, and {other} is on core {core} too: allowed is 0"
            ),
        );
    }
}

fn sensor(file: &GraphFile, path: &Path, report: &mut impl FnMut(&str, String)) {
    let sensor = &file.sensor;
    if sensor.source == Source::Socket {
        socket(&sensor.socket, report);
    }
    if sensor.source == Source::Playback {
        match &sensor.frames {
            None => report(
                "sensor.frames",
                "is required for source = \"playback\"".into(),
            ),
            Some(frames) => {
                let full = path.parent().unwrap_or_else(|| Path::new(".")).join(frames);
                if let Err(error) = std::fs::File::open(&full) {
                    report("sensor.frames", format!("{}: {error}", full.display()));
                }
            }
        }
        if let Some(runs) = &sensor.runs
            && !matches!(runs.as_str(), "all" | "heldout")
            && runs.split(',').any(|id| id.trim().parse::<u32>().is_err())
        {
            let allowed = "'all', 'heldout', or run ids separated by commas";
            report(
                "sensor.runs",
                format!("'{runs}' is not understood: allowed are {allowed}"),
            );
        }
    }
}

fn socket(socket: &Socket, report: &mut impl FnMut(&str, String)) {
    match socket.udp_address() {
        Err(error) => report("sensor.socket.udp", error),
        Ok(Some(address)) if address.port() == 0 => report(
            "sensor.socket.udp",
            "port 0 is any port, which no publisher knows: allowed is 1 to 65535".into(),
        ),
        Ok(_) => {}
    }
    let name = &socket.unix;
    let legal = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let is_name = name.chars().all(legal) && name.len() <= SOCKET_NAME_LENGTH_MAX;
    let is_socket = name
        .strip_suffix(".sock")
        .is_some_and(|stem| !stem.is_empty());
    if !(name.is_empty() || is_name && is_socket) {
        let allowed = format!(
            "at most {SOCKET_NAME_LENGTH_MAX} letters, digits, '-', '_' or '.', ending in '.sock'"
        );
        let message = format!("'{name}' is not a name: allowed are {allowed}");
        report("sensor.socket.unix", message);
    }
    if socket.udp.is_empty() && name.is_empty() {
        report(
            "sensor.socket",
            "udp and unix are empty: source = \"socket\" needs one of them".into(),
        );
    }
}

fn drive(file: &GraphFile, robot: Option<&Description>, report: &mut impl FnMut(&str, String)) {
    let needs_drive = file.sensor.source == Source::Simulator && file.navigation.is_none();
    if needs_drive && file.drive.is_empty() {
        report(
            "drive",
            "at least one [[drive]] segment, or [navigation], is required by the simulator".into(),
        );
    }
    let Some(robot) = robot else { return };
    let (curvature, speed) = (robot.limits.curvature_1_m, robot.limits.speed_m_s);
    for (i, segment) in file.drive.iter().enumerate() {
        let mut limit = |key: &str, value: f64, low: f64, high: f64| {
            if value < low || value > high {
                let message = format!("{value} is out of range: allowed is {low} to {high}");
                report(&format!("drive.{i}.{key}"), message);
            }
        };
        limit(
            "curvature_1_m",
            segment.curvature_1_m,
            -curvature,
            curvature,
        );
        limit("speed_m_s", segment.speed_m_s, f64::MIN, speed);
    }
}

/// Checks that the detector's alarm can rise with this model.
pub(crate) fn alarm(
    file: &GraphFile,
    (model, robot): (&RobotModel, &Description),
    mut report: impl FnMut(&str, String),
) {
    let detector = &file.detector;
    let Some(form) = detector.form.calibrated() else {
        if let Err(error) = declared::tolerance(model, robot) {
            report("detector.form", error.to_string());
        }
        return;
    };
    let of = (detector.sensors.into(), form);
    let (interval_h, rate_1_h) = (detector.false_alarm_interval_h, detector.fault_rate_1_h);
    match model.alarm_log_odds(of, interval_h, rate_1_h) {
        Ok(_) => {}
        Err(error @ AlarmError::Model(_)) => report("detector.sensors", error.to_string()),
        Err(error @ AlarmError::Unreachable { .. }) => {
            report("detector.false_alarm_interval_h", error.to_string());
        }
    }
}

/// Checks a robot's description beyond the ranges of its values; `report` gets the key and a
/// message for each problem.
pub(crate) fn robot(robot: &Description, mut report: impl FnMut(&str, String)) {
    for (i, wheel) in robot.wheels.iter().enumerate() {
        if robot.wheels[..i]
            .iter()
            .any(|other| other.name == wheel.name)
        {
            report(
                &format!("wheels.{i}.name"),
                format!("wheel '{}' appears twice", wheel.name),
            );
        }
    }
    command(robot, &mut report);
    let channels = match robot.has_fault_models() {
        true if !robot.fault.is_empty() => {
            Some("an ackermann6 has no [[fault]]: its faults are modelled".to_owned())
        }
        true if !robot.context.is_empty() => {
            Some("an ackermann6 has no [[context]]: its slip and drag are tracked".to_owned())
        }
        true => None,
        false => unfit(robot),
    };
    if let Some(message) = channels {
        report("channel", message);
    }
    if robot.kinematics != Kinematics::None {
        geometry(robot, &mut report);
    }
    match SlipModel::new(robot) {
        Err(error @ GeometryError::Table { table, .. }) if robot.has_fault_models() => {
            report(table, error.to_string());
        }
        Err(error @ GeometryError::Quantity { quantity, .. }) if quantity.contains('.') => {
            report(quantity, error.to_string());
        }
        _ => {}
    }
}

/// What a robot with a geometry must have.
fn geometry(robot: &Description, report: &mut impl FnMut(&str, String)) {
    let needs = "with these kinematics; a robot of other kinematics has kinematics = \"none\"";
    if robot.wheel_radius_m <= 0.0 {
        let found = robot.wheel_radius_m;
        report(
            "wheel_radius_m",
            format!("{found} is out of range: allowed is above 0 {needs}"),
        );
    }
    if robot.wheels.is_empty() {
        report(
            "wheels",
            format!("no wheels: at least one is needed {needs}"),
        );
    }
    if robot.limits == Limits::default() {
        report("limits", format!("missing: the limits are needed {needs}"));
    }
}

/// Number and names of the command's axes.
fn command(robot: &Description, report: &mut impl FnMut(&str, String)) {
    let axes = robot.command.len();
    let (needed, shown) = match robot.kinematics {
        Kinematics::Ackermann6 => (2..=2, "curvature and speed"),
        Kinematics::Differential => (2..=2, "speed and yaw rate"),
        Kinematics::Omni3 => (
            2..=3,
            "forward and left velocity, and yaw rate if it is commanded",
        ),
        Kinematics::None => (0..=AXES, "up to four axes"),
    };
    if !needed.contains(&axes) {
        report("command", format!("{axes} axes: allowed are {shown}"));
    }
    for (i, axis) in robot.command.iter().enumerate() {
        if axis.name.is_empty() || matches!(axis.name.as_str(), "run" | "t" | "x" | "y" | "yaw") {
            let message = format!("'{}' cannot be the name of an axis", axis.name);
            report(&format!("command.{i}.name"), message);
        }
    }
}

/// Online cores by number, from the kernel (`0-3,6`).
fn online_cores() -> Option<Vec<usize>> {
    let text = std::fs::read_to_string("/sys/devices/system/cpu/online").ok()?;
    let mut cores = Vec::new();
    for part in text.trim().split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        cores.extend(first.parse::<usize>().ok()?..=last.parse::<usize>().ok()?);
    }
    Some(cores)
}

//! Whether recorded runs mean what their columns say: units, signs, sides.
//!
//! A healthy robot does roughly what it is commanded. [`PublisherCheck`] tests a recording as it
//! tests a live publisher. Two things show only over a whole run: a command that no robot of this
//! description takes, and a channel that never changes. The tests do not judge frames of a slow
//! log; [`slow`] says so.

use vigil_blocks::SensorFrame;
use vigil_recording::frames::{Field, Run, fields};
use vigil_robot::Description;
use vigil_robot::channel::Role;
use vigil_robot::description::Kinematics;
use vigil_robot::publisher_check::{FindingKind, PAUSE_S, PublisherCheck, YAW_RATE_UNITS};

/// Frames in motion from which a channel that never changes is a doubt, and pairs of frames from
/// which their spacing is known: a second at 20 Hz. With fewer, a coarse encoder at a steady speed
/// is doubted; more leave short runs unchecked.
const FRAMES_MIN: usize = 20;
/// Commanded turn from which a constant yaw is a doubt, rad: thirty deviations of a yaw noise of
/// 5 mrad.
const TURN_MIN_RAD: f64 = 0.15;
/// Factor on the limit of a command beyond which its unit is doubted: that of feet, 3.3, is the
/// smallest of a unit.
const LIMIT_FACTOR: f64 = 3.0;

/// A doubt about one run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("run {run}: {doubt}")]
pub struct RunDoubt {
    /// The run.
    pub run: u32,
    /// What cannot be as its columns say.
    pub doubt: String,
}

/// What a run shows about its columns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunCheck {
    /// The first doubt.
    pub doubt: Option<RunDoubt>,
    /// Whether its motion was enough to judge anything.
    pub is_judged: bool,
}

impl RunCheck {
    /// Checks the first `until_s` seconds of a run, in which the robot is taken to be healthy.
    #[must_use]
    pub fn new(run: &Run, robot: &Description, until_s: f64) -> Self {
        let used = beginning(run, until_s);
        let mut check = PublisherCheck::new(robot);
        let findings: Vec<_> = used.iter().filter_map(|frame| check.take(frame)).collect();
        // A yaw of the wrong sign or unit puts the direction of travel in doubt too.
        let cause = findings
            .iter()
            .find(|finding| finding.kind != FindingKind::Heading)
            .or(findings.first());
        let doubt = beyond_limits(&used, robot)
            .or_else(|| constant_channel(&used, robot))
            .or_else(|| cause.map(|finding| finding.text(robot)));
        Self {
            is_judged: doubt.is_some() || check.has_judged(),
            doubt: doubt.map(|doubt| RunDoubt { run: run.id, doubt }),
        }
    }
}

/// What most runs have in common, so that single faulty runs are no reason to doubt the columns.
/// Runs that are too slow to be judged are named too. Each run comes with the time until which it
/// may be healthy, s.
#[must_use]
pub fn warnings<'a>(
    runs: impl IntoIterator<Item = (&'a Run, f64)>,
    robot: &Description,
) -> Vec<String> {
    let runs: Vec<(&Run, f64)> = runs.into_iter().collect();
    let checks = runs
        .iter()
        .map(|(run, healthy_s)| RunCheck::new(run, robot, *healthy_s));
    let judged: Vec<RunCheck> = checks.filter(|check| check.is_judged).collect();
    let doubts: Vec<&RunDoubt> = judged.iter().filter_map(|c| c.doubt.as_ref()).collect();
    let (found, all) = (doubts.len(), judged.len());
    let mut warnings = match doubts.first().filter(|_| 2 * found >= all) {
        None => Vec::new(),
        Some(first) => vec![
            first.to_string(),
            format!(
                "{found} of {all} runs that can be judged are like this: unless all are faulty, \
                 verdicts are wrong"
            ),
        ],
    };
    warnings.extend(slow(runs, robot));
    warnings
}

/// That runs are not judged, as their frames are further apart than [`PAUSE_S`]: the tests take
/// each for the first after a pause. None if no run is like this. Each run comes with the time
/// until which it may be healthy, s.
#[must_use]
pub fn slow<'a>(
    runs: impl IntoIterator<Item = (&'a Run, f64)>,
    robot: &Description,
) -> Option<String> {
    let spacing = |(run, healthy_s): (&Run, f64)| {
        let spacing_s = spacing_s(&beginning(run, healthy_s), robot)?;
        Some((run.id, spacing_s))
    };
    let spacings: Vec<(u32, f64)> = runs.into_iter().filter_map(spacing).collect();
    let mut slow = spacings
        .iter()
        .filter(|(_, spacing_s)| *spacing_s > PAUSE_S);
    let (all, found) = (spacings.len(), slow.clone().count());
    let (run, spacing_s) = slow.next()?;
    Some(format!(
        "units, signs and sides of {found} of {all} runs are NOT judged: in run {run} t advances \
         by {spacing_s:.3} s from frame to frame, allowed is {PAUSE_S} s; is t in ms?"
    ))
}

/// Median time between consecutive frames in motion, s; of two in the middle the longer. None if
/// there are too few.
fn spacing_s(frames: &[&SensorFrame], robot: &Description) -> Option<f64> {
    let pairs = frames.windows(2);
    let moving = pairs.filter(|pair| pair.iter().all(|frame| moves(frame, robot)));
    let t_ns = |frame: &SensorFrame| frame.header.t_capture_ns;
    let mut spacings_ns: Vec<u64> = moving
        .map(|pair| t_ns(pair[1]).saturating_sub(t_ns(pair[0])))
        .collect();
    if spacings_ns.len() < FRAMES_MIN {
        return None;
    }
    let middle = spacings_ns.len() / 2;
    let (_, median_ns, _) = spacings_ns.select_nth_unstable(middle);
    Some(*median_ns as f64 * 1e-9)
}

/// The frames of the first `until_s` seconds.
fn beginning(run: &Run, until_s: f64) -> Vec<&SensorFrame> {
    let is_used = |frame: &&SensorFrame| seconds(frame) <= until_s;
    run.frames.iter().take_while(is_used).collect()
}

/// True if the frame's command asks for motion.
fn moves(frame: &SensorFrame, robot: &Description) -> bool {
    robot.is_told_to_move(&frame.command)
}

fn seconds(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

/// Units that a speed may be in instead of m/s, and how much larger it then reads.
const SPEEDS: [(f64, &str); 3] = [(3.281, "feet/s"), (100.0, "cm/s"), (1000.0, "mm/s")];

/// The units in which a command that is `ratio` times its limit would be within it, as a question.
fn units_within(ratio: f64, unit: &str) -> String {
    let units: &[(f64, &str)] = match unit {
        "m/s" => &SPEEDS,
        "rad/s" => &YAW_RATE_UNITS,
        _ => &[],
    };
    // A command may be a little beyond its limit.
    let within = units.iter().filter(|(factor, _)| ratio <= 1.001 * factor);
    let names: Vec<&str> = within.map(|(_, name)| *name).collect();
    match names.is_empty() {
        true => "another unit".to_owned(),
        false => names.join(" or "),
    }
}

/// A command far beyond the description's limit.
fn beyond_limits(frames: &[&SensorFrame], robot: &Description) -> Option<String> {
    robot.command.iter().enumerate().find_map(|(i, axis)| {
        let sizes = frames.iter().filter_map(|f| Field::Command(i).get(f));
        let largest = sizes.map(f64::abs).fold(0.0, f64::max);
        (largest > LIMIT_FACTOR * axis.limit).then(|| {
            let (name, limit, unit) = (&axis.name, axis.limit, &axis.unit);
            let asked = units_within(largest / limit, unit);
            format!("{name} is up to {largest}; allowed is {limit} {unit}: is it in {asked}?")
        })
    })
}

/// A channel that reads the same throughout, though the command moves it.
fn constant_channel(frames: &[&SensorFrame], robot: &Description) -> Option<String> {
    let moving = frames.iter().filter(|frame| moves(frame, robot));
    let moving: Vec<&SensorFrame> = moving.copied().collect();
    if moving.len() < FRAMES_MIN {
        return None;
    }
    let turn = |pair: &[&SensorFrame]| {
        let dt_s = seconds(pair[1]) - seconds(pair[0]);
        robot.twist(&pair[0].command)[2].abs() * dt_s
    };
    let turns = moving.windows(2).map(turn).sum::<f64>() >= TURN_MIN_RAD;
    let constant = |field: Field| {
        let mut values = moving.iter().map(|frame| field.get(frame));
        let first = values.next()??;
        values.all(|value| value == Some(first)).then_some(first)
    };
    let mut still_wheels = Vec::new();
    for (name, field) in fields(robot) {
        let Some(value) = constant(field) else {
            continue;
        };
        match field {
            Field::Channel {
                role: Role::PoseYaw,
                ..
            } if turns => {
                return Some(format!(
                    "yaw is {value} throughout, though a turn is commanded"
                ));
            }
            Field::Channel {
                role: Role::WheelRate,
                ..
            } => still_wheels.push(format!(
                "{name} is {value} throughout, though motion is commanded"
            )),
            _ => {}
        }
    }
    // In some directions a wheel of an omnidirectional robot does not roll.
    let needed = match robot.kinematics {
        Kinematics::Omni3 => robot.wheels.len(),
        Kinematics::Ackermann6 | Kinematics::Differential | Kinematics::None => 1,
    };
    (still_wheels.len() >= needed).then(|| still_wheels.swap_remove(0))
}

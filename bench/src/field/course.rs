//! What is driven.

use rand::{Rng, RngExt};
use vigil_robot::Description;
use vigil_robot::learned::model::CommandModel;
use vigil_setup::graph_file::DriveSegment;

/// Time that a command lasts, s.
const COMMAND_S: std::ops::Range<f64> = 3.0..10.0;
/// Time that a stop lasts, s.
const STOP_S: std::ops::Range<f64> = 2.0..6.0;
/// Speed of a healthy rover that creeps, m/s.
const CREEP_M_S: f64 = 0.015;
/// Part of the robot's own limit from which a turn is tight.
const TIGHT: f64 = 0.8;

/// Kind of a command in a random drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Usual,
    Stop,
    Reverse,
    Creep,
    Tight,
}

/// What a robot can be commanded.
#[derive(Debug, Clone, Copy)]
pub struct Range<'a> {
    /// What was learned of its commands.
    pub command: &'a CommandModel,
    /// Its description.
    pub robot: &'a Description,
    /// The drive of its graph.
    pub graph: &'a [DriveSegment],
}

/// The segments of a drive of `run_s` at least.
///
/// # Errors
/// A drive that is not known, with what is allowed.
pub fn course(
    name: &str,
    range: Range<'_>,
    run_s: f64,
    rng: &mut impl Rng,
) -> Result<Vec<DriveSegment>, String> {
    use Kind::{Creep, Reverse, Stop, Tight, Usual};
    // Each kind as often as it is named.
    let kinds: &[Kind] = match name {
        "random" => &[Usual],
        "stops" => &[Usual, Usual, Stop],
        "reversals" => &[Usual, Reverse],
        "creep" => &[Usual, Creep],
        "tight" => &[Usual, Tight],
        "mixed" => &[
            Usual, Usual, Usual, Usual, Usual, Stop, Reverse, Creep, Tight,
        ],
        "graph" => return Ok(range.graph.to_vec()),
        text => return given(text),
    };
    let (mut drive, mut total_s) = (Vec::new(), 0.0);
    while total_s < run_s {
        let kind = kinds[rng.random_range(0..kinds.len())];
        let segment = command(kind, range, rng);
        total_s += segment.duration_s;
        drive.push(segment);
    }
    Ok(drive)
}

fn command(kind: Kind, range: Range<'_>, rng: &mut impl Rng) -> DriveSegment {
    let learned = range.command.curvature_max_1_m;
    let [slowest, fastest] = range.command.speed_range_m_s;
    let duration_s = rng.random_range(COMMAND_S);
    let curvature_1_m = rng.random_range(-learned..learned);
    let speed_m_s = rng.random_range(slowest..fastest);
    let usual = DriveSegment {
        duration_s,
        curvature_1_m,
        speed_m_s,
    };
    match kind {
        Kind::Usual => usual,
        Kind::Stop => DriveSegment {
            duration_s: rng.random_range(STOP_S),
            speed_m_s: 0.0,
            ..usual
        },
        Kind::Reverse => DriveSegment {
            speed_m_s: -speed_m_s,
            ..usual
        },
        Kind::Creep => DriveSegment {
            speed_m_s: CREEP_M_S,
            ..usual
        },
        Kind::Tight => {
            let limit = range.robot.limits.curvature_1_m;
            let tight = rng.random_range(TIGHT * limit..limit);
            DriveSegment {
                curvature_1_m: tight.copysign(curvature_1_m),
                ..usual
            }
        }
    }
}

/// Segments as they stand in the file.
fn given(text: &str) -> Result<Vec<DriveSegment>, String> {
    let wrong = || {
        format!(
            "drive '{text}': allowed are random, stops, reversals, creep, tight, mixed, graph, or \
             CURVATURE_1_M:SPEED_M_S:S joined by commas"
        )
    };
    let segment = |part: &str| {
        let numbers: Result<Vec<f64>, _> = part.trim().split(':').map(str::parse).collect();
        let [curvature_1_m, speed_m_s, duration_s] = numbers.map_err(|_| wrong())?[..] else {
            return Err(wrong());
        };
        Ok(DriveSegment {
            duration_s,
            curvature_1_m,
            speed_m_s,
        })
    };
    text.split(',').map(segment).collect()
}

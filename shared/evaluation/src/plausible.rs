//! Whether recorded runs mean what their columns say: units, signs, sides.
//!
//! A healthy robot does roughly what it is commanded. Where it moves a thousand times as far, turns
//! the other way or rolls on the wrong side, the columns hold something else than they should. Each
//! figure is a ratio to the command over the whole of a stretch, so that sensor noise and soil
//! leave it near 1; a doubt needs a ratio that no ground explains.

use std::f64::consts::{PI, TAU};
use std::fmt;

use vigil_blocks::{SensorFrame, Valid};
use vigil_inference::angle::wrap;
use vigil_robot::Description;
use vigil_robot::learned::wheels::rolling_rate;

use crate::frames::Run;

/// Speed from which a robot counts as commanded to move, m/s.
const MOVING_M_S: f64 = 0.02;
/// Least duration of a chord, s, and frames in it: a fifth of them is averaged at either end.
const CHORD_S: f64 = 1.0;
const CHORD_FRAMES: usize = 10;
/// Commanded travel (m) and turn (rad) below which nothing is judged.
const TRAVEL_MIN_M: f64 = 0.25;
const TURN_MIN_RAD: f64 = 0.15;
/// A ratio within this factor of 1 is no doubt: ground and faults do as much.
const RATIO_MAX: f64 = 3.0;
/// Curvature from which left and right wheels differ enough to be told apart, 1/m.
const TURNING_1_M: f64 = 0.15;

/// What cannot be as the columns say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// Travelled so many times the commanded distance.
    Travel(f64),
    /// Moved at this angle to its yaw, rad, where 0 is commanded.
    Heading(f64),
    /// Turned so many times the commanded angle.
    Turn(f64),
    /// Every yaw is the same, this one, in a turn.
    YawConstant(f64),
    /// The wheels turn so many times as fast as they should roll.
    Rates(f64),
    /// Every rate of this wheel is the same, this one.
    RateConstant(usize, f64),
    /// Left wheels turn as right ones should, and right as left.
    Sides,
}

/// A doubt about one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubtful {
    /// The run.
    pub run: u32,
    /// What is wrong with it.
    pub doubt: Doubt,
    /// Name of the wheel, where the doubt is about one.
    pub wheel: String,
}

impl fmt::Display for Doubtful {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "run {}: ", self.run)?;
        match self.doubt {
            Doubt::Travel(ratio) => {
                write!(f, "x and y move {ratio:.4} times the commanded travel")?;
                write!(f, "; 1 is expected{}", unit(ratio, &TRAVEL_UNITS))
            }
            Doubt::Heading(angle) => {
                write!(f, "x and y move at {angle:.2} rad to yaw; 0 is expected: ")?;
                write!(f, "is yaw 0 along x and positive to the left (y)?")
            }
            Doubt::Turn(ratio) => {
                write!(
                    f,
                    "yaw turns {ratio:.3} times the commanded angle; 1 is expected"
                )?;
                if ratio < 0.0 {
                    return write!(
                        f,
                        ": is yaw or cmd_curv positive to the right? Left is positive"
                    );
                }
                write!(f, "{}", unit(ratio, &TURN_UNITS))
            }
            Doubt::YawConstant(yaw) => {
                write!(f, "yaw is {yaw} throughout, though a turn is commanded")
            }
            Doubt::Rates(ratio) => {
                write!(
                    f,
                    "the wheels turn {ratio:.4} times as fast as the command makes them roll"
                )?;
                write!(f, "; 1 is expected{}", unit(ratio, &RATE_UNITS))
            }
            Doubt::RateConstant(_, rate) => {
                write!(
                    f,
                    "enc_{} is {rate} throughout, though motion is commanded",
                    self.wheel
                )
            }
            Doubt::Sides => {
                write!(
                    f,
                    "left wheels turn as right ones should and right as left: "
                )?;
                write!(
                    f,
                    "are their columns exchanged, or is cmd_curv positive to the right?"
                )
            }
        }
    }
}

/// Factors that units make, and the units.
const TRAVEL_UNITS: [(f64, &str); 6] = [
    (1000.0, "x and y in mm (or cmd_speed in km/s)"),
    (100.0, "x and y in cm"),
    (39.37, "x and y in inches"),
    (3.281, "x and y in feet"),
    (0.01, "cmd_speed in cm/s"),
    (0.001, "t in ms, cmd_speed in mm/s, or x and y in km"),
];
const TURN_UNITS: [(f64, &str); 2] = [
    (180.0 / PI, "yaw in degrees"),
    (0.001, "t in ms, cmd_speed in mm/s or cmd_curv in 1/km"),
];
const RATE_UNITS: [(f64, &str); 5] = [
    (180.0 / PI, "rates in deg/s"),
    (60.0 / TAU, "rates in rpm"),
    (1.0 / TAU, "rates in revolutions per second"),
    (0.001, "cmd_speed in mm/s"),
    (-1.0, "rates of the other sign"),
];

/// Names the unit whose factor is within a fifth of the ratio.
fn unit(ratio: f64, units: &[(f64, &str)]) -> String {
    let near = |factor: f64| (0.8..1.25).contains(&(ratio / factor));
    match units.iter().find(|(factor, _)| near(*factor)) {
        Some((_, name)) => format!(": {name}?"),
        None => String::new(),
    }
}

/// What is doubtful about the first `until_s` seconds of a run, in which the robot is taken to be
/// healthy. None if all is well or the stretch tells nothing.
#[must_use]
pub fn doubt(run: &Run, robot: &Description, until_s: f64) -> Option<Doubtful> {
    let moving: Vec<&SensorFrame> = run
        .frames
        .iter()
        .take_while(|frame| frame.header.t_capture_ns as f64 * 1e-9 <= until_s)
        .filter(|frame| frame.command[1].abs() >= MOVING_M_S)
        .collect();
    let found = doubt_pose(&moving).or_else(|| doubt_wheels(&moving, robot))?;
    let wheel = match found {
        Doubt::RateConstant(wheel, _) => robot.wheels[wheel].name.clone(),
        _ => String::new(),
    };
    let run = run.id;
    Some(Doubtful {
        run,
        doubt: found,
        wheel,
    })
}

/// Sums over the chords of a stretch.
#[derive(Default)]
struct Driven {
    travel_m: f64,
    commanded_m: f64,
    turn_rad: f64,
    commanded_rad: f64,
    /// Displacement along and to the left of the heading, in the direction commanded.
    along_m: f64,
    left_m: f64,
}

fn doubt_pose(frames: &[&SensorFrame]) -> Option<Doubt> {
    let driven = driven(frames);
    if driven.commanded_m < TRAVEL_MIN_M {
        return None;
    }
    let travel = driven.travel_m / driven.commanded_m;
    if !(1.0 / RATIO_MAX..=RATIO_MAX).contains(&travel) {
        return Some(Doubt::Travel(travel));
    }
    if driven.commanded_rad >= TURN_MIN_RAD {
        let first = frames.first()?.pose[2];
        if frames.iter().all(|frame| frame.pose[2] == first) {
            return Some(Doubt::YawConstant(first));
        }
        let turn = driven.turn_rad / driven.commanded_rad;
        if !(1.0 / RATIO_MAX..=RATIO_MAX).contains(&turn) {
            return Some(Doubt::Turn(turn));
        }
    }
    let angle = driven.left_m.atan2(driven.along_m);
    (angle.abs() > 0.5).then_some(Doubt::Heading(angle))
}

fn seconds(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

fn driven(frames: &[&SensorFrame]) -> Driven {
    let mut out = Driven::default();
    let mut from = 0;
    while let Some(start) = frames.get(from) {
        let until = seconds(start) + CHORD_S;
        let Some(long) = frames[from..].iter().position(|f| seconds(f) >= until) else {
            break;
        };
        let to = from + long.max(CHORD_FRAMES);
        let Some(chord) = frames.get(from..=to) else {
            break;
        };
        out.add(chord);
        from = to;
    }
    out
}

impl Driven {
    fn add(&mut self, chord: &[&SensorFrame]) {
        let end = chord.len().div_ceil(5);
        let (start, start_s) = mean(&chord[..end]);
        let (stop, stop_s) = mean(&chord[chord.len() - end..]);
        let speed = chord.iter().map(|f| f.command[1]).sum::<f64>() / chord.len() as f64;
        let curved: f64 = chord.iter().map(|f| f.command[0] * f.command[1]).sum();
        let commanded = curved / chord.len() as f64 * (stop_s - start_s);
        let (dx, dy) = (stop[0] - start[0], stop[1] - start[1]);
        let turn = wrap(stop[2] - start[2]);
        let (sin, cos) = (start[2] + 0.5 * turn).sin_cos();
        self.travel_m += dx.hypot(dy);
        self.commanded_m += speed.abs() * (stop_s - start_s);
        self.turn_rad += turn * commanded.signum();
        self.commanded_rad += commanded.abs();
        self.along_m += (dx * cos + dy * sin) * speed.signum();
        self.left_m += (dy * cos - dx * sin) * speed.signum();
    }
}

/// Mean pose and mean time.
fn mean(frames: &[&SensorFrame]) -> ([f64; 3], f64) {
    let Some(first) = frames.first() else {
        return ([0.0; 3], 0.0);
    };
    let count = frames.len() as f64;
    let apart = |axis: usize, frame: &SensorFrame| match axis {
        2 => wrap(frame.pose[2] - first.pose[2]),
        _ => frame.pose[axis] - first.pose[axis],
    };
    let axis = |axis: usize| {
        let sum: f64 = frames.iter().map(|frame| apart(axis, frame)).sum();
        first.pose[axis] + sum / count
    };
    let time = frames.iter().map(|frame| seconds(frame)).sum::<f64>() / count;
    ([axis(0), axis(1), axis(2)], time)
}

fn doubt_wheels(frames: &[&SensorFrame], robot: &Description) -> Option<Doubt> {
    let wheels = robot.wheels.len();
    let has = |wheel| {
        frames
            .iter()
            .all(|frame| frame.has(Valid::wheel_rate(wheel)))
    };
    if frames.len() < 20 || !(0..wheels).all(has) {
        return None;
    }
    let rolling =
        |wheel, frame: &SensorFrame| rolling_rate(robot, wheel, frame.command[0], frame.command[1]);
    let mut ratios: Vec<f64> = Vec::new();
    for wheel in 0..wheels {
        let first = frames[0].wheel_rate[wheel];
        if frames.iter().all(|frame| frame.wheel_rate[wheel] == first) {
            return Some(Doubt::RateConstant(wheel, first));
        }
        let found: f64 = frames.iter().map(|frame| frame.wheel_rate[wheel]).sum();
        let expected: f64 = frames.iter().map(|frame| rolling(wheel, frame)).sum();
        ratios.push(found / expected);
    }
    ratios.sort_by(f64::total_cmp);
    let middle = ratios.get(wheels / 2).copied().filter(|r| r.is_finite())?;
    if !(1.0 / RATIO_MAX..=RATIO_MAX).contains(&middle) {
        return Some(Doubt::Rates(middle));
    }
    // With the curvature's sign changed a wheel rolls as the one opposite does.
    let (mut as_named, mut exchanged, mut turning) = (0.0, 0.0, 0);
    for frame in frames.iter().filter(|f| f.command[0].abs() >= TURNING_1_M) {
        turning += 1;
        for wheel in 0..wheels {
            let rate = frame.wheel_rate[wheel];
            let other = rolling_rate(robot, wheel, -frame.command[0], frame.command[1]);
            as_named += (rate - rolling(wheel, frame)).powi(2);
            exchanged += (rate - other).powi(2);
        }
    }
    (turning >= 20 && exchanged < 0.5 * as_named).then_some(Doubt::Sides)
}

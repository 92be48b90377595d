#![doc = include_str!("../README.md")]

mod chords;

use std::f64::consts::{PI, TAU};
use std::fmt;

use vigil_blocks::{SensorFrame, Valid};
use vigil_robot::Description;
use vigil_robot::description::Kinematics;

use chords::Chord;
use vigil_recording::frames::Run;

/// Speed from which a robot counts as commanded to move, m/s.
const MOVING_M_S: f64 = 0.02;
/// Commanded travel (m) and turn (rad) below which nothing is judged.
const TRAVEL_MIN_M: f64 = 0.25;
const TURN_MIN_RAD: f64 = 0.15;
/// A ratio within this factor of 1 is no doubt: ground and faults do as much.
const RATIO_MAX: f64 = 3.0;
/// Curvature from which left and right wheels differ enough to be distinguished, 1/m.
const TURNING_1_M: f64 = 0.15;
/// Frames from which wheel rates are judged.
const FRAMES_MIN: usize = 20;
/// Commanded motion at the beginning of a run in which it is judged what its columns mean, s.
const BEGINNING_S: f64 = 3.0;

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
    /// The gyro turns so many times the commanded angle.
    Gyro(f64),
    /// The wheels turn so many times as fast as they should roll.
    Rates(f64),
    /// Every rate of this wheel is the same, this one.
    RateConstant(usize, f64),
    /// Left wheels turn as right ones should, and right as left.
    Sides,
}

/// A doubt about one run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunDoubt {
    /// The run.
    pub run: u32,
    /// What is wrong with it.
    pub doubt: Doubt,
    /// Name of the wheel, where the doubt is about one.
    pub wheel: String,
    /// Names of the command's axes that ask for speed and for turns.
    pub axes: [String; 2],
}

impl fmt::Display for RunDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "run {}: ", self.run)?;
        let [_, turning] = &self.axes;
        let unit = |ratio: f64, units: &[(f64, &str)]| self.unit(ratio, units);
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
                        ": is yaw or {turning} positive to the right? Left is positive"
                    );
                }
                write!(f, "{}", unit(ratio, &TURN_UNITS))
            }
            Doubt::Gyro(ratio) => {
                write!(f, "yaw_rate is {ratio:.3} times the commanded one")?;
                write!(f, "; 1 is expected")?;
                if ratio < 0.0 {
                    let question = "positive to the right? Left is positive";
                    return write!(f, ": is yaw_rate or {turning} {question}");
                }
                write!(f, "{}", unit(ratio, &GYRO_UNITS))
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
                    "are their columns exchanged, or is {turning} positive to the right?"
                )
            }
        }
    }
}

/// Factors that units make, and the units; `{speed}` and `{turn}` stand for the command's axes.
const TRAVEL_UNITS: [(f64, &str); 6] = [
    (1000.0, "x and y in mm (or {speed} in km/s)"),
    (100.0, "x and y in cm"),
    (39.37, "x and y in inches"),
    (3.281, "x and y in feet"),
    (0.01, "{speed} in cm/s"),
    (0.001, "t in ms, {speed} in mm/s, or x and y in km"),
];
const TURN_UNITS: [(f64, &str); 3] = [
    (180.0 / PI, "yaw in degrees"),
    (PI / 180.0, "{turn} in degrees"),
    (0.001, "t in ms, {speed} in mm/s or {turn} in thousandths"),
];
const GYRO_UNITS: [(f64, &str); 3] = [
    (180.0 / PI, "yaw_rate in deg/s"),
    (PI / 180.0, "{turn} in degrees"),
    (1000.0, "yaw_rate in mrad/s"),
];
const RATE_UNITS: [(f64, &str); 5] = [
    (180.0 / PI, "rates in deg/s"),
    (60.0 / TAU, "rates in rpm"),
    (1.0 / TAU, "rates in revolutions per second"),
    (0.001, "{speed} in mm/s"),
    (-1.0, "rates of the other sign"),
];

impl RunDoubt {
    /// Names the unit whose factor is within a fifth of the ratio.
    fn unit(&self, ratio: f64, units: &[(f64, &str)]) -> String {
        let near = |factor: f64| (0.8..1.25).contains(&(ratio / factor));
        let [speed, turn] = &self.axes;
        match units.iter().find(|(factor, _)| near(*factor)) {
            Some((_, name)) => {
                let name = name.replace("{speed}", speed).replace("{turn}", turn);
                format!(": {name}?")
            }
            None => String::new(),
        }
    }
}

/// What is doubtful about the first `until_s` seconds of a run, in which the robot is taken to be
/// healthy. None if all is well or the stretch tells nothing.
#[must_use]
pub fn doubt(run: &Run, robot: &Description, until_s: f64) -> Option<RunDoubt> {
    let moves = |frame: &&SensorFrame| is_moving(frame, robot);
    let until = |frame: &&SensorFrame| seconds(frame) <= until_s;
    let frames: Vec<&SensorFrame> = run.frames.iter().take_while(until).collect();
    let pieces: Vec<&[&SensorFrame]> = frames
        .chunk_by(|a, b| moves(a) == moves(b))
        .filter(|piece| piece.first().is_some_and(moves))
        .collect();
    let found = doubt_pose(&pieces, robot)
        .or_else(|| doubt_gyro(&pieces, robot))
        .or_else(|| doubt_wheels(&pieces, robot))?;
    let wheel = match found {
        Doubt::RateConstant(wheel, _) => robot.wheels.get(wheel).map(|wheel| wheel.name.clone()),
        _ => None,
    };
    let [speed, turn] = match robot.kinematics {
        Kinematics::Ackermann6 => [1, 0],
        Kinematics::Differential => [0, 1],
        Kinematics::Omni3 => [0, 2],
    };
    let axis = |i: usize| {
        robot
            .command
            .get(i)
            .map_or("the command", |axis| &axis.name)
    };
    Some(RunDoubt {
        run: run.id,
        doubt: found,
        wheel: wheel.unwrap_or_default(),
        axes: [axis(speed).to_owned(), axis(turn).to_owned()],
    })
}

/// True if the first `until_s` seconds of a run hold motion enough to be judged.
#[must_use]
pub fn is_judged(run: &Run, robot: &Description, until_s: f64) -> bool {
    let until = run.frames.iter().take_while(|f| seconds(f) <= until_s);
    until.filter(|frame| is_moving(frame, robot)).count() >= FRAMES_MIN
}

/// What the beginnings of most runs have in common, so that single runs that begin with a fault are
/// no reason to doubt the columns. Each run comes with the time until which it may be healthy, s.
#[must_use]
pub fn warnings<'a>(
    runs: impl IntoIterator<Item = (&'a Run, f64)>,
    robot: &Description,
) -> Vec<String> {
    let (mut doubts, mut all) = (Vec::new(), 0);
    for (run, healthy_s) in runs {
        let until_s = beginning_s(run, robot).min(healthy_s);
        all += usize::from(is_judged(run, robot, until_s));
        doubts.extend(doubt(run, robot, until_s));
    }
    let found = doubts.len();
    match doubts.first().filter(|_| 2 * found >= all) {
        None => Vec::new(),
        Some(first) => vec![
            first.to_string(),
            format!(
                "{found} of {all} runs that can be judged begin like this: unless all are faulty, \
                 verdicts are wrong"
            ),
        ],
    }
}

/// Time at which a run has been commanded to move for [`BEGINNING_S`], s.
fn beginning_s(run: &Run, robot: &Description) -> f64 {
    let mut moved_s = 0.0;
    for pair in run.frames.windows(2) {
        let [before, now] = pair else { continue };
        if is_moving(now, robot) {
            moved_s += seconds(now) - seconds(before);
        }
        if moved_s >= BEGINNING_S {
            return seconds(now);
        }
    }
    f64::INFINITY
}

fn is_moving(frame: &SensorFrame, robot: &Description) -> bool {
    robot.path_speed_m_s(robot.twist(&frame.command)) >= MOVING_M_S
}

fn seconds(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

fn is_doubtful(ratio: f64) -> bool {
    !(1.0 / RATIO_MAX..=RATIO_MAX).contains(&ratio)
}

/// Sums over the chords of a stretch.
#[derive(Default)]
struct ChordSums {
    travel_m: f64,
    commanded_m: f64,
    turn_rad: f64,
    commanded_rad: f64,
    /// Displacement along the commanded direction and to its left.
    along_m: f64,
    left_m: f64,
}

impl ChordSums {
    fn add(&mut self, chord: &Chord<'_>, robot: &Description) {
        let twist = chord.mean_twist(robot);
        let (duration_s, [x, y, turn]) = (chord.duration_s(), chord.moved());
        let speed = twist[0].hypot(twist[1]);
        let commanded = twist[2] * duration_s;
        self.turn_rad += turn * commanded.signum();
        self.commanded_rad += commanded.abs();
        // A turn in place goes nowhere.
        if speed >= MOVING_M_S {
            let (sin, cos) = twist[1].atan2(twist[0]).sin_cos();
            self.travel_m += x.hypot(y);
            self.commanded_m += speed * duration_s;
            self.along_m += x * cos + y * sin;
            self.left_m += y * cos - x * sin;
        }
    }
}

fn doubt_pose(pieces: &[&[&SensorFrame]], robot: &Description) -> Option<Doubt> {
    if !have(pieces, Valid::POSE) {
        return None;
    }
    let mut driven = ChordSums::default();
    chords::chords(pieces).for_each(|chord| driven.add(&chord, robot));
    if driven.commanded_m >= TRAVEL_MIN_M {
        let travel = driven.travel_m / driven.commanded_m;
        if is_doubtful(travel) {
            return Some(Doubt::Travel(travel));
        }
    }
    if driven.commanded_rad >= TURN_MIN_RAD {
        let mut yaws = pieces
            .iter()
            .flat_map(|p| p.iter())
            .map(|frame| frame.pose[2]);
        let first = yaws.next()?;
        if yaws.all(|yaw| yaw == first) {
            return Some(Doubt::YawConstant(first));
        }
        let turn = driven.turn_rad / driven.commanded_rad;
        if is_doubtful(turn) {
            return Some(Doubt::Turn(turn));
        }
    }
    if driven.commanded_m < TRAVEL_MIN_M {
        return None;
    }
    let angle = driven.left_m.atan2(driven.along_m);
    (angle.abs() > 0.5).then_some(Doubt::Heading(angle))
}

/// True if every frame holds a channel.
fn have(pieces: &[&[&SensorFrame]], bit: u64) -> bool {
    pieces
        .iter()
        .flat_map(|p| p.iter())
        .all(|frame| frame.has(bit))
}

fn doubt_gyro(pieces: &[&[&SensorFrame]], robot: &Description) -> Option<Doubt> {
    if !have(pieces, Valid::YAW_RATE) {
        return None;
    }
    let (mut turned_rad, mut found, mut expected) = (0.0, 0.0, 0.0);
    for chord in chords::chords(pieces) {
        let commanded = chord.mean_twist(robot)[2];
        turned_rad += commanded.abs() * chord.duration_s();
        found += chord.mean(|frame| frame.yaw_rate) * commanded;
        expected += commanded * commanded;
    }
    let ratio = found / expected;
    (turned_rad >= TURN_MIN_RAD && is_doubtful(ratio)).then_some(Doubt::Gyro(ratio))
}

/// Rates at which the wheels roll without slip, rad/s; none where that depends on how they are
/// built in.
fn rolling(robot: &Description, wheel: usize, command: &[f64]) -> Option<f64> {
    let [speed, _, turn] = robot.twist(command);
    match robot.kinematics {
        Kinematics::Ackermann6 => {
            let curvature = command.first().copied().unwrap_or(0.0);
            let rate = vigil_robot::learned::wheels::rolling_rate;
            Some(rate(robot, wheel, curvature, speed))
        }
        Kinematics::Differential => {
            let y = robot.wheels.get(wheel)?.y;
            Some((speed - y * turn) / robot.wheel_radius_m)
        }
        Kinematics::Omni3 => None,
    }
}

/// The command for the same turn to the other side.
fn mirrored(robot: &Description, frame: &SensorFrame) -> Vec<f64> {
    let mut command = frame.command.to_vec();
    let turn = match robot.kinematics {
        Kinematics::Ackermann6 => 0,
        Kinematics::Differential => 1,
        Kinematics::Omni3 => 2,
    };
    if let Some(turn) = command.get_mut(turn) {
        *turn = -*turn;
    }
    command
}

fn doubt_wheels(pieces: &[&[&SensorFrame]], robot: &Description) -> Option<Doubt> {
    let frames: Vec<&SensorFrame> = pieces.iter().flat_map(|p| p.iter().copied()).collect();
    let wheels = 0..robot.wheels.len();
    if frames.len() < FRAMES_MIN || !wheels.clone().all(|i| have(pieces, Valid::wheel_rate(i))) {
        return None;
    }
    if let Some(constant) = constant_wheel(&frames, robot) {
        return Some(constant);
    }
    let mut ratios: Vec<f64> = Vec::new();
    for wheel in wheels.clone() {
        let (mut found, mut expected) = (0.0, 0.0);
        for chord in chords::chords(pieces) {
            rolling(robot, wheel, &[])?;
            let rate = chord.mean(|f| rolling(robot, wheel, &f.command).unwrap_or(0.0));
            found += chord.mean(|frame| frame.wheel_rate[wheel]) * rate;
            expected += rate * rate;
        }
        ratios.push(found / expected);
    }
    ratios.sort_by(f64::total_cmp);
    let middle = ratios.get(ratios.len() / 2).copied();
    let middle = middle.filter(|ratio| ratio.is_finite())?;
    if is_doubtful(middle) {
        return Some(Doubt::Rates(middle));
    }
    // With the turn's sign changed a wheel rolls as the one opposite does.
    let (mut as_named, mut exchanged, mut turning) = (0.0, 0.0, 0);
    for frame in frames {
        let [forward, left, turn] = robot.twist(&frame.command);
        if turn.abs() < TURNING_1_M * forward.hypot(left) {
            continue;
        }
        turning += 1;
        let other = mirrored(robot, frame);
        for wheel in wheels.clone() {
            let rate = frame.wheel_rate[wheel];
            as_named += (rate - rolling(robot, wheel, &frame.command)?).powi(2);
            exchanged += (rate - rolling(robot, wheel, &other)?).powi(2);
        }
    }
    (turning >= FRAMES_MIN && exchanged < 0.5 * as_named).then_some(Doubt::Sides)
}

/// A wheel that reads the same throughout, though it is commanded to roll; where that is not known,
/// all of them must.
fn constant_wheel(frames: &[&SensorFrame], robot: &Description) -> Option<Doubt> {
    let first = frames.first()?;
    let is_constant = |wheel: usize| {
        let mut rates = frames.iter().map(|frame| frame.wheel_rate[wheel]);
        rates.all(|rate| rate == first.wheel_rate[wheel])
    };
    let mut wheels = 0..robot.wheels.len();
    let rolls = |wheel: usize| {
        let commanded = |frame: &&SensorFrame| rolling(robot, wheel, &frame.command);
        frames.iter().filter_map(commanded).any(|rate| rate != 0.0)
    };
    let constant = match robot.kinematics {
        Kinematics::Omni3 => wheels.clone().all(is_constant).then_some(0),
        _ => wheels.find(|&wheel| rolls(wheel) && is_constant(wheel)),
    }?;
    Some(Doubt::RateConstant(constant, first.wheel_rate[constant]))
}

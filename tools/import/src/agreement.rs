//! Whether imported channels agree with each other: units, signs, sides.
//!
//! Two channels that measure the same motion, each against the other: their ratio is 1 if units and
//! signs are as the description says. What a robot measures twice needs no command.

use std::fmt;

use vigil_inference::angle::wrap;
use vigil_robot::Description;
use vigil_robot::description::Kinematics;

use super::ImportedLog;

/// Time over which motion is averaged, s: longer than the lag between command, body and filters.
const CELL_S: f64 = 0.5;
/// Cells that a judgement needs: ten seconds.
const CELLS_MIN: usize = 20;
/// Correlation from which two channels are taken to measure the same.
const CORRELATED: f64 = 0.7;
/// Ratios that are no reason for doubt: slip. A robot on smooth ground drove 0.6 of its commands,
/// one that is skid-steered turns by as little.
const RATIO_FREE: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// How near a ratio is to that of two units, as a factor, for these to be named.
const UNIT_NEAR: f64 = 1.2;
/// Ratios of units.
const UNITS: [(f64, &str); 5] = [
    (180.0 / std::f64::consts::PI, "degrees"),
    (30.0 / std::f64::consts::PI, "revolutions per minute"),
    (1000.0, "mm"),
    (100.0, "cm"),
    (3.281, "feet"),
];

/// How one channel reads against what others say that it should.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// The channel, or what follows from it.
    pub measured: String,
    /// What it is compared with.
    pub against: String,
    /// How many times the other it reads; by least squares, without a constant.
    pub ratio: f64,
    /// Correlation without a constant, -1 to 1.
    pub correlation: f64,
}

impl Agreement {
    /// What is doubtful, if something is: both vary together, and not as one.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        let ratio = self.ratio;
        if self.correlation.abs() < CORRELATED || RATIO_FREE.contains(&ratio) {
            return None;
        }
        let near = |unit: f64| (1.0 / UNIT_NEAR..=UNIT_NEAR).contains(&(ratio.abs() / unit));
        let unit = UNITS.iter().find_map(|(factor, name)| {
            let its = if near(*factor) {
                Some(&self.measured)
            } else {
                None
            };
            let other = || near(1.0 / factor).then_some(&self.against);
            Some(format!("is {} in {name}", its.or_else(other)?))
        });
        let sign = (ratio < 0.0).then(|| "is a sign wrong, or are sides exchanged".to_owned());
        let reasons: Vec<String> = [sign, unit].into_iter().flatten().collect();
        let reason = match reasons.is_empty() {
            true => "is a unit, the wheels' radius or distance wrong".to_owned(),
            false => reasons.join(", "),
        };
        Some(format!("{self}: {reason}?"))
    }
}

impl fmt::Display for Agreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            measured,
            against,
            ratio,
            correlation,
        } = self;
        write!(
            f,
            "{measured} is {ratio:.3} times {against} (correlation {correlation:.2})"
        )
    }
}

/// What moves in one cell; none of what is not measured.
#[derive(Clone, Copy, Default)]
struct Motion {
    /// Yaw rate of the gyro, the wheels, the pose, and the command, rad/s.
    yaw_rate: [Option<f64>; 4],
    /// Speed forward of the wheels, the pose and the command, m/s.
    speed: [Option<f64>; 3],
}

/// Every two channels that measure the same and can be judged, over all runs.
#[must_use]
pub fn agreements(imported: &ImportedLog, robot: &Description) -> Vec<Agreement> {
    let cells = cells(imported, robot);
    let yaw_rates = [
        "yaw_rate",
        "that of the wheels",
        "that of yaw",
        "that of the command",
    ];
    let speeds = [
        "the wheels' speed",
        "the pose's speed",
        "the commanded speed",
    ];
    let mut out = Vec::new();
    for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
        let pairs = cells
            .iter()
            .map(|cell| (cell.yaw_rate[i], cell.yaw_rate[j]));
        let name = match i {
            0 => "yaw_rate",
            1 => "the wheels' yaw rate",
            _ => "the yaw rate of yaw",
        };
        out.extend(agreement(pairs, [name, yaw_rates[j]]));
    }
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let pairs = cells.iter().map(|cell| (cell.speed[i], cell.speed[j]));
        out.extend(agreement(pairs, [speeds[i], speeds[j]]));
    }
    out
}

fn agreement(
    pairs: impl Iterator<Item = (Option<f64>, Option<f64>)>,
    names: [&str; 2],
) -> Option<Agreement> {
    let [measured, against] = names;
    let (mut xx, mut yy, mut xy, mut count) = (0.0, 0.0, 0.0, 0);
    for (y, x) in pairs {
        let (Some(y), Some(x)) = (y, x) else { continue };
        xx += x * x;
        yy += y * y;
        xy += x * y;
        count += 1;
    }
    (count >= CELLS_MIN && xx > 0.0 && yy > 0.0).then(|| Agreement {
        measured: measured.to_owned(),
        against: against.to_owned(),
        ratio: xy / xx,
        correlation: xy / (xx * yy).sqrt(),
    })
}

fn cells(imported: &ImportedLog, robot: &Description) -> Vec<Motion> {
    let at = |name: &str| imported.columns.iter().position(|column| column == name);
    let mut out = Vec::new();
    for run in &imported.runs {
        let mut start = 0;
        for (end, row) in run.rows.iter().enumerate() {
            let time_s = |row: &[f64]| row.first().copied().unwrap_or(0.0);
            let Some(rows) = run.rows.get(start..=end) else {
                continue;
            };
            if rows
                .first()
                .is_some_and(|first| time_s(row) - time_s(first) >= CELL_S)
            {
                out.push(motion(rows, robot, &at));
                start = end;
            }
        }
    }
    out
}

/// The motion in the rows of one cell.
fn motion(rows: &[Vec<f64>], robot: &Description, at: &dyn Fn(&str) -> Option<usize>) -> Motion {
    let value = |row: &Vec<f64>, name: &str| {
        let value = row.get(1 + at(name)?).copied();
        value.filter(|value| value.is_finite())
    };
    let mean = |name: &str| {
        let values = rows
            .iter()
            .map(|row| value(row, name))
            .collect::<Option<Vec<f64>>>()?;
        Some(values.iter().sum::<f64>() / rows.len() as f64)
    };
    let command: Vec<f64> = robot
        .command
        .iter()
        .map_while(|axis| mean(&axis.name))
        .collect();
    let is_commanded = command.len() == robot.command.len() && !command.is_empty();
    let [forward, _, turn] = robot.twist(&command);
    let mut out = Motion::default();
    out.yaw_rate[0] = mean("yaw_rate");
    if is_commanded {
        (out.speed[2], out.yaw_rate[3]) = (Some(forward), Some(turn));
    }
    if robot.kinematics == Kinematics::Differential {
        let side = |is_left: bool| {
            let own = robot
                .wheels
                .iter()
                .filter(|wheel| (wheel.y > 0.0) == is_left);
            let rates: Vec<f64> = own
                .map(|wheel| mean(&format!("enc_{}", wheel.name)))
                .collect::<Option<Vec<f64>>>()?;
            let count = rates.len().max(1) as f64;
            Some(robot.wheel_radius_m * rates.iter().sum::<f64>() / count)
        };
        let track_m: f64 = 2.0 * robot.wheels.iter().map(|w| w.y.abs()).fold(0.0, f64::max);
        if let (Some(left), Some(right)) = (side(true), side(false)) {
            out.yaw_rate[1] = Some((right - left) / track_m);
            out.speed[0] = Some((left + right) / 2.0);
        }
    }
    let pose = |row: Option<&Vec<f64>>| {
        let row = row?;
        Some([value(row, "x")?, value(row, "y")?, value(row, "yaw")?])
    };
    let time = |row: Option<&Vec<f64>>| row.and_then(|row| row.first().copied());
    let ends = (pose(rows.first()), pose(rows.last()));
    let times = (time(rows.first()), time(rows.last()));
    if let ((Some([x0, y0, yaw0]), Some([x1, y1, yaw1])), (Some(t0), Some(t1))) = (ends, times) {
        let turned = wrap(yaw1 - yaw0);
        let (s, c) = (yaw0 + turned / 2.0).sin_cos();
        out.yaw_rate[2] = Some(turned / (t1 - t0));
        out.speed[1] = Some((c * (x1 - x0) + s * (y1 - y0)) / (t1 - t0));
    }
    out
}

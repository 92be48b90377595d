//! Sensors that a description lacks, and what they would read of a fault.

use vigil_robot::Description;
use vigil_robot::channel_model::fault_kind::FaultKind;
use vigil_robot::channel_model::law::{BLOCKS, Row};
use vigil_robot::channel_model::window::OFFSET;
use vigil_robot::channel_model::{AXES, Scales, Target};
use vigil_robot::description::Kinematics;

use super::comparison::{Comparison, Products};
use super::fault::{Fault, Origin, Signature};
use super::rule::Rule;
use super::snapshot::Snapshot;

/// Deviation of a block's mean over the usual size of what a further sensor measures; that of each
/// block is its own.
const NOISE: f64 = 0.05;

/// A sensor that is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Candidate {
    /// The rate of the wheel of a drive.
    WheelRate(usize),
    /// The yaw rate of the body, by its axis of the command.
    YawRate(usize),
    /// The velocities of the body, one for each axis of the command.
    Pose,
    /// A second sensor of a channel.
    Second(usize),
}

/// All that fit a robot.
pub(super) fn candidates(
    robot: &Description,
    scales: &Scales,
    targets: &[Target],
) -> Vec<Candidate> {
    let yaw = match robot.kinematics {
        Kinematics::Differential => Some(1),
        Kinematics::Omni3 => Some(2),
        Kinematics::Ackermann6 | Kinematics::None => None,
    };
    let has_geometry = yaw.is_some();
    let yaw = yaw.filter(|&axis| axis < robot.command.len() && !robot.measured.yaw_rate);
    let wheels = (0..scales.drives.len()).filter(|&d| scales.drives[d].wheel.is_some());
    let wheels = wheels.filter(|_| !robot.measured.wheel_rates);
    let seconds = (0..targets.len()).filter(|&i| !targets[i].quantity.is_pose());
    let mut found: Vec<Candidate> = wheels.map(Candidate::WheelRate).collect();
    found.extend(yaw.map(Candidate::YawRate));
    found.extend((has_geometry && !robot.measured.pose).then_some(Candidate::Pose));
    found.extend(seconds.map(Candidate::Second));
    found
}

impl Candidate {
    /// In words.
    pub fn name(self, scales: &Scales, targets: &[Target]) -> String {
        match self {
            Self::WheelRate(drive) => format!("rate of wheel {}", scales.drives[drive].name),
            Self::YawRate(_) => "yaw rate".to_owned(),
            Self::Pose => "pose".to_owned(),
            Self::Second(i) => format!("second {}", targets[i].name),
        }
    }

    /// What it reads of a healthy robot, in any unit.
    fn reading(self, snapshot: &Snapshot, scales: &Scales) -> Vec<Row> {
        let axes = |axis: usize| snapshot.command.map(|command| command[axis]);
        match self {
            Self::WheelRate(drive) => {
                let drive = &scales.drives[drive];
                vec![snapshot.command.map(|command| drive.commanded(&command))]
            }
            Self::YawRate(axis) => vec![axes(axis)],
            Self::Pose => (0..AXES).map(axes).collect(),
            Self::Second(i) => vec![in_unit(&snapshot.predicted[i], &snapshot.unit[i])],
        }
    }

    /// What a fault adds to that.
    fn change(
        self,
        fault: &Fault,
        signature: &Signature,
        snapshot: &Snapshot,
        scales: &Scales,
    ) -> Vec<Row> {
        let none = [0.0; BLOCKS];
        let rows = if self == Self::Pose { AXES } else { 1 };
        let Origin::Drive { place, .. } = fault.origin else {
            return vec![none; rows];
        };
        let drive = &scales.drives[place];
        // What is missing of its speed, or beside it.
        let speed = match fault.kind {
            FaultKind::Offset => [OFFSET * scales.speeds[place]; BLOCKS],
            _ => snapshot
                .command
                .map(|command| -fault.extent.size * drive.commanded(&command)),
        };
        let body = |axis: usize| speed.map(|speed| speed * drive.effect[axis]);
        match self {
            // A wheel that slips turns as it is told.
            Self::WheelRate(own) if own == place && fault.kind != FaultKind::Slip => vec![speed],
            Self::WheelRate(_) => vec![none],
            Self::YawRate(axis) => vec![body(axis)],
            Self::Pose => (0..AXES).map(body).collect(),
            Self::Second(i) => {
                let row = signature.rows.iter().find(|(channel, _)| *channel == i);
                vec![row.map_or(none, |(_, row)| in_unit(row, &snapshot.unit[i]))]
            }
        }
    }
}

/// A whitened row in the channel's unit.
fn in_unit(row: &Row, unit: &Row) -> Row {
    std::array::from_fn(|block| match unit[block] > 0.0 {
        true => row[block] / unit[block],
        false => 0.0,
    })
}

/// What is compared.
pub(super) struct Question<'a> {
    /// All faults.
    pub faults: &'a [Fault],
    /// Pairs of them that the robot's own sensors do not tell apart.
    pub pairs: &'a [[usize; 2]],
    /// Where in the log each fault is detected.
    pub comparison: &'a Comparison,
    /// Windows of the log.
    pub log: &'a [Snapshot],
    /// What the robot's drives are.
    pub scales: &'a Scales,
    /// What alarms.
    pub rule: &'a Rule,
}

/// For each candidate whether it tells each pair in half of the windows that show the fault.
pub(super) fn tells(candidates: &[Candidate], question: &Question<'_>) -> Vec<Vec<bool>> {
    let Question {
        faults,
        pairs,
        log,
        scales,
        rule,
        comparison,
    } = *question;
    let sizes: Vec<Vec<f64>> = candidates
        .iter()
        .map(|one| usual(*one, log, scales))
        .collect();
    let mut told = vec![vec![[0_usize; 2]; pairs.len()]; candidates.len()];
    for (window, snapshot) in log.iter().enumerate() {
        let products = Products::new(faults, 0, snapshot, rule);
        for ((candidate, sizes), told) in candidates.iter().zip(&sizes).zip(&mut told) {
            let change = |(fault, signature): (&Fault, &Signature)| -> Vec<Row> {
                let rows = candidate.change(fault, signature, snapshot, scales);
                let rows = rows.into_iter().zip(sizes);
                rows.map(|(row, size)| row.map(|value| value / (NOISE * size)))
                    .collect()
            };
            let changes = faults.iter().zip(&products.signatures).map(change);
            let changes: Vec<Vec<Row>> = changes.collect();
            for (pair, told) in pairs.iter().zip(told) {
                for (slot, [f, g]) in told.iter_mut().zip([*pair, [pair[1], pair[0]]]) {
                    // What a further sensor leaves over is none of the log's residuals.
                    let more = |[f, g]: [usize; 2]| match (changes.get(f), changes.get(g)) {
                        (Some(f), Some(g)) => {
                            let rows = f.iter().flatten().zip(g.iter().flatten());
                            rows.map(|(a, b)| a * b).sum::<f64>()
                        }
                        _ => 0.0,
                    };
                    let [as_fault, as_rival] = products.sights(faults, [f, g], rule, more);
                    let is_seen = comparison.detected[f][window] > 0;
                    *slot += usize::from(
                        is_seen
                            && rule.excludes(
                                [faults[f].class, faults[g].class],
                                [&as_fault, &as_rival],
                            ),
                    );
                }
            }
        }
    }
    let half = |f: usize, told: usize| 2 * told >= comparison.windows(f).max(1);
    let of_pair =
        |(pair, told): (&[usize; 2], &[usize; 2])| half(pair[0], told[0]) && half(pair[1], told[1]);
    told.iter()
        .map(|told| pairs.iter().zip(told).map(of_pair).collect())
        .collect()
}

/// Root mean square of each of a candidate's readings over the log.
fn usual(candidate: Candidate, log: &[Snapshot], scales: &Scales) -> Vec<f64> {
    let mut sums = vec![
        0.0;
        if candidate == Candidate::Pose {
            AXES
        } else {
            1
        }
    ];
    for snapshot in log {
        for (sum, row) in sums.iter_mut().zip(candidate.reading(snapshot, scales)) {
            *sum += row.iter().map(|value| value * value).sum::<f64>();
        }
    }
    let values = (log.len() * BLOCKS).max(1) as f64;
    sums.iter()
        .map(|sum| (sum / values).sqrt().max(1e-9))
        .collect()
}

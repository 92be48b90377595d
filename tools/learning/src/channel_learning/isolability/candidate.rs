//! Sensors that a description lacks, and what they would read of a fault.

use vigil_robot::Description;
use vigil_robot::channel_model::fault_kind::FaultKind;
use vigil_robot::channel_model::law::{BLOCKS, Row};
use vigil_robot::channel_model::window::OFFSET;
use vigil_robot::channel_model::{AXES, Scales, Target};
use vigil_robot::description::Kinematics;

use super::Study;
use super::comparison::Products;
use super::fault::{Fault, Origin, Signature};
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

/// For each candidate whether it tells each pair that nothing else tells, in half of the windows
/// that show the fault.
pub(super) fn tells(candidates: &[Candidate], study: &Study<'_>) -> Vec<Vec<bool>> {
    let (faults, pairs, scales) = (&study.faults, &study.never, study.task.scales);
    let sizes = candidates.iter().map(|one| usual(*one, &study.log, scales));
    let sizes: Vec<Vec<f64>> = sizes.collect();
    let mut told = vec![vec![[0_usize; 2]; pairs.len()]; candidates.len()];
    for (window, snapshot) in study.log.iter().enumerate().filter(|_| !pairs.is_empty()) {
        let products = Products::new(faults, 0, snapshot, &study.rule);
        for ((candidate, sizes), told) in candidates.iter().zip(&sizes).zip(&mut told) {
            let change = |(fault, signature): (&Fault, &Signature)| -> Vec<f64> {
                let rows = candidate.change(fault, signature, snapshot, scales);
                let scaled = |(row, size): (Row, &f64)| row.map(|value| value / (NOISE * size));
                rows.into_iter().zip(sizes).flat_map(scaled).collect()
            };
            let changes = faults.iter().zip(&products.signatures).map(change);
            let changes: Vec<Vec<f64>> = changes.collect();
            // What a further sensor leaves over is none of the log's residuals.
            let more = |[f, g]: [usize; 2]| match [changes.get(f), changes.get(g)] {
                [Some(f), Some(g)] => f.iter().zip(g).map(|(a, b)| a * b).sum(),
                _ => 0.0,
            };
            for (&[one, other], told) in pairs.iter().zip(told) {
                for (count, pair) in told.iter_mut().zip([[one, other], [other, one]]) {
                    let is_seen = study.comparison.detected[pair[0]][window] > 0;
                    let told = is_seen && products.exclude(faults, pair, &study.rule, more);
                    *count += usize::from(told);
                }
            }
        }
    }
    let half = |(fault, told): (&usize, &usize)| 2 * told >= study.comparison.windows(*fault);
    let is_told = |(pair, told): (&[usize; 2], &[usize; 2])| pair.iter().zip(told).all(half);
    let of_candidate = |told: &Vec<[usize; 2]>| pairs.iter().zip(told).map(is_told).collect();
    told.iter().map(of_candidate).collect()
}

/// Root mean square of each of a candidate's readings over the log.
fn usual(candidate: Candidate, log: &[Snapshot], scales: &Scales) -> Vec<f64> {
    let mut sums = [0.0; AXES];
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

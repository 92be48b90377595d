//! A window of the log, kept for all faults to be put into.

use std::collections::BTreeMap;

use vigil_robot::Description;
use vigil_robot::channel_model::law::{BLOCK_S, BLOCKS, Law, Row};
use vigil_robot::channel_model::window::{DELAYS, Window};
use vigil_robot::channel_model::{AXES, History, Observation, Quantity, Target, targets};

use super::super::record::Record;
use super::super::unseen;
use super::Task;

/// Windows that are looked at, at most.
const WINDOWS_MAX: usize = 400;
/// Lateness of a delayed sensor, s.
pub(super) const DELAY_S: f64 = DELAYS[DELAY] * BLOCK_S;
/// Its place among [`DELAYS`].
const DELAY: usize = 2;

/// Where in the motion of a log something is.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Place {
    /// Motion since the log's beginning, s.
    pub motion_s: f64,
    /// Way since then, m; none if nothing tells the speed.
    pub way_m: Option<f64>,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

/// A window's residuals, units and predictions. Rows are zero where nothing was read.
#[derive(Debug, Clone)]
pub(super) struct Snapshot {
    /// Where it ends.
    pub place: Place,
    /// Square of its residuals under the law.
    pub square: f64,
    /// Part of each block in it, given those before.
    pub parts: Row,
    /// Whitened residuals, by channel.
    pub z: Vec<Row>,
    /// One over the residual's deviation.
    pub unit: Vec<Row>,
    /// Whitened predictions.
    pub predicted: Vec<Row>,
    /// What a lateness of [`DELAY_S`] adds.
    pub late: Vec<Row>,
    /// Each drive's part, by drive and channel.
    pub share: Vec<Vec<Row>>,
    /// What an offset of each drive adds, by drive and channel.
    pub offset: Vec<Vec<Row>>,
    /// Command at the end of each block.
    pub command: [[f64; AXES]; BLOCKS],
    /// Size of each channel's mean residual over the last second, in its unit.
    pub residual: Vec<Option<f64>>,
}

impl Snapshot {
    /// Of a window as it is; `law` takes it.
    pub fn new(window: &Window, law: &mut Law, command: [[f64; AXES]; BLOCKS]) -> Self {
        let n = law.values() / BLOCKS;
        law.take(&window.z[..n]);
        let drives = 0..window.drives();
        let residual = |i: usize| {
            let [older, newer] = [BLOCKS - 2, BLOCKS - 1];
            let unit = window.unit[i][older] + window.unit[i][newer];
            let sum = window.z[i][older]? + window.z[i][newer]?;
            (unit > 0.0).then(|| (sum / unit).abs())
        };
        Self {
            place: Place::default(),
            square: law.square(),
            parts: *law.parts(),
            z: (0..n).map(|i| *law.row(i)).collect(),
            unit: window.unit[..n].to_vec(),
            predicted: window.predicted[..n].to_vec(),
            late: window.late[DELAY][..n].to_vec(),
            share: drives
                .clone()
                .map(|d| window.share[window.group(d)][..n].to_vec())
                .collect(),
            offset: drives
                .map(|d| window.offset[window.group(d)][..n].to_vec())
                .collect(),
            command,
            residual: (0..n).map(residual).collect(),
        }
    }
}

/// Speed of the robot, m/s: that of its pose, or else commanded.
fn speed_m_s(now: &Observation, targets: &[Target], robot: &Description) -> Option<f64> {
    let value = |of: Quantity| now.values[targets.iter().position(|t| t.quantity == of)?];
    if let (Some(x), Some(y)) = (value(Quantity::Forward), value(Quantity::Lateral)) {
        return Some(x.hypot(y));
    }
    let axes = robot.command.iter().zip(now.command);
    let mut axes = axes
        .filter(|(axis, _)| axis.unit == "m/s")
        .map(|(_, value)| value);
    let first = axes.next()?;
    Some(axes.fold(first, f64::hypot).abs())
}

/// The ends of windows that are spread evenly over the log's motion, by record and observation.
fn places(
    records: &[Record],
    targets: &[Target],
    robot: &Description,
) -> BTreeMap<[usize; 2], Place> {
    let motion_s: f64 = records.iter().map(Record::moving_s).sum();
    let spacing_s = BLOCK_S.max(motion_s / WINDOWS_MAX as f64);
    let mut found = BTreeMap::new();
    let (mut motion_s, mut way_m, mut next_s) = (0.0, Some(0.0), 0.0);
    for (number, record) in records.iter().enumerate() {
        for (newest, history) in record.histories.iter().enumerate() {
            let Some(now) = history.ago(0).filter(|now| now.moving) else {
                continue;
            };
            let speed_m_s = speed_m_s(now, targets, robot);
            motion_s += now.dt_s;
            way_m = way_m
                .zip(speed_m_s)
                .map(|(way_m, speed)| way_m + speed * now.dt_s);
            if motion_s >= next_s {
                next_s = motion_s + spacing_s;
                let place = Place {
                    motion_s,
                    way_m,
                    speed_m_s: speed_m_s.unwrap_or(0.0),
                };
                found.insert([number, newest], place);
            }
        }
    }
    found
}

/// Windows of the motion, evenly spread and in order, each by the model that has not seen it.
pub(super) fn of_log(law: &mut Law, task: &Task<'_>) -> Vec<Snapshot> {
    let Task {
        models,
        records,
        scales,
        robot,
        ..
    } = *task;
    let places = places(records, &targets(robot), robot);
    let mut found = Vec::new();
    unseen::windows(models, records, scales, |sight| {
        let Some(place) = places.get(&[sight.record, sight.newest]) else {
            return;
        };
        if sight.window.whole_blocks() < BLOCKS {
            return;
        }
        let command = std::array::from_fn(|block| {
            let ago = (BLOCKS - 1 - block) * sight.window.per_block();
            let history = sight.newest.checked_sub(ago);
            let history = history.map(|at| &records[sight.record].histories[at]);
            history.map_or([0.0; AXES], |history: &History| *history.command(0))
        });
        let mut snapshot = Snapshot::new(sight.window, law, command);
        snapshot.place = *place;
        found.push(snapshot);
    });
    found.sort_by(|a, b| a.place.motion_s.total_cmp(&b.place.motion_s));
    found
}

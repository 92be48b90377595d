//! The faults that are compared, and what each changes of a window.

use vigil_robot::Description;
use vigil_robot::channel_model::bank::{DRIVE_ONSETS, HELD, JOINT_ONSETS, KINDS_MAX, ONSETS};
use vigil_robot::channel_model::fault_kind::{FaultKind, GAIN_SD, SHARE_SD, bias_sd};
use vigil_robot::channel_model::law::{BLOCK_S, BLOCKS, Law, Row};
use vigil_robot::channel_model::model::Class;
use vigil_robot::channel_model::window::{DELAYS, OFFSET};
use vigil_robot::channel_model::{
    Component, Model, Places, Quantity, Target, components, drives, targets,
};

use super::snapshot::{DELAY_S, Snapshot};

/// Size of a bias over the channel's tolerance; the benchmark's smaller fault.
const TOLERANCES: f64 = 2.0;
/// Share of its tolerance: of the mean residuals of a second so many are smaller.
const WITHIN: f64 = 0.99;
/// Share of a drive's effect that is lost.
const LOST: f64 = 0.5;

/// What is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Origin {
    /// The sensor of a channel.
    Channel(usize),
    /// A drive.
    Drive {
        /// Its place.
        place: usize,
        /// The wheel that it turns, if it is one's.
        wheel: Option<usize>,
    },
}

/// A stated size, and by which factors of it a rival may explain something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    /// Size in the unit of the kind; 1 where it has none.
    pub size: f64,
    /// Bounds of the factor.
    pub bounds: [f64; 2],
    /// Prior precision of the factor; zero where it is not weighed.
    pub prior: f64,
}

impl Extent {
    /// Of a fault that has no size.
    const NONE: Self = Self {
        size: 1.0,
        bounds: [1.0, 1.0],
        prior: 0.0,
    };

    /// Of any size, whose deviation before anything is seen is so many times the stated one.
    const fn any(size: f64, deviation: f64) -> Self {
        Self {
            size,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            prior: 1.0 / (deviation * deviation),
        }
    }
}

/// A fault of a stated size.
#[derive(Debug, Clone)]
pub(super) struct Fault {
    /// Name of its component.
    pub component: String,
    /// What is broken: the component, and of a pose which channel.
    pub broken: String,
    /// Kind.
    pub kind: FaultKind,
    /// What is broken.
    pub origin: Origin,
    /// Size.
    pub extent: Extent,
    /// Unit of the size.
    pub unit: String,
    /// Price of the fault against none beside that of its size, nats.
    pub price: f64,
    /// Class of its kind.
    pub class: Class,
}

impl Fault {
    /// What is broken, and how.
    pub fn name(&self) -> String {
        format!("{} {}", self.broken, self.word())
    }

    /// How it is broken.
    pub fn word(&self) -> &'static str {
        self.kind.size_kind(None).word()
    }

    /// True of a drive that stands and one that lacks a share of its speed: the whole share is the
    /// same.
    pub fn is_whole_of(&self, other: &Self) -> bool {
        let both = [self.kind, other.kind];
        let kinds = [FaultKind::Stuck, FaultKind::Loss];
        self.origin == other.origin && kinds.iter().all(|kind| both.contains(kind))
    }

    /// Size to be reported; none where the kind has none.
    pub fn stated_size(&self) -> Option<f64> {
        (self.extent != Extent::NONE).then_some(self.extent.size)
    }

    /// True if it is looked for from that block of the window on.
    pub fn is_tried(&self, first: usize) -> bool {
        match self.kind {
            FaultKind::Drift | FaultKind::Delay | FaultKind::Shift => JOINT_ONSETS.contains(&first),
            _ if matches!(self.origin, Origin::Drive { .. }) => DRIVE_ONSETS.contains(&first),
            _ => ONSETS.contains(&first),
        }
    }
}

/// What a fault adds to some channels' whitened residuals, and the product of that with the law's
/// precision.
#[derive(Debug, Clone)]
pub(super) struct Signature {
    /// Channels that it changes, each with its row.
    pub rows: Vec<(usize, Row)>,
    /// Its product with the precision, by channel.
    pub weighed: Vec<Row>,
    /// Channel of which it says nothing; its row makes it so.
    pub silent: Option<usize>,
}

/// The faults of a robot, at sizes that follow from what is left of its healthy log.
pub(super) fn faults(robot: &Description, model: &Model, log: &[Snapshot]) -> Vec<Fault> {
    let (all, parts) = (targets(robot), components(robot));
    let mut found = Vec::new();
    for (channel, target) in all.iter().enumerate() {
        if let Some(tolerance) = Tolerance::new(channel, log) {
            let usual = model.channel[channel].usual;
            found.extend(sensor_faults(target, channel, usual, &tolerance));
        }
    }
    let drives = drives(robot);
    let first = Places::new(robot).drives;
    for (place, (part, drive)) in parts[first..].iter().zip(&drives).enumerate() {
        found.extend(drive_faults(part, place, drive.wheel));
    }
    found
}

/// How much a healthy channel is off.
struct Tolerance {
    /// Bound of nearly all mean residuals of a second, in the channel's unit.
    size: f64,
    /// Mean deviation of a residual, in that unit.
    deviation: f64,
}

impl Tolerance {
    fn new(channel: usize, log: &[Snapshot]) -> Option<Self> {
        let mut residuals: Vec<f64> = log.iter().filter_map(|one| one.residual[channel]).collect();
        residuals.sort_by(f64::total_cmp);
        let last = residuals.len().checked_sub(1)?;
        let size = residuals[(WITHIN * last as f64).round() as usize];
        let units = log.iter().flat_map(|one| one.unit[channel]);
        let units: Vec<f64> = units.filter(|unit| *unit > 0.0).collect();
        let deviation = units.len() as f64 / units.iter().sum::<f64>();
        (size > 0.0 && deviation.is_finite()).then_some(Self { size, deviation })
    }
}

fn sensor_faults(target: &Target, channel: usize, usual: f64, tolerance: &Tolerance) -> Vec<Fault> {
    let is_pose = target.quantity.is_pose();
    let bias = TOLERANCES * tolerance.size;
    let gain = bias / usual.max(1e-9);
    // A pose that stands has velocities of zero.
    let still = if is_pose {
        FaultKind::Zero
    } else {
        FaultKind::Frozen
    };
    let kinds = [FaultKind::Bias, FaultKind::Gain, still, FaultKind::Delay];
    // The velocities of one pose share a component.
    let shared = if is_pose { 3.0 } else { 1.0 };
    let fault = |kind: FaultKind| Fault {
        component: target.component().to_owned(),
        broken: match is_pose {
            true => format!("{} {}", target.component(), target.name),
            false => target.name.clone(),
        },
        kind,
        origin: Origin::Channel(channel),
        extent: match kind {
            FaultKind::Bias => Extent::any(bias, bias_sd(usual, tolerance.deviation) / bias),
            FaultKind::Gain => Extent {
                size: 1.0 + gain,
                ..Extent::any(gain, GAIN_SD / gain)
            },
            FaultKind::Delay => Extent {
                size: DELAY_S,
                bounds: [0.0, DELAYS[DELAYS.len() - 1] * BLOCK_S / DELAY_S],
                prior: 0.0,
            },
            _ => Extent::NONE,
        },
        unit: match kind {
            FaultKind::Bias => target.unit.clone(),
            FaultKind::Delay => "s".to_owned(),
            _ => String::new(),
        },
        price: match kind {
            FaultKind::Delay => shared * (KINDS_MAX * DELAYS.len() * JOINT_ONSETS.len()) as f64,
            _ => shared * (KINDS_MAX * ONSETS.len()) as f64,
        }
        .ln()
            + if kind == FaultKind::Frozen { HELD } else { 0.0 },
        class: Class::from_kind(kind).unwrap_or(Class::Steady),
    };
    kinds.map(fault).to_vec()
}

fn drive_faults(part: &Component, place: usize, wheel: Option<usize>) -> Vec<Fault> {
    let mut kinds = vec![FaultKind::Loss, FaultKind::Stuck, FaultKind::Offset];
    // What is no wheel cannot slip.
    if wheel.is_some() {
        kinds.insert(1, FaultKind::Slip);
    }
    let fault = |kind: FaultKind| Fault {
        component: part.name.clone(),
        broken: part.name.clone(),
        kind,
        origin: Origin::Drive { place, wheel },
        extent: match kind {
            FaultKind::Stuck => Extent::NONE,
            // Its deviation is of the model's unit, which is the stated size.
            FaultKind::Offset => Extent::any(OFFSET, SHARE_SD),
            _ => Extent::any(LOST, SHARE_SD / LOST),
        },
        unit: String::new(),
        price: ((KINDS_MAX * DRIVE_ONSETS.len()) as f64).ln(),
        class: Class::Drive,
    };
    kinds.into_iter().map(fault).collect()
}

/// What a fault changes of a window from block `first` on.
pub(super) fn signature(
    fault: &Fault,
    first: usize,
    snapshot: &Snapshot,
    targets: &[Target],
    law: &Law,
) -> Signature {
    let from = |row: Row| std::array::from_fn(|block| if block < first { 0.0 } else { row[block] });
    let mut silent = None;
    let mut rows: Vec<(usize, Row)> = match fault.origin {
        Origin::Channel(i) => vec![(i, from(sensor_row(fault, i, first, snapshot)))],
        Origin::Drive { place, wheel } => {
            let is_own = |i: usize, of: Quantity| {
                wheel.is_some() && targets[i].wheel == wheel && targets[i].quantity == of
            };
            let (rows, factor) = match fault.kind {
                FaultKind::Offset => (&snapshot.offset[place], 1.0),
                _ => (&snapshot.share[place], -fault.extent.size),
            };
            // A motor that stands still draws any current.
            if fault.kind == FaultKind::Stuck {
                silent = (0..rows.len()).find(|&i| is_own(i, Quantity::Current));
            }
            let turns = |i: usize| fault.kind == FaultKind::Slip && is_own(i, Quantity::WheelRate);
            let shown = (0..rows.len()).filter(|&i| Some(i) != silent && !turns(i));
            shown
                .map(|i| (i, from(rows[i].map(|value| factor * value))))
                .collect()
        }
    };
    let mut dense = vec![[0.0; BLOCKS]; targets.len()];
    for (i, row) in &rows {
        dense[*i] = *row;
    }
    let mut weighed = law.weighed(&dense);
    if let Some(i) = silent {
        let row = law.completion(i, first, &weighed[i]);
        dense[i] = row;
        rows.push((i, row));
        weighed = law.weighed(&dense);
    }
    Signature {
        rows,
        weighed,
        silent,
    }
}

/// What a sensor's fault adds to its whitened residuals.
fn sensor_row(fault: &Fault, channel: usize, first: usize, snapshot: &Snapshot) -> Row {
    let (unit, predicted) = (&snapshot.unit[channel], &snapshot.predicted[channel]);
    match fault.kind {
        FaultKind::Bias => unit.map(|unit| fault.extent.size * unit),
        FaultKind::Gain => predicted.map(|value| (fault.extent.size - 1.0) * value),
        FaultKind::Delay => snapshot.late[channel],
        FaultKind::Frozen => {
            // The value of the onset.
            let held = predicted[first] / unit[first].max(1e-300);
            std::array::from_fn(|block| held * unit[block] - predicted[block])
        }
        _ => predicted.map(|value| -value),
    }
}

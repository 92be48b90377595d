//! Every fault of every component, weighed over the last few seconds.

mod declared;
mod drives;
pub mod pair;
mod unexplained;

use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::logspace::log_sum_exp;

use super::component::Target;
use super::declared_faults::DeclaredFaults;
use super::fault_kind::{FaultKind, GAIN_SD, SENSOR_KINDS, bias_sd};
use super::law::{BLOCKS, Change, Law, Row};
use super::orders::WheelOrders;
use super::scatter::ScatterLaw;
use super::signature::Terms;
use super::window::{DELAY_BLOCKS, Window};
use super::{CHANNELS_MAX, COMPONENTS_MAX};
use pair::SensorPair;

/// Kinds of a component at most.
pub const KINDS_MAX: usize = SENSOR_KINDS.len();
/// Log-ratio of what cannot be: no evidence for it at all.
pub const IMPOSSIBLE: f64 = -700.0;

/// Blocks of the window from which on a fault may have been there.
pub const ONSETS: [usize; 6] = [0, 2, 4, 5, 6, 7];
/// The same of drives: with the newest block among them, what a healthy one does for a moment
/// passes for a fault of it.
pub const DRIVE_ONSETS: [usize; 5] = [0, 2, 4, 5, 6];
/// The same of faults whose effect grows or is late, and of declared ones.
pub const JOINT_ONSETS: [usize; 3] = [0, 4, 6];
/// Time in which a drift grows as large as a bias, s.
const DRIFT_S: f64 = 4.0;
/// Delays that are looked for, in blocks; one with a size of its own between them.
pub const DELAYS: [f64; 4] = [0.5, 1.0, 2.0, DELAY_BLOCKS as f64];
/// Deviation of an erratic sensor's readings, relative to that of a whole one given all others.
pub const ERRATIC: f64 = 6.0;
/// The value at which a sensor has frozen is one number more: its price in nats.
pub const HELD: f64 = 2.0;
/// Silence after which a channel is missing, s, if it was never silent for half as long, and how
/// much that says.
const MISSING_S: f64 = 1.0;
const MISSING: f64 = 30.0;
/// Roughness of a robot of which several channels are noisier at once, relative to that of a
/// healthy one.
const UNKNOWN_NOISE: f64 = 3.0;

/// What the window says of a fault.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Weighed {
    /// Logarithm of how much more likely the window is with it than without.
    pub log_ratio: f64,
    /// Its size.
    pub size: f64,
    /// Deviation of the size.
    pub size_sd: f64,
    /// For how long it has been there at most, s.
    pub age_s: f64,
}

impl Weighed {
    const NONE: Self = Self {
        log_ratio: IMPOSSIBLE,
        size: 0.0,
        size_sd: 0.0,
        age_s: 0.0,
    };

    /// A mean over onsets that are equally probable: the likeliest one gives the size.
    fn over<const N: usize>(onsets: [Self; N]) -> Self {
        let best = onsets.into_iter().fold(Self::NONE, |best, one| {
            if one.log_ratio > best.log_ratio {
                one
            } else {
                best
            }
        });
        Self {
            log_ratio: log_sum_exp(&onsets.map(|one| one.log_ratio)) - (N as f64).ln(),
            ..best
        }
    }
}

/// A channel that is predicted.
#[derive(Debug, Clone)]
pub struct ChannelPlace {
    /// What it measures.
    pub target: Target,
    /// Place of its component.
    pub component: usize,
    /// Its usual size in motion, in its unit.
    pub usual: f64,
    /// Longest silence of a healthy one, s.
    pub silence_s: f64,
}

/// A drive.
#[derive(Debug, Clone, Copy)]
pub struct DrivePlace {
    /// Place of its component.
    pub component: usize,
    /// The wheel that it turns; none if it moves the whole robot.
    pub wheel: Option<usize>,
}

/// What is usual of a window, in its size and in its roughness.
#[derive(Debug, Clone, Checkpoint)]
pub struct Laws {
    /// The law of windows that begin with each block.
    #[checkpoint(each)]
    pub mean: Vec<Law>,
    /// The law of whole windows in which a sensor's channels have nothing to do with the others, by
    /// its component: within a block that of the others alone, and in time that of its directions.
    #[checkpoint(fixed)]
    pub without: Vec<Law>,
    /// None if the log does not tell it.
    #[checkpoint(each)]
    pub scatter: Option<ScatterLaw>,
}

/// The bank.
#[derive(Debug, Clone, Checkpoint)]
pub struct Bank {
    window: Window,
    laws: Laws,
    first: usize,
    #[checkpoint(fixed)]
    channels: Vec<ChannelPlace>,
    #[checkpoint(fixed)]
    drives: Vec<DrivePlace>,
    /// The declared faults, whose components are the last ones.
    declared: DeclaredFaults,
    first_declared: usize,
    silent_s: [f64; CHANNELS_MAX],
    weighed: [[Weighed; KINDS_MAX]; COMPONENTS_MAX],
    /// Component without whose channels the window is being weighed; none between two steps.
    #[checkpoint(scratch)]
    left_out: Option<usize>,
    pair: Option<SensorPair>,
    unknown: f64,
    unknown_noise: f64,
}

impl Bank {
    /// A bank over a window and its laws.
    #[must_use]
    pub fn new(
        window: Window,
        laws: Laws,
        channels: Vec<ChannelPlace>,
        drives: Vec<DrivePlace>,
        (declared, first_declared): (DeclaredFaults, usize),
    ) -> Self {
        Self {
            window,
            laws,
            first: 0,
            channels,
            drives,
            declared,
            first_declared,
            silent_s: [0.0; CHANNELS_MAX],
            weighed: [[Weighed::NONE; KINDS_MAX]; COMPONENTS_MAX],
            left_out: None,
            pair: None,
            unknown: IMPOSSIBLE,
            unknown_noise: IMPOSSIBLE,
        }
    }

    /// Forgets the run.
    pub fn reset(&mut self) {
        self.clear();
        self.declared.reset();
        self.window.reset();
    }

    /// Component of each channel.
    pub fn components(&self) -> impl Iterator<Item = usize> + '_ {
        self.channels.iter().map(|channel| channel.component)
    }

    /// Begins a new record.
    pub fn clear(&mut self) {
        self.window.clear();
        self.declared.clear();
        self.silent_s = [0.0; CHANNELS_MAX];
        self.weighed = [[Weighed::NONE; KINDS_MAX]; COMPONENTS_MAX];
        (self.unknown, self.unknown_noise) = (IMPOSSIBLE, IMPOSSIBLE);
        self.pair = None;
        // The others take a window before they are asked.
        self.first = 0;
        if let Some(law) = self.laws.mean.first_mut() {
            law.clear();
        }
    }

    /// The window, to be filled.
    pub const fn window_mut(&mut self) -> &mut Window {
        &mut self.window
    }

    /// The window.
    #[must_use]
    pub const fn window(&self) -> &Window {
        &self.window
    }

    /// What is said of each kind of a component's faults.
    #[must_use]
    pub const fn weighed(&self, component: usize) -> &[Weighed; KINDS_MAX] {
        &self.weighed[component]
    }

    /// The declared faults.
    #[must_use]
    pub const fn declared(&self) -> &DeclaredFaults {
        &self.declared
    }

    /// What is said of faults that are none of these.
    #[must_use]
    pub const fn unknown(&self) -> f64 {
        self.unknown
    }

    /// What is said of noise in several channels at once.
    #[must_use]
    pub const fn unknown_noise(&self) -> f64 {
        self.unknown_noise
    }

    /// Square of the residuals over their number.
    #[must_use]
    pub fn mean_square(&self) -> f64 {
        self.law().square() / self.law().values() as f64
    }

    /// The law of the window as it is.
    fn law(&self) -> &Law {
        match self.left_out {
            Some(component) => &self.laws.without[component],
            None => &self.laws.mean[self.first.min(self.laws.mean.len() - 1)],
        }
    }

    /// Takes what the wheels show up to the end of an observation that lasted `dt_s`.
    pub fn take_orders(&mut self, orders: &[WheelOrders], dt_s: f64) {
        self.declared.take_orders(orders, dt_s);
    }

    /// Weighs all faults; `measured`: what of the channels the newest observation holds, which
    /// lasted `dt_s`; `terms`: of the command. False if the window is too short yet to say
    /// anything.
    pub fn weigh(&mut self, measured: impl Fn(usize) -> bool, terms: Terms, dt_s: f64) -> bool {
        let n = self.channels.len();
        self.weighed = [[Weighed::NONE; KINDS_MAX]; COMPONENTS_MAX];
        (self.unknown, self.unknown_noise) = (IMPOSSIBLE, IMPOSSIBLE);
        self.pair = None;
        self.first = BLOCKS - self.window.whole_blocks();
        let Some(law) = self.laws.mean.get_mut(self.first) else {
            return false;
        };
        law.take(&self.window.z[..n]);
        if let Some(scatter) = &mut self.laws.scatter {
            scatter.take(&self.window.roughness[..n]);
        }
        for channel in 0..n {
            self.silent_s[channel] = match measured(channel) {
                true => 0.0,
                false => self.silent_s[channel] + dt_s,
            };
            self.weigh_sensor(channel);
        }
        for drive in 0..self.drives.len() {
            self.weigh_drive(drive);
        }
        self.declared.take(&self.window, terms, dt_s);
        for fault in 0..self.declared.len() {
            self.weigh_declared(fault);
        }
        self.weigh_pair();
        let law = self.law();
        self.unknown = law.log_ratio_unknown(law.square(), law.parts());
        let scatter = self.laws.scatter.as_ref();
        self.unknown_noise = scatter.map_or(IMPOSSIBLE, |scatter| scatter.any(UNKNOWN_NOISE));
        true
    }

    fn weigh_sensor(&mut self, channel: usize) {
        let component = self.channels[channel].component;
        // The velocities of one pose share a component.
        let shares = self.components().filter(|&other| other == component);
        let price = (shares.count().max(1) as f64).ln();
        let found = SENSOR_KINDS.map(|kind| self.sensor(channel, kind));
        for (slot, found) in self.weighed[component].iter_mut().zip(found) {
            let log_ratio = found.log_ratio - price;
            let sum = log_sum_exp(&[slot.log_ratio, log_ratio]);
            if log_ratio > slot.log_ratio {
                *slot = found;
            }
            slot.log_ratio = sum.max(IMPOSSIBLE);
        }
    }

    fn sensor(&self, channel: usize, kind: FaultKind) -> Weighed {
        let place = &self.channels[channel];
        let quantity = place.target.quantity;
        let window = &self.window;
        let (unit, predicted) = (&window.unit[channel], &window.predicted[channel]);
        // A sensor that repeats itself is not as rough as it was.
        let still = || {
            let newest = self.window.newest_roughness[channel];
            let scatter = self.laws.scatter.as_ref();
            scatter.map_or(0.0, |scatter| scatter.still(channel, newest))
        };
        let bias_sd = self.bias_sd(channel);
        match kind {
            FaultKind::Bias => self.added(channel, unit, bias_sd),
            FaultKind::Gain => {
                let change = self.added(channel, predicted, GAIN_SD);
                Weighed {
                    size: 1.0 + change.size,
                    ..change
                }
            }
            // The velocity of a pose that drifts is biased, and one that stands is zero.
            FaultKind::Drift | FaultKind::Frozen if quantity.is_pose() => Weighed::NONE,
            FaultKind::Drift => self.drifting(channel, bias_sd / DRIFT_S),
            FaultKind::Frozen => self.replaced(
                channel,
                |first, block| {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for k in first..BLOCKS {
                        if unit[k] > 0.0 {
                            sum += (self.law().row(channel)[k] + predicted[k]) / unit[k];
                            count += 1.0;
                        }
                    }
                    let held = if count > 0.0 { sum / count } else { 0.0 };
                    held * unit[block] - predicted[block]
                },
                HELD - still(),
            ),
            FaultKind::Zero => self.replaced(channel, |_, block| -predicted[block], -still()),
            FaultKind::Delay => self.delayed(channel),
            FaultKind::Erratic => self.erratic(channel),
            FaultKind::Noise => self.noisier(|i| i == channel),
            FaultKind::Missing if self.silent_s[channel] > MISSING_S.max(2.0 * place.silence_s) => {
                Weighed {
                    log_ratio: MISSING,
                    age_s: self.silent_s[channel],
                    ..Weighed::NONE
                }
            }
            _ => Weighed::NONE,
        }
    }

    /// Deviation of a bias of a channel.
    fn bias_sd(&self, channel: usize) -> f64 {
        let unit = &self.window.unit[channel];
        let units = unit
            .iter()
            .fold(0.0, |sum, unit| sum + unit / BLOCKS as f64);
        let deviation = if units > 0.0 { 1.0 / units } else { 0.0 };
        bias_sd(self.channels[channel].usual, deviation)
    }

    /// More noise of some channels.
    fn noisier(&self, shows: impl Fn(usize) -> bool) -> Weighed {
        let Some(scatter) = &self.laws.scatter else {
            return Weighed::NONE;
        };
        let (log_ratio, size, size_sd) = scatter.rise(shows);
        Weighed {
            log_ratio,
            size,
            size_sd,
            age_s: self.window.block_s() * BLOCKS as f64,
        }
    }

    /// A change of so much times the signature, with a size of this deviation.
    fn sized(&self, change: Change, size_sd: f64, first: usize) -> Weighed {
        let Change { b, a } = change;
        let prior = 1.0 / (size_sd * size_sd).max(1e-300);
        let (precision, penalty) = (a + prior, 0.5 * (1.0 + a / prior).ln());
        let less = b * b / precision;
        Weighed {
            log_ratio: self.law().log_ratio(less, penalty),
            size: b / precision,
            size_sd: (self.law().variance_scale(less) / precision).sqrt(),
            age_s: self.window.block_s() * self.law().blocks(first) as f64,
        }
    }

    fn added(&self, channel: usize, signature: &Row, size_sd: f64) -> Weighed {
        let changes = self.law().change(channel, signature);
        Weighed::over(ONSETS.map(|first| self.sized(changes[first], size_sd, first)))
    }

    fn drifting(&self, channel: usize, size_sd: f64) -> Weighed {
        let unit = &self.window.unit[channel];
        Weighed::over(JOINT_ONSETS.map(|first| {
            let grown: Row = std::array::from_fn(|block| {
                let blocks = block.saturating_sub(first) as f64 + 0.5;
                if block < first {
                    0.0
                } else {
                    unit[block] * self.window.block_s() * blocks
                }
            });
            self.sized(self.law().change(channel, &grown)[0], size_sd, first)
        }))
    }

    fn delayed(&self, channel: usize) -> Weighed {
        let tried = DELAYS.map(|blocks| {
            let late = self.window.delayed(channel, blocks);
            let changes = self.law().change(channel, &late);
            let of = |first: usize| self.law().log_ratio(changes[first].less(), 0.0);
            Weighed {
                log_ratio: log_sum_exp(&JOINT_ONSETS.map(of)) - (JOINT_ONSETS.len() as f64).ln(),
                size: self.window.block_s() * blocks,
                size_sd: 0.25 * self.window.block_s() * blocks,
                age_s: self.window.block_s() * BLOCKS as f64,
            }
        });
        let weights = tried.map(|one| one.log_ratio);
        let total = log_sum_exp(&weights);
        let share = |one: &Weighed| (one.log_ratio - total).exp();
        let size: f64 = tried.iter().map(|one| share(one) * one.size).sum();
        let apart = |one: &Weighed| {
            let apart = one.size - size;
            share(one) * (apart * apart + one.size_sd * one.size_sd)
        };
        Weighed {
            log_ratio: total - (DELAYS.len() as f64).ln(),
            size,
            size_sd: tried.iter().map(apart).sum::<f64>().sqrt(),
            age_s: self.window.block_s() * BLOCKS as f64,
        }
    }

    /// Readings that say nothing of the truth, but are this.
    fn replaced(&self, channel: usize, read: impl Fn(usize, usize) -> f64, price: f64) -> Weighed {
        let z = self.law().row(channel);
        Weighed::over(ONSETS.map(|first| {
            let (less, _) = self.law().deviation(channel, first);
            let apart: Row = std::array::from_fn(|block| match block < first {
                true => 0.0,
                false => z[block] - read(first, block),
            });
            let left = self.law().own_square(channel, &apart);
            Weighed {
                log_ratio: self.law().log_ratio(less - left, price),
                age_s: self.window.block_s() * self.law().blocks(first) as f64,
                ..Weighed::NONE
            }
        }))
    }

    fn erratic(&self, channel: usize) -> Weighed {
        Weighed::over(ONSETS.map(|first| {
            let (less, _) = self.law().deviation(channel, first);
            let penalty = self.law().blocks(first) as f64 * ERRATIC.ln();
            let less = less * (1.0 - 1.0 / (ERRATIC * ERRATIC));
            Weighed {
                log_ratio: self.law().log_ratio(less, penalty),
                age_s: self.window.block_s() * self.law().blocks(first) as f64,
                ..Weighed::NONE
            }
        }))
    }
}

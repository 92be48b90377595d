//! Every fault of every component, weighed over the last few seconds.

mod declared;
mod drives;
pub mod pair;
mod sensors;
mod unexplained;

use vigil_checkpoint::{Checkpoint, CheckpointValue};

use super::component::Target;
use super::declared_faults::DeclaredFaults;
use super::fault_kind::{SENSOR_KINDS, bias_sd};
use super::law::{BLOCKS, Change, Law};
use super::orders::WheelOrders;
use super::scatter::ScatterLaw;
use super::signature::Terms;
use super::window::Window;
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
/// Deviation of an erratic sensor's readings, relative to that of a whole one given all others.
pub const ERRATIC: f64 = 6.0;
/// The value at which a sensor has frozen is one number more: its price in nats.
pub const HELD: f64 = 2.0;
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
    /// Deviation of a bias of each channel.
    #[checkpoint(scratch)]
    bias_sd: [f64; CHANNELS_MAX],
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
            bias_sd: [0.0; CHANNELS_MAX],
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
            self.bias_sd[channel] = self.bias_sd(channel);
            self.weigh_sensor(channel);
        }
        self.weigh_drives();
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

    /// A fault that may have been there from each of these blocks on, and the likeliest of these:
    /// it lessens the square by so much, and the density by a factor besides.
    fn begun<const N: usize>(
        &self,
        onsets: [usize; N],
        less: impl Fn(usize) -> f64,
        density: impl Fn(usize) -> f64,
    ) -> (Weighed, usize) {
        let (law, density) = (self.law(), onsets.map(density));
        let likelihoods = law.likelihoods(onsets.map(less), density);
        let first = onsets[likelihoods.likeliest()];
        let weighed = Weighed {
            log_ratio: likelihoods.log_mean(),
            age_s: self.window.block_s() * law.blocks(first) as f64,
            ..Weighed::NONE
        };
        (weighed, first)
    }

    /// A change of so much times a signature, with a size of this deviation.
    fn sized<const N: usize>(
        &self,
        onsets: [usize; N],
        changes: &[Change; BLOCKS],
        size_sd: f64,
    ) -> Weighed {
        let prior = 1.0 / (size_sd * size_sd).max(1e-300);
        let precision = |first: usize| changes[first].a + prior;
        let less = |first: usize| changes[first].b * changes[first].b / precision(first);
        let density = |first: usize| (prior / precision(first)).sqrt();
        let (weighed, first) = self.begun(onsets, less, density);
        let variance_scale = self.law().variance_scale(less(first));
        Weighed {
            size: changes[first].b / precision(first),
            size_sd: (variance_scale / precision(first)).sqrt(),
            ..weighed
        }
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

    /// Deviation of a bias of a channel.
    fn bias_sd(&self, channel: usize) -> f64 {
        let unit = &self.window.unit[channel];
        let units = unit
            .iter()
            .fold(0.0, |sum, unit| sum + unit / BLOCKS as f64);
        let deviation = if units > 0.0 { 1.0 / units } else { 0.0 };
        bias_sd(self.channels[channel].usual, deviation)
    }
}

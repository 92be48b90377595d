//! What labelled runs showed of a fault that comes back with each turn of a wheel.
//!
//! In standardized amplitudes `y`, complex and of unit variance without the fault, it shows as
//! `q a e^{-ihφ}`, with a learned `a` and by the gain of the frames that are remembered. Noise of
//! channels is taken for independent. The phase `φ` is that of the wheel when the record began,
//! which nobody knows, and the size `q` is that of this time. The log-likelihood ratio is that of
//! two Gaussian laws, `2q Re Σ (a e^{-ihφ})* y - q² Σ |a|²`, averaged over both.
//!
//! What the fault of one wheel explains is taken out of what another shows before that speaks for a
//! second fault: on wheels that turn alike the same readings would count twice.

use std::f64::consts::TAU;

use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use vigil_inference::logspace::log_sum_exp;

use super::orders::{ByOrder, MEMORIES_TURNS, ORDERS, WheelOrders, over};
use crate::fault_table::DECLARED_MAX;

/// Phases of a wheel that are tried, and steps between two of them where one phase is to be found.
const PHASES: usize = 36;
const FINER: usize = 16;
/// Sizes of a fault that are tried, relative to the one that was learned from.
const SIZES: [f64; 3] = [0.6, 1.0, 1.5];
/// Part of what a fault explains that is unsure: larger, or under another load, it does not show in
/// quite the same way. Chosen.
const UNSURE: f64 = 0.2;
/// How much the noise of the log counts, beside the four looks at that of the last turns.
const NOISE_WEIGHT: f64 = 4.0;
const LOOKS: f64 = 4.0;
/// Smallest and largest mean square of an amplitude, and largest standardized amplitude.
const SQUARE: [f64; 2] = [1e-18, 1e18];
const AMPLITUDE_MAX: f64 = 1e6;

/// How the amplitudes of one wheel vary without a fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelNoise {
    /// Name of the wheel.
    pub wheel: String,
    /// Mean square beside each order, order by order within each channel.
    pub squares: Vec<f64>,
    /// By how much the mean square at each order exceeds that beside it, over that and the squared
    /// gain, likewise: 0 of a wheel that is round, more of one that is not.
    pub ripple: Vec<f64>,
}

impl WheelNoise {
    /// Deviation of an amplitude; none if the last turns do not show it.
    #[must_use]
    pub fn deviation(&self, orders: &WheelOrders, place: usize) -> Option<f64> {
        let usual = NOISE_WEIGHT * self.squares[place];
        let square = (usual + LOOKS * orders.beside[place]?) / (NOISE_WEIGHT + LOOKS);
        // What comes back without a fault grows with the turns as a fault does.
        let square = square * (1.0 + self.ripple[place] * orders.gain.powi(2));
        Some(square.max(SQUARE[0]).sqrt())
    }
}

/// How a fault shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TurningSignature {
    /// Name of the declared fault.
    pub fault: String,
    /// Runs that it was learned from.
    pub runs: usize,
    /// Real parts of the standardized amplitudes over their gain, order by order within each
    /// channel.
    pub real: Vec<f64>,
    /// The imaginary parts.
    pub imaginary: Vec<f64>,
}

/// A fault that comes back with the turns of a wheel.
#[derive(Debug, Clone)]
pub struct TurningFault {
    /// The wheel.
    pub wheel: usize,
    /// How its amplitudes vary without a fault.
    pub noise: WheelNoise,
    /// How the fault shows.
    pub signature: TurningSignature,
}

/// What speaks for a fault, by each phase and size of it.
struct Sought {
    /// Sums along the learned amplitudes.
    along: ByOrder,
    /// Square of these.
    square: f64,
    /// By how much amplitudes exceed those that were learned.
    gain: f64,
}

impl Sought {
    fn log_ratio(&self) -> f64 {
        let ratios: [f64; PHASES * SIZES.len()] = std::array::from_fn(|i| {
            let (size, phase) = (self.gain * SIZES[i / PHASES], (i % PHASES) as f64);
            2.0 * size * turned(&self.along, phase / PHASES as f64) - size * size * self.square
        });
        log_mean(&ratios)
    }

    /// The phase that explains most, in turns, behind the sum along it.
    fn likeliest_of(&self, phases: impl Iterator<Item = f64>) -> (f64, f64) {
        let found = phases.map(|phase| (turned(&self.along, phase), phase));
        found.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
    }

    /// Size and phase, in turns, that explain most; of size 0 if any other explains less.
    fn likeliest(&self) -> (f64, f64) {
        let step = 1.0 / PHASES as f64;
        let (_, coarse) = self.likeliest_of((0..PHASES).map(|i| i as f64 * step));
        let finer = |i: usize| coarse + step * (i as f64 / FINER as f64 - 1.0);
        let (along, phase) = self.likeliest_of((0..=2 * FINER).map(finer));
        (over(along.max(0.0), self.square), phase)
    }
}

type ByMemory<T> = [Option<T>; MEMORIES_TURNS.len()];

/// Amplitudes that a fault explains, in the units of the channels.
pub(super) struct Explained<'a> {
    fault: &'a TurningFault,
    orders: &'a WheelOrders,
    /// Size and phase of each order.
    by_order: ByOrder,
}

impl Explained<'_> {
    fn amplitude(&self, place: usize) -> Complex<f64> {
        let deviation = self.fault.noise.deviation(self.orders, place);
        let learned = self.fault.learned(place) * self.by_order[place % ORDERS];
        learned * deviation.unwrap_or(0.0)
    }
}

/// Logarithm of a mean, from logarithms.
fn log_mean(logarithms: &[f64]) -> f64 {
    log_sum_exp(logarithms) - (logarithms.len() as f64).ln()
}

/// Mean over the memories; none of none.
fn over_memories(found: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut ratios, mut count) = ([0.0; MEMORIES_TURNS.len()], 0);
    for (ratio, found) in ratios.iter_mut().zip(found) {
        (*ratio, count) = (found, count + 1);
    }
    (count > 0).then(|| log_mean(&ratios[..count]))
}

impl TurningFault {
    /// Log-likelihood ratio of the fault to health, by what its wheel shows: the mean over the
    /// memories that are filled. None if none is.
    #[must_use]
    pub fn log_ratio(&self, orders: &[WheelOrders]) -> Option<f64> {
        let alone = |own| self.sought(own, |_| Complex::default()).log_ratio();
        over_memories(self.told(orders).map(alone))
    }

    /// The same by what a fault of another wheel does not explain; by the memories that are filled
    /// for both wheels.
    pub(super) fn log_ratio_beside(
        &self,
        other: &ByMemory<Explained<'_>>,
        orders: &[WheelOrders],
    ) -> Option<f64> {
        let beside = |own: &WheelOrders| {
            let mut other = other.iter().flatten();
            let other = other.find(|one| one.orders.memory_turns == own.memory_turns)?;
            let shared = own.shared_with(other.fault.wheel);
            let explained = |place: usize| shared[place % ORDERS] * other.amplitude(place);
            Some(self.sought(own, explained).log_ratio())
        };
        over_memories(self.told(orders).filter_map(beside))
    }

    fn told<'a>(&self, orders: &'a [WheelOrders]) -> impl Iterator<Item = &'a WheelOrders> {
        let wheel = self.wheel;
        let own = orders.iter().filter(move |one| one.wheel == wheel);
        own.filter(|one| one.is_told())
    }

    fn learned(&self, place: usize) -> Complex<f64> {
        let signature = &self.signature;
        Complex::new(signature.real[place], signature.imaginary[place])
    }

    fn sought(&self, orders: &WheelOrders, explained: impl Fn(usize) -> Complex<f64>) -> Sought {
        let mut sought = Sought {
            along: ByOrder::default(),
            square: 0.0,
            gain: orders.gain,
        };
        for place in 0..self.signature.real.len() {
            let Some(deviation) = self.noise.deviation(orders, place) else {
                continue;
            };
            let explained = explained(place);
            let amplitude = orders.amplitudes[place] - explained;
            let unsure = deviation.hypot(UNSURE * explained.norm());
            let learned = self.learned(place) * (deviation / unsure);
            sought.along[place % ORDERS] += learned.conj() * amplitude / unsure;
            sought.square += learned.norm_sqr();
        }
        sought
    }

    /// What the likeliest size and phase explain, by each memory that is filled.
    pub(super) fn explained<'a>(&'a self, orders: &'a [WheelOrders]) -> ByMemory<Explained<'a>> {
        let mut told = self.told(orders).map(|orders| {
            let (size, phase) = self.sought(orders, |_| Complex::default()).likeliest();
            let of_order = |h: usize| Complex::from_polar(size, -TAU * (h + 1) as f64 * phase);
            Explained {
                fault: self,
                orders,
                by_order: std::array::from_fn(of_order),
            }
        });
        std::array::from_fn(|_| told.next())
    }
}

/// Real part of the sum over the orders, each turned on by a part of a turn.
#[must_use]
pub fn turned(along: &ByOrder, turns: f64) -> f64 {
    let one = Complex::from_polar(1.0, TAU * turns);
    let (mut phase, mut sum) = (one, 0.0);
    for order in along {
        sum += (order * phase).re;
        phase *= one;
    }
    sum
}

/// How all faults show that come back with the turns of a wheel.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TurningSignatures {
    /// The noise, by wheel.
    pub wheel: Vec<WheelNoise>,
    /// The faults of which labelled runs show enough.
    pub fault: Vec<TurningSignature>,
}

impl TurningSignatures {
    /// True if no fault has one.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.fault.is_empty()
    }

    /// The noise of a wheel.
    #[must_use]
    pub fn noise(&self, wheel: &str) -> Option<&WheelNoise> {
        self.wheel.iter().find(|noise| noise.wheel == wheel)
    }

    /// True if they are of this many channels.
    #[must_use]
    pub fn fits(&self, channels: usize) -> bool {
        let n = ORDERS * channels;
        let is_noise = |noise: &WheelNoise| {
            let is_square = |value: &f64| (0.0..=SQUARE[1]).contains(value);
            (noise.squares.len(), noise.ripple.len()) == (n, n)
                && noise.squares.iter().chain(&noise.ripple).all(is_square)
        };
        let is_whole = |one: &TurningSignature| {
            let mut numbers = one.real.iter().chain(&one.imaginary);
            (one.real.len(), one.imaginary.len()) == (n, n)
                && numbers.all(|value| value.abs() <= AMPLITUDE_MAX)
        };
        self.fault.len() <= DECLARED_MAX
            && self.wheel.len() <= DECLARED_MAX
            && self.wheel.iter().all(is_noise)
            && self.fault.iter().all(is_whole)
    }
}

#[cfg(test)]
mod tests;

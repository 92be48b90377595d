//! What labelled runs showed of a fault that comes back with each turn of a wheel.
//!
//! In standardized amplitudes `y`, complex and of unit variance without the fault, it shows as
//! `q a e^{-ihφ}`, with a learned `a`. The phase `φ` is that of the wheel when the record began,
//! which nobody knows, and the size `q` is that of this time. The log-likelihood ratio is that of
//! two Gaussian laws, `2q Re Σ (a e^{-ihφ})* y - q² Σ |a|²`, averaged over both.

use std::f64::consts::TAU;

use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use vigil_inference::logspace::log_sum_exp;

use super::orders::{MEMORIES_TURNS, ORDERS, WheelOrders};
use crate::fault_table::DECLARED_MAX;

/// Phases of a wheel that are tried.
const PHASES: usize = 36;
/// Sizes of a fault that are tried, relative to the one that was learned from.
const SIZES: [f64; 3] = [0.6, 1.0, 1.5];
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
}

impl WheelNoise {
    /// An amplitude over its deviation.
    #[must_use]
    pub fn standardized(&self, orders: &WheelOrders, place: usize) -> Complex<f64> {
        let usual = NOISE_WEIGHT * self.squares[place];
        let square = (usual + LOOKS * orders.beside[place]) / (NOISE_WEIGHT + LOOKS);
        orders.amplitudes[place] / square.clamp(SQUARE[0], SQUARE[1]).sqrt()
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
    /// Real parts of the standardized amplitudes, order by order within each channel.
    pub real: Vec<f64>,
    /// The imaginary parts.
    pub imaginary: Vec<f64>,
}

impl TurningSignature {
    /// Log-likelihood ratio of the fault to health, by what `wheel` shows: the mean over the
    /// memories that are filled. None if none is.
    #[must_use]
    pub fn log_ratio(
        &self,
        noise: &WheelNoise,
        wheel: usize,
        orders: &[WheelOrders],
    ) -> Option<f64> {
        let mut ratios = [f64::NEG_INFINITY; MEMORIES_TURNS.len()];
        let told = orders
            .iter()
            .filter(|one| one.wheel == wheel && one.is_told());
        let mut count = 0.0;
        for (ratio, orders) in ratios.iter_mut().zip(told) {
            *ratio = self.log_ratio_of(noise, orders);
            count += 1.0;
        }
        (count > 0.0).then(|| log_sum_exp(&ratios) - f64::ln(count))
    }

    /// The same of one memory, for any phase and any size of the fault.
    fn log_ratio_of(&self, noise: &WheelNoise, orders: &WheelOrders) -> f64 {
        let mut along = [Complex::default(); ORDERS];
        let mut square = 0.0;
        for (place, (real, imaginary)) in self.real.iter().zip(&self.imaginary).enumerate() {
            let learned = Complex::new(*real, *imaginary);
            along[place % ORDERS] += learned.conj() * noise.standardized(orders, place);
            square += learned.norm_sqr();
        }
        let mut ratios = [0.0; PHASES * SIZES.len()];
        for (i, ratio) in ratios.iter_mut().enumerate() {
            let size = SIZES[i / PHASES];
            *ratio = 2.0 * size * turned(&along, (i % PHASES) as f64 / PHASES as f64)
                - size * size * square;
        }
        log_sum_exp(&ratios) - (ratios.len() as f64).ln()
    }
}

/// Real part of the sum over the orders, each turned on by a part of a turn.
#[must_use]
pub fn turned(along: &[Complex<f64>; ORDERS], turns: f64) -> f64 {
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
            noise.squares.len() == n && noise.squares.iter().all(is_square)
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
mod tests {
    use super::*;

    fn noise() -> WheelNoise {
        WheelNoise {
            wheel: "L".to_owned(),
            squares: vec![4.0; ORDERS],
        }
    }

    fn signature() -> TurningSignature {
        TurningSignature {
            fault: "tyre".to_owned(),
            runs: 1,
            real: vec![1.0, 0.0, -0.5, 0.2, 0.0],
            imaginary: vec![0.0, 2.0, 0.5, 0.0, 0.1],
        }
    }

    fn orders(memory: usize, amplitude: f64, beside: f64) -> WheelOrders {
        WheelOrders {
            turns: 1e3,
            amplitudes: (0..ORDERS)
                .map(|h| Complex::from_polar(amplitude, h as f64))
                .collect(),
            beside: vec![beside; ORDERS],
            ..WheelOrders::new(0, MEMORIES_TURNS[memory], 1)
        }
    }

    /// Mean of the ratios of two Gaussian densities, phase by phase and size by size.
    fn by_densities(standardized: &[Complex<f64>]) -> f64 {
        let learned = signature();
        let mut sum = 0.0;
        for phase in 0..PHASES {
            let angle = TAU * phase as f64 / PHASES as f64;
            for size in SIZES {
                let mut log_ratio = 0.0;
                for (h, y) in standardized.iter().enumerate() {
                    let turned = Complex::from_polar(1.0, -(h as f64 + 1.0) * angle);
                    let mean = Complex::new(learned.real[h], learned.imaginary[h]) * turned * size;
                    log_ratio += y.norm_sqr() - (y - mean).norm_sqr();
                }
                sum += f64::exp(log_ratio);
            }
        }
        (sum / (PHASES * SIZES.len()) as f64).ln()
    }

    #[test]
    fn the_ratio_is_that_of_two_gaussian_laws_over_phases_and_sizes() {
        // Noise of the log 4, of the last turns 16, weighed alike: a variance of 10.
        let found = orders(0, 3.0, 16.0);
        let standardized: Vec<_> = found
            .amplitudes
            .iter()
            .map(|one| one / 10_f64.sqrt())
            .collect();
        let expected = by_densities(&standardized);
        let ratio = signature().log_ratio(&noise(), 0, &[found]).unwrap();
        assert!((ratio - expected).abs() < 1e-12, "{ratio} {expected}");
    }

    #[test]
    fn memories_are_averaged_once_filled_and_other_wheels_say_nothing() {
        let (short, long) = (orders(0, 3.0, 4.0), orders(1, 9.0, 4.0));
        let of = |orders: &[WheelOrders]| signature().log_ratio(&noise(), 0, orders);
        let [a, b] = [&short, &long].map(|one| of(std::slice::from_ref(one)).unwrap().exp());
        let both = of(&[short.clone(), long.clone()]).unwrap();
        assert!((both - (0.5 * (a + b)).ln()).abs() < 1e-12);
        let unfilled = WheelOrders { turns: 1.0, ..long };
        assert!((of(&[short.clone(), unfilled.clone()]).unwrap() - a.ln()).abs() < 1e-12);
        assert!(of(&[unfilled]).is_none());
        assert!(of(&[WheelOrders { wheel: 1, ..short }]).is_none());
    }

    #[test]
    fn an_odd_file_does_not_fit() {
        let of = |real: usize, square: f64| TurningSignatures {
            wheel: vec![WheelNoise {
                wheel: "L".to_owned(),
                squares: vec![square; ORDERS],
            }],
            fault: vec![TurningSignature {
                real: vec![0.0; real],
                ..signature()
            }],
        };
        assert!(of(ORDERS, 1.0).fits(1) && TurningSignatures::default().fits(7));
        assert!(!of(ORDERS, 1.0).fits(2) && !of(4, 1.0).fits(1));
        for wrong in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(!of(ORDERS, wrong).fits(1), "{wrong}");
        }
        let mut wrong = of(ORDERS, 1.0);
        wrong.fault[0].imaginary[2] = f64::NAN;
        assert!(!wrong.fits(1));
    }
}

//! E-detectors of a channel whose every reading stands for itself: a rate, an angle, a current.
//!
//! **Null.** The residual (reading less prediction) is `r_t = c_t + n_t`. The context c obeys
//! `|c_t| <= d_t` and `|c_t - c_(t-1)| <= δ_t`; it may know the past. The noise is a first-order
//! process `n_t = ρ a n_(t-1) + e_t` with `a = s_t / s_(t-1)`, ρ anywhere between two bounds, and e
//! sub-Gaussian, given the past, with `s_t √(1 - ρ²)` or less. So Gaussian noise of any deviation
//! up to s and any such correlation belongs to it.
//!
//! **Bound of the mean.** Given the past, `r_t = e_t + ρ a r_(t-1) + (c_t - ρ a c_(t-1))`. The
//! largest mean over the null is
//!
//! ```text
//! u_t = max over ρ of  ρ a r_(t-1) + max over |x| <= d_(t-1) of  min(d_t, x + δ_t) - ρ a x
//! ```
//!
//! The inner term is concave and piecewise linear in x: its maximum lies at `±d_(t-1)` or at the
//! bend `d_t - δ_t`. The whole is convex in ρ: its maximum lies at a bound. The smallest mean
//! mirrors it. With a slow context and a known ρ this is `(1 - ρ) d`, to which a shift that lasts
//! is compared: noise that is correlated is whitened, not averaged.
//!
//! **E-values** of the module's (3), for either sign and some tilts, and one for scatter without a
//! mean: with `x = max(r - u, l - r, 0) / s <= |e| / s`,
//!
//! ```text
//! E = √(1 - 2γ) exp(γ x²),  0 < γ < 1/2,
//! ```
//!
//! has mean 1 or less, as `E exp(γ e² / s²) <= 1 / √(1 - 2γ)` for e sub-Gaussian with s.

use vigil_checkpoint::CheckpointValue;

use super::EDetector;

/// Tilts θ, in deviations of the noise: shifts beyond the bound that are looked for. A shift
/// between two of them, a factor 2 apart, grows at 8/9 of the best rate or more.
const TILTS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Exponent γ of scatter: that of a deviation √5 times as large.
const SCATTER: f64 = 0.4;
/// One reading says so much at most, nats: no alarm stands on one reading alone, where a promise of
/// a day asks for more than 13 nats at 50 ms.
const LOG_E_MAX: f64 = 8.0;
/// Detectors of a channel.
const COUNT: usize = 2 * TILTS.len() + 1;

/// A reading, and what is declared of it.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct LevelReading {
    /// Reading less prediction, in the channel's unit.
    pub residual: f64,
    /// Largest magnitude d of the context, same unit.
    pub tolerance: f64,
    /// Largest change δ of the context since the last reading, same unit; infinite: any.
    pub change: f64,
    /// Largest deviation s of the noise, same unit, above 0.
    pub sd: f64,
    /// Time since the last reading, h.
    pub elapsed_h: f64,
}

/// The bounds of a reading's mean, and the largest deviation about it, given the past.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditional {
    /// Smallest mean.
    pub lower: f64,
    /// Largest mean.
    pub upper: f64,
    /// Largest deviation.
    pub sd: f64,
}

impl Conditional {
    /// Of a reading after another one, for noise whose correlation lies between these bounds.
    #[must_use]
    pub fn new(before: &LevelReading, now: &LevelReading, correlation: [f64; 2]) -> Self {
        let [lowest, highest] = correlation;
        let ratio = now.sd / before.sd;
        let upper = |residual: f64| {
            let of = |correlation: f64| correlation * ratio * residual;
            let at = |rho: f64| of(rho) + context(rho * ratio, before.tolerance, now);
            at(lowest).max(at(highest))
        };
        let least = 0.0_f64.clamp(lowest, highest.max(lowest));
        Self {
            lower: -upper(-before.residual),
            upper: upper(before.residual),
            sd: now.sd * (1.0 - least * least).sqrt(),
        }
    }

    /// Natural logarithms of the E-values of a residual: shifts upwards and downwards, and scatter.
    #[must_use]
    pub fn log_e(&self, residual: f64) -> [f64; COUNT] {
        let above = (residual - self.upper) / self.sd;
        let below = (self.lower - residual) / self.sd;
        let beyond = above.max(below).max(0.0);
        let scatter = 0.5 * (1.0 - 2.0 * SCATTER).ln() + SCATTER * beyond * beyond;
        let mut all = [scatter; COUNT];
        for (i, tilt) in TILTS.into_iter().enumerate() {
            let of = |excess: f64| tilt * excess - 0.5 * tilt * tilt;
            (all[2 * i], all[2 * i + 1]) = (of(above), of(below));
        }
        all.map(|log_e| log_e.min(LOG_E_MAX))
    }
}

/// Largest `c_t - ρ c_(t-1)`, where `rho` holds the ratio of deviations.
fn context(rho: f64, before: f64, now: &LevelReading) -> f64 {
    let bend = (now.tolerance - now.change).clamp(-before, before);
    let at = |x: f64| now.tolerance.min(x + now.change) - rho * x;
    at(-before).max(at(bend)).max(at(before))
}

/// The detectors of one channel.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Level {
    correlation: [f64; 2],
    before: Option<LevelReading>,
    detectors: [EDetector; COUNT],
}

impl Level {
    /// Of noise whose correlation of successive readings lies between these bounds, within ±1.
    #[must_use]
    pub fn new(correlation: [f64; 2]) -> Self {
        Self {
            correlation,
            before: None,
            detectors: [EDetector::default(); COUNT],
        }
    }

    /// Mean M of its detectors, h.
    #[must_use]
    pub fn hours(&self) -> f64 {
        let sum: f64 = self.detectors.iter().map(EDetector::hours).sum();
        sum / COUNT as f64
    }

    /// The next reading does not follow the last one: it is taken as the first, and not weighed.
    pub const fn interrupt(&mut self) {
        self.before = None;
    }

    /// Forgets what speaks for a fault.
    pub fn forget(&mut self) {
        self.detectors = [EDetector::default(); COUNT];
    }

    /// Takes a reading. One that is no number, or of no bounds, is none and interrupts.
    pub fn step(&mut self, reading: &LevelReading) {
        let bounds = [reading.tolerance, reading.elapsed_h];
        let is_sane =
            bounds.iter().all(|value| (0.0..1e12).contains(value)) && reading.change >= 0.0;
        if !(is_sane && reading.residual.is_finite() && (1e-12..1e12).contains(&reading.sd)) {
            self.before = None;
            return;
        }
        let Some(before) = self.before.replace(*reading) else {
            return;
        };
        let given = Conditional::new(&before, reading, self.correlation);
        let all = given.log_e(reading.residual);
        for (detector, log_e) in self.detectors.iter_mut().zip(all) {
            detector.step(log_e, reading.elapsed_h);
        }
    }
}

#[cfg(test)]
mod tests;

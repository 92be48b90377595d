//! E-detectors of a channel that is measured as a position: heading, or travel along an axis.
//!
//! A drift of a position by less than the noise of one reading shows over many of them. Readings
//! are taken in blocks of K steps, which are *disjoint*: a block begins with a reading that belongs
//! to no other one.
//!
//! **Null.** Measured less predicted position since the block's first reading is `z_k = x_1 + .. +
//! x_k + w_1 + .. + w_k + n_k - n_0`, k = 0 to K. The context's steps obey `|x_k| <= β_k` and may
//! know the past; w is sub-Gaussian, given the past, with variance `q_k`; the noise n is a
//! first-order process with a correlation of magnitude ρ or less, innovations sub-Gaussian, a
//! deviation of s or less, and never larger than `BOUND` s.
//!
//! **Statistic.** `S = Σ h_k z_k` with `h_k = k - K/2`: the slope of a straight line by least
//! squares, times a constant. As `Σ h_k = 0`, the noise of the first reading drops out of the
//! others. The steps enter as `Σ H_j (x_j + w_j)` with `H_j = h_j + .. + h_K = j (K + 1 - j) / 2`,
//! which is never negative. So with `u = Σ H_j β_j + c` for all trajectories of the context
//!
//! ```text
//! S <= u + Σ H_j w_j + Σ h_k m_k,    m: the noise without its part from before the block,
//! c  = BOUND s · (K / 2) ρ / (1 - ρ)                        >= that part, Σ h_k ρ^(k+1) n_(-1),
//! V  = s² (1 + ρ) / (1 - ρ) · K (K + 1) (K + 2) / 12 + Σ H_j² q_j >= the variance of the rest.
//! ```
//!
//! The first term of V holds for innovations of variance `s² (1 - ρ²)` by Young's inequality for
//! convolutions, `Σ_j (Σ_(k>=j) h_k ρ^(k-j))² <= Σ h_k² / (1 - ρ)²`, and `Σ h_k² = K (K + 1) (K +
//! 2) / 12`. The E-value is `exp(λ (S - u) - λ² V / 2)`, likewise for -S, with λ fixed when the
//! block begins: as in (3) of [`super`], it lies below one of noise alone, whatever the drive is
//! and whoever steers by the readings.
//!
//! **Within a block.** Let `L_j = exp(λ (its parts up to j) - λ² V_j / 2)`, of the noise after j
//! readings: a supermartingale that begins at 1 and ends above the E-value. What a detector has is
//! thus `L_j (M + h)`, and nobody can read it off: a block that goes badly has lost of M already,
//! though it shows only at the end. To hold M until then, and let an alarm of another detector or
//! the end of the drive decide whether the block ever ends, would bet on good blocks alone. So
//!
//! - between its first and its last reading a block vouches for nothing, [`Path::vouched_hours`];
//! - a block that the drive breaks off costs all that the detector has, [`Path::abandon`]; only
//!   one that lacks a reading for reasons that know nothing of the noise is free, [`Path::skip`];
//! - h, known when the block begins, is the time that has passed until then.

use vigil_checkpoint::CheckpointValue;

use super::EDetector;

/// Largest noise of a reading in its deviations. By chance a Gaussian exceeds it once in 1.7
/// million readings.
pub const BOUND: f64 = 5.0;
/// Tilts, in deviations of the statistic. A drift between two of them, a factor 2 apart, grows at
/// 8/9 of the best rate or more.
const TILTS: [f64; 3] = [1.5, 3.0, 6.0];
/// One block says so much at most, nats: more than an alarm needs. It bounds what one can say.
const LOG_E_MAX: f64 = 40.0;

/// A reading of a position, and what is declared of the step to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathReading {
    /// Measured less predicted position since the block's first reading.
    pub apart: f64,
    /// Largest magnitude β of what the context adds in this step.
    pub step_max: f64,
    /// Variance q of what chance adds in this step.
    pub step_variance: f64,
    /// Largest variance s² of the reading's noise.
    pub noise_variance: f64,
    /// Time since the last reading, h.
    pub elapsed_h: f64,
}

/// A block under way.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
struct Block {
    k: u32,
    /// Noise by which λ was fixed.
    first_variance: f64,
    noise_variance: f64,
    statistic: f64,
    mean_max: f64,
    step_variance: f64,
    /// Time until it began that no earlier one has counted, h.
    before_h: f64,
}

/// What a whole block has shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// The statistic S.
    pub statistic: f64,
    /// Largest magnitude u of its mean.
    pub mean_max: f64,
    /// Variance V of the rest.
    pub variance: f64,
    /// Deviation by which λ was fixed.
    pub unit: f64,
}

impl Slope {
    /// Natural logarithms of the E-values for a drift upwards and downwards, by tilt.
    #[must_use]
    pub fn log_e(&self) -> [[f64; TILTS.len()]; 2] {
        [self.statistic, -self.statistic].map(|statistic| {
            TILTS.map(|tilt| {
                let by = tilt / self.unit;
                let log_e = by * (statistic - self.mean_max) - 0.5 * by * by * self.variance;
                log_e.min(LOG_E_MAX)
            })
        })
    }
}

/// The detectors of one channel, for blocks of one length.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Path {
    steps: u32,
    correlation: f64,
    block: Option<Block>,
    /// Time that no block has counted, h.
    uncounted_h: f64,
    detectors: [[EDetector; TILTS.len()]; 2],
}

impl Path {
    /// Blocks of `steps` steps, at least 2; noise whose correlation of successive readings has this
    /// magnitude at most, below 1.
    #[must_use]
    pub fn new(steps: u32, correlation: f64) -> Self {
        Self {
            steps: steps.max(2),
            correlation: correlation.clamp(0.0, 0.99),
            block: None,
            uncounted_h: 0.0,
            detectors: Default::default(),
        }
    }

    /// Mean M of its detectors, h: after the last block that has ended.
    #[must_use]
    pub fn hours(&self) -> f64 {
        let all = self.detectors.iter().flatten();
        all.map(EDetector::hours).sum::<f64>() / (2 * TILTS.len()) as f64
    }

    /// The same for an alarm now: 0 while a block is under way.
    #[must_use]
    pub fn vouched_hours(&self) -> f64 {
        match self.block {
            None => self.hours(),
            Some(_) => 0.0,
        }
    }

    /// Drops the block under way, because a reading lacks. That must not depend on the noise.
    pub fn skip(&mut self) {
        if let Some(block) = self.block.take() {
            self.uncounted_h += block.before_h;
        }
    }

    /// Drops the block under way for any reason, and with it all that the detectors have. Without
    /// one they keep it.
    pub fn abandon(&mut self) {
        if self.block.is_some() {
            self.forget();
        }
    }

    /// Forgets what speaks for a fault, the block under way included.
    pub fn forget(&mut self) {
        *self = Self::new(self.steps, self.correlation);
    }

    /// True if the next reading begins a block.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.block.is_none()
    }

    /// Begins a block with a reading whose noise has this largest variance, `elapsed_h` after the
    /// one before.
    pub fn begin(&mut self, noise_variance: f64, elapsed_h: f64) {
        self.uncounted_h += elapsed_h.max(0.0);
        let is_sane = noise_variance > 0.0 && noise_variance.is_finite();
        self.block = is_sane.then(|| Block {
            k: 0,
            first_variance: noise_variance,
            noise_variance,
            statistic: 0.0,
            mean_max: 0.0,
            step_variance: 0.0,
            before_h: std::mem::take(&mut self.uncounted_h),
        });
    }

    /// Takes the block's next reading; what the block has shown, if it ends with it. A reading that
    /// is no number abandons the block.
    pub fn step(&mut self, reading: &PathReading) -> Option<Slope> {
        let mut block = self.block.take()?;
        block.k += 1;
        let (steps, k) = (f64::from(self.steps), f64::from(block.k));
        let after = 0.5 * k * (steps + 1.0 - k);
        block.statistic += (k - 0.5 * steps) * reading.apart;
        block.mean_max += after * reading.step_max.abs();
        block.step_variance += after * after * reading.step_variance.abs();
        block.noise_variance = block.noise_variance.max(reading.noise_variance);
        self.uncounted_h += reading.elapsed_h.max(0.0);
        let all = [block.statistic, block.mean_max, block.step_variance];
        if !all.iter().all(|value| value.is_finite()) || !block.noise_variance.is_finite() {
            self.forget();
            return None;
        }
        if block.k < self.steps {
            self.block = Some(block);
            return None;
        }
        let slope = self.slope(&block);
        for (detectors, all) in self.detectors.iter_mut().zip(slope.log_e()) {
            for (detector, log_e) in detectors.iter_mut().zip(all) {
                detector.step(log_e, block.before_h);
            }
        }
        Some(slope)
    }

    fn slope(&self, block: &Block) -> Slope {
        let (steps, rho) = (f64::from(self.steps), self.correlation);
        let squares = steps * (steps + 1.0) * (steps + 2.0) / 12.0;
        let colour = (1.0 + rho) / (1.0 - rho);
        let from_before = BOUND * block.noise_variance.sqrt() * 0.5 * steps * rho / (1.0 - rho);
        Slope {
            statistic: block.statistic,
            mean_max: block.mean_max + from_before,
            variance: block.noise_variance * colour * squares + block.step_variance,
            unit: (block.first_variance * colour * squares).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests;

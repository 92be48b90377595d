//! The detection filter's evidence from gyro and currents.
//!
//! A current is held against what is expected of it, and against the other wheels: what a weak
//! motor no longer carries the others carry, while ground and load change all of them. The gyro is
//! held against the turn of the pose's track. Each has a learned departure of its own, and a flag
//! of exact repeats.

use vigil_blocks::WHEELS;
use vigil_checkpoint::Checkpoint;
use vigil_inference::ages::WhitenedResidual;

use super::form::{Evidence, Form};
use super::further::Further;
use super::further_watch::{FurtherWatch, GYRO, Residual, Turn};
use super::repeats::Repeats;
use super::{Model, Observation};
use crate::description::Description;
use crate::slot::Slot;
use crate::suspects::Suspects;

/// Shares of the prior beside those of the other channels: how a fault of these first shows. A
/// share counts by its logarithm only: half as much is 0.7 nats later.
const SHARE_CURRENTS: f64 = 0.3;
const SHARE_GYRO: f64 = 0.05;
const SHARE_REPEATS: f64 = 0.05;
/// Standard deviation of a fault's bias in units of the whitened residual: half the torque of one
/// wheel moves its current by about half a deviation, a broken sensor by many.
/// Chosen: it enters by its logarithm only.
const BIAS_CURRENT: f64 = 1.0;
const BIAS_GYRO: f64 = 3.0;

/// Evidence of gyro and currents.
#[derive(Debug, Clone, Checkpoint)]
pub(super) struct FurtherEvidence {
    watch: FurtherWatch,
    #[checkpoint(fixed)]
    form: Form,
    currents: [Evidence<1>; WHEELS],
    gyro: Evidence<1>,
    repeats: [Repeats; WHEELS + 1],
    /// What the last observation said for a departure.
    gains: [f64; WHEELS + 1],
}

impl FurtherEvidence {
    /// Nothing seen yet; None if the model knows none of these channels.
    pub fn new(model: &Model, robot: &Description, form: Form) -> Option<Self> {
        let watch = FurtherWatch::new(model, robot)?;
        Some(Self {
            watch,
            form,
            currents: [Evidence::new(form, BIAS_CURRENT); WHEELS],
            gyro: Evidence::new(form, BIAS_GYRO),
            repeats: [Repeats::default(); WHEELS + 1],
            gains: [0.0; WHEELS + 1],
        })
    }

    /// Forgets everything.
    pub fn reset(&mut self, robot: &Description) {
        self.watch.reset(robot);
        self.forget();
    }

    /// Forgets what speaks for a fault.
    pub fn forget(&mut self) {
        self.currents = [Evidence::new(self.form, BIAS_CURRENT); WHEELS];
        self.gyro = Evidence::new(self.form, BIAS_GYRO);
        self.repeats = [Repeats::default(); WHEELS + 1];
        self.gains = [0.0; WHEELS + 1];
    }

    /// True once the channels' noise is known.
    pub fn is_known(&self) -> bool {
        self.watch.is_known()
    }

    /// Takes one observation, at rest too. `birth` gives the probability that a fault appears for a
    /// share of the prior.
    pub fn step(
        &mut self,
        model: &Model,
        robot: &Description,
        (observation, further): (&Observation, &Further),
        (turn, suspects): (Option<Turn>, Suspects),
        birth: impl Fn(f64) -> f64,
    ) {
        self.gains = [0.0; WHEELS + 1];
        self.repeats
            .iter_mut()
            .for_each(|repeats| repeats.gain = 0.0);
        let seen = (observation, further);
        let Some(residuals) = self.watch.take(model, robot, seen, turn, suspects) else {
            return;
        };
        let share = 1.0 / self.watch.wheels().max(1) as f64;
        let currents = self.watch.model().currents.as_ref();
        if let Some(healthy) = currents.map(|currents| currents.repeat_rate) {
            for wheel in 0..self.watch.wheels() {
                let birth = birth(SHARE_REPEATS * share);
                self.repeats[wheel].step(&further.currents[wheel], healthy, birth);
            }
            self.weigh_currents(&residuals.currents, birth(SHARE_CURRENTS * share));
        }
        if let Some(gyro) = self.watch.model().yaw_rate {
            let birth_repeats = birth(SHARE_REPEATS);
            self.repeats[GYRO].step(&further.yaw_rate, gyro.repeat_rate, birth_repeats);
        }
        if let Some(residual) = residuals.yaw_rate {
            let whitened = whitened(residual.apart, residual.variance, residual.outlier_rate);
            let birth = birth(SHARE_GYRO);
            self.gyro.step(&whitened, birth);
            self.gains[GYRO] = self.gyro.gain();
        }
    }

    /// Each wheel's current against the mean of the others', beside what is expected of them.
    fn weigh_currents(&mut self, all: &[Option<Residual>; WHEELS], birth: f64) {
        let known = || all.iter().flatten();
        let mut sums = Sums::default();
        for residual in known() {
            sums.apart += residual.apart;
            sums.variance += residual.variance;
        }
        let others = known().count().saturating_sub(1) as f64;
        if others < 1.0 {
            return;
        }
        for (wheel, residual) in all.iter().enumerate() {
            let Some(residual) = residual else { continue };
            let (apart, variance) = sums.contrast(residual.apart, residual.variance, others);
            let whitened = whitened(apart, variance, residual.outlier_rate);
            self.currents[wheel].step(&whitened, birth);
            self.gains[wheel] = self.currents[wheel].gain();
        }
    }

    /// Log-odds and last gain of each channel: `(index, log_odds, gain)`; see [`Slot`].
    pub fn channels(&self, mut enter: impl FnMut(usize, f64, f64)) {
        for at in (0..self.watch.wheels()).chain([GYRO]) {
            let (channel, evidence) = match at {
                GYRO => (Slot::YAW_RATE, &self.gyro),
                wheel => (Slot::current(wheel), &self.currents[wheel]),
            };
            enter(channel, evidence.log_odds(), self.gains[at]);
            let repeats = &self.repeats[at];
            enter(channel, repeats.log_odds, repeats.gain);
        }
    }
}

/// A bias is taken to show in full in whatever variance: what these channels do while the command
/// changes is modelled too coarsely to learn from it how large a bias is.
fn whitened(apart: f64, variance: f64, outlier_rate: f64) -> WhitenedResidual<1> {
    WhitenedResidual::new(apart, variance, 0.0, outlier_rate)
}

/// Sums over the residuals of all wheels.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    apart: f64,
    variance: f64,
}

impl Sums {
    /// One of the summed residuals less the mean of the `others` (how many), and the variance of
    /// that difference.
    fn contrast(self, apart: f64, variance: f64, others: f64) -> (f64, f64) {
        let mean = (self.apart - apart) / others;
        let rest = (self.variance - variance) / (others * others);
        (apart - mean, variance + rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wheel_stands_out_by_itself_and_what_all_have_in_common_does_not() {
        let values = [0.3 - 0.12, 0.3, 0.3, 0.3, 0.3, 0.3];
        let all = Sums {
            apart: values.iter().sum(),
            variance: 6.0 * 0.01,
        };
        let (apart, variance) = all.contrast(values[0], 0.01, 5.0);
        assert!((apart + 0.12).abs() < 1e-12);
        assert!((variance - 0.012).abs() < 1e-12);
        let (apart, _) = all.contrast(values[1], 0.01, 5.0);
        assert!((apart - 0.024).abs() < 1e-12);
    }
}

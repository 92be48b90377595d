//! What the ground and the load make of the wheels' rates: slow states, estimated under way.
//!
//! All wheels fall behind together by a share of their rates (a soft ground, a slope), and each
//! differs a little from the others. The common share is found from the median over the wheels,
//! which a broken encoder or a stuck wheel does not move; a wheel far off teaches nothing of
//! itself.

use vigil_blocks::{HealthyBelief, WHEELS};
use vigil_checkpoint::CheckpointValue;
use vigil_inference::slow_state::SlowState;

use crate::tolerance::Tolerance;

/// Rates below so many tolerances of one wheel's rate tell little of a share of them: that
/// tolerance is a fifth of them, and more.
const TURNS: f64 = 5.0;
/// Variance of the median of normal values over that of their mean.
const MEDIAN: f64 = std::f64::consts::FRAC_PI_2;
/// Deviations from what is expected beyond which a reading teaches nothing: one healthy one in
/// 16,000 lies so far out.
pub const FAR_SD: f64 = 4.0;
/// A variance that no state has, (rad/s)². Chosen: a deviation of 1000 rad/s, beyond any wheel.
const VARIANCE_MAX: f64 = 1e6;

/// Residual of one wheel's rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateResidual {
    /// Measured rate minus the model's, rad/s.
    pub residual_rad_s: f64,
    /// Rate by rolling without slip, rad/s.
    pub rolling_rad_s: f64,
    /// Variance of `residual_rad_s` in a known context, (rad/s)².
    pub variance: f64,
}

/// The slow states of the wheels; without a tolerance they are 0 for certain.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct WheelContext {
    tolerance: Option<Tolerance>,
    ratio: SlowState,
    offsets: [SlowState; WHEELS],
}

impl WheelContext {
    /// What is known before the robot moves.
    #[must_use]
    pub fn new(tolerance: Option<Tolerance>) -> Self {
        let drifts = tolerance.map(|tolerance| (tolerance.wheels(), tolerance.wheel()));
        drifts.map_or_else(Self::default, |(together, alone)| Self {
            tolerance,
            ratio: SlowState::new(&together),
            offsets: [SlowState::new(&alone); WHEELS],
        })
    }

    /// Writes the states into a block.
    pub fn write(&self, block: &mut HealthyBelief) {
        block.wheel_ratio = [self.ratio.mean, self.ratio.variance];
        block.wheel_offset = self.offsets.map(|offset| offset.mean);
        block.wheel_offset_variance = self.offsets.map(|offset| offset.variance);
    }

    /// The states of a block, with this tolerance; None if one is no state.
    #[must_use]
    pub fn read(&self, block: &HealthyBelief) -> Option<Self> {
        let state = |mean: f64, variance: f64| SlowState { mean, variance };
        let [ratio, variance] = block.wheel_ratio;
        let offsets = block.wheel_offset.iter().zip(block.wheel_offset_variance);
        let mut read = Self {
            ratio: state(ratio, variance),
            ..*self
        };
        for (offset, (&mean, variance)) in read.offsets.iter_mut().zip(offsets) {
            *offset = state(mean, variance);
        }
        let is_sane = |state: &SlowState| {
            state.mean.is_finite() && (0.0..=VARIANCE_MAX).contains(&state.variance)
        };
        (is_sane(&read.ratio) && read.offsets.iter().all(is_sane)).then_some(read)
    }

    /// Rate (rad/s) to add to the model's for a wheel that would roll at `rolling_rad_s`, and its
    /// variance.
    #[must_use]
    pub fn shift(&self, wheel: usize, rolling_rad_s: f64) -> (f64, f64) {
        let (ratio, offset) = (&self.ratio, &self.offsets[wheel]);
        (
            ratio.mean * rolling_rad_s + offset.mean,
            ratio.variance * rolling_rad_s * rolling_rad_s + offset.variance,
        )
    }

    /// Forgets over a travel of `travel_m`, as the ground changes.
    pub fn fade(&mut self, travel_m: f64) {
        let Some(tolerance) = &self.tolerance else {
            return;
        };
        self.ratio.fade(travel_m, &tolerance.wheels());
        for offset in &mut self.offsets {
            offset.fade(travel_m, &tolerance.wheel());
        }
    }

    /// Learns from the wheels that were read.
    pub fn learn(&mut self, wheels: &[Option<RateResidual>; WHEELS]) {
        let Some(tolerance) = self.tolerance else {
            return;
        };
        if let Some((ratio, variance)) = self.median_ratio(wheels) {
            self.ratio.learn(ratio, 1.0, variance, &tolerance.wheels());
        }
        for (wheel, beside) in wheels.iter().enumerate() {
            let Some(beside) = beside else { continue };
            let (shift, uncertain) = self.shift(wheel, beside.rolling_rad_s);
            let apart = beside.residual_rad_s - shift;
            let spread = beside.variance + uncertain;
            if apart * apart <= FAR_SD * FAR_SD * spread {
                let offset = &mut self.offsets[wheel];
                let noise = spread - offset.variance;
                offset.learn(apart + offset.mean, 1.0, noise, &tolerance.wheel());
            }
        }
    }

    /// Median over the wheels that turn of the share by which they fall behind, and its variance.
    fn median_ratio(&self, wheels: &[Option<RateResidual>; WHEELS]) -> Option<(f64, f64)> {
        let (mut ratios, mut count, mut variance) = ([0.0; WHEELS], 0, 0.0);
        let rate = |tolerance: Tolerance| tolerance.wheel_rate_rad_s;
        let least_rad_s = TURNS * self.tolerance.map_or(0.0, rate);
        for (beside, offset) in wheels.iter().zip(&self.offsets) {
            let turns = beside.filter(|beside| beside.rolling_rad_s.abs() >= least_rad_s);
            let Some(beside) = turns else { continue };
            ratios[count] = (beside.residual_rad_s - offset.mean) / beside.rolling_rad_s;
            variance += beside.variance / (beside.rolling_rad_s * beside.rolling_rad_s);
            count += 1;
        }
        let ratios = &mut ratios[..count];
        ratios.sort_unstable_by(f64::total_cmp);
        let middle = *ratios.get(count / 2)?;
        let median = if count % 2 == 1 {
            middle
        } else {
            0.5 * (middle + ratios[count / 2 - 1])
        };
        let number = count as f64;
        Some((median, MEDIAN * variance / (number * number)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance = Tolerance {
        yaw_rad_m: 0.01,
        forward_m_m: 0.05,
        lateral_m_m: 0.02,
        wheel_ratio: 0.06,
        wheel_rate_rad_s: 0.04,
        steer_rad: 0.01,
        length_m: 4.0,
        further: None,
    };

    fn read(apart: [f64; 6], rolling: f64) -> [Option<RateResidual>; WHEELS] {
        std::array::from_fn(|wheel| {
            apart.get(wheel).map(|&residual_rad_s| RateResidual {
                residual_rad_s,
                rolling_rad_s: rolling,
                variance: 0.0025,
            })
        })
    }

    #[test]
    fn all_wheels_fall_behind_at_every_rate_whatever_one_of_them_reads() {
        let mut context = WheelContext::new(Some(TOLERANCE));
        for step in 0..400 {
            let rolling = if step % 80 < 40 { 1.0 } else { 3.0 };
            let mut apart = [-0.035 * rolling; 6];
            apart[2] = -rolling;
            context.fade(0.01);
            context.learn(&read(apart, rolling));
        }
        for rolling in [1.0, 3.0] {
            for wheel in [0, 1, 3, 4, 5] {
                let (shift, variance) = context.shift(wheel, rolling);
                assert!((shift + 0.035 * rolling).abs() < 0.01, "{wheel}: {shift}");
                assert!(variance < 0.03 * 0.03);
            }
            assert!(context.shift(2, rolling).0 > -0.08 * rolling);
        }
    }

    #[test]
    fn what_is_beyond_the_tolerance_stays_apart_for_good() {
        let mut context = WheelContext::new(Some(TOLERANCE));
        for _ in 0..10_000 {
            context.learn(&read([0.0, 0.0, 0.12, 0.0, 0.0, 0.0], 2.0));
        }
        let (shift, _) = context.shift(2, 2.0);
        assert!((0.035..0.0405).contains(&shift), "{shift}");
    }

    #[test]
    fn without_a_tolerance_nothing_is_learned() {
        let mut context = WheelContext::new(None);
        context.learn(&read([-0.1; 6], 2.0));
        context.fade(1.0);
        assert_eq!(context.shift(0, 2.0), (0.0, 0.0));
    }
}

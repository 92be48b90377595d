//! What slopes and the load make of the motors' currents, and the gyro's bias: slow states,
//! estimated under way.
//!
//! On level ground of any soil a healthy rover's currents are what its bearings and the scrub of
//! its turns demand. A slope ahead adds about the same to every wheel; a slope to the side is
//! carried by the steered wheels, along which it has a component. Both begin within metres. How
//! unevenly the wheels share them depends on loads and turns: an offset of each wheel may be as
//! large as a share of them.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::slow_state::{Drift, SlowState};

use super::wheel_context::FAR_SD;
use crate::tolerance::FurtherTolerance;

/// Length within which slopes come and go, m: chosen, a quarter of that of other ground.
const SLOPE_LENGTH_M: f64 = 2.0;

/// One wheel's current beside the model's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CurrentBeside {
    /// Current as read less that of the model, A.
    pub apart_a: f64,
    /// Its variance in a known context, A².
    pub variance: f64,
    /// Sine of the wheel's steering angle: how much of a pull to the side it carries.
    pub sin_steer: f64,
}

/// The slow states of the currents; without a tolerance they are 0 for certain.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub(super) struct CurrentContext {
    tolerance: Option<FurtherTolerance>,
    /// By what pulls ahead, A in every wheel, and to the side, A in a wheel steered by 90 degrees.
    ahead: SlowState,
    aside: SlowState,
    offsets: [SlowState; WHEELS],
}

impl CurrentContext {
    /// What is known before the robot moves.
    pub fn new(tolerance: Option<FurtherTolerance>) -> Self {
        let Some(known) = tolerance else {
            return Self::default();
        };
        let pull = SlowState::new(&pull(&known));
        Self {
            tolerance,
            ahead: pull,
            aside: pull,
            offsets: [SlowState::new(&own(&known, 0.0)); WHEELS],
        }
    }

    /// Current (A) to add to the model's for a wheel, and its variance beside what all share.
    pub fn shift(&self, wheel: usize, sin_steer: f64) -> (f64, f64) {
        let offset = &self.offsets[wheel];
        let shift = self.ahead.mean + self.aside.mean * sin_steer + offset.mean;
        (
            shift,
            offset.variance + self.aside.variance * sin_steer * sin_steer,
        )
    }

    /// Forgets over a travel of `travel_m`, as the ground changes.
    pub fn fade(&mut self, travel_m: f64) {
        let Some(known) = &self.tolerance else {
            return;
        };
        self.ahead.fade(travel_m, &pull(known));
        self.aside.fade(travel_m, &pull(known));
        let own = own(known, self.ahead.mean.abs() + self.aside.mean.abs());
        for offset in &mut self.offsets {
            offset.fade(travel_m, &own);
        }
    }

    /// Learns from the wheels that were read. One far from the others teaches nothing.
    pub fn learn(&mut self, wheels: &[Option<CurrentBeside>; WHEELS]) {
        let Some(known) = self.tolerance else {
            return;
        };
        let mut apart = [0.0; WHEELS];
        let mut count = 0;
        for (wheel, beside) in wheels.iter().enumerate() {
            let Some(beside) = beside else { continue };
            apart[count] = beside.apart_a - self.shift(wheel, beside.sin_steer).0;
            count += 1;
        }
        apart[..count].sort_unstable_by(f64::total_cmp);
        let Some(&median) = apart[..count].get(count / 2) else {
            return;
        };
        let drift = pull(&known);
        let load = self.ahead.mean.abs() + self.aside.mean.abs();
        let own = own(&known, load);
        for (wheel, beside) in wheels.iter().enumerate() {
            let Some(beside) = beside else { continue };
            let (shift, uncertain) = self.shift(wheel, beside.sin_steer);
            let rest = beside.apart_a - shift;
            let spread = beside.variance + uncertain;
            if (rest - median).powi(2) > FAR_SD * FAR_SD * spread {
                continue;
            }
            // One state after the other: each wheel is a measurement of the sum of all three.
            let sin = beside.sin_steer;
            let (ahead, aside) = (self.ahead, self.aside);
            let offset = self.offsets[wheel];
            let noise = spread - offset.variance + ahead.variance;
            let of_offset = rest + offset.mean;
            self.offsets[wheel].learn(of_offset, 1.0, noise, &own);
            self.ahead.learn(rest + ahead.mean, 1.0, spread, &drift);
            let noise = spread - aside.variance * sin * sin + ahead.variance;
            self.aside
                .learn(rest + sin * aside.mean, sin, noise, &drift);
        }
    }
}

/// What slopes may add.
const fn pull(tolerance: &FurtherTolerance) -> Drift {
    Drift {
        tolerance: tolerance.current_a,
        length_m: SLOPE_LENGTH_M,
    }
}

/// What a wheel may differ by while the slopes add `load_a`.
fn own(tolerance: &FurtherTolerance, load_a: f64) -> Drift {
    Drift {
        tolerance: tolerance.current_wheel_a + tolerance.current_share * load_a,
        length_m: SLOPE_LENGTH_M,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: FurtherTolerance = FurtherTolerance {
        yaw_rate_rad_s: 0.01,
        current_a: 0.3,
        current_wheel_a: 0.006,
        current_share: 0.15,
    };

    fn read(apart: [f64; 6], sin: [f64; 6]) -> [Option<CurrentBeside>; WHEELS] {
        std::array::from_fn(|wheel| {
            apart.get(wheel).map(|&apart_a| CurrentBeside {
                apart_a,
                variance: 0.0025,
                sin_steer: sin[wheel],
            })
        })
    }

    #[test]
    fn slopes_are_context_and_a_wheel_without_torque_on_level_ground_is_none() {
        let sin = [0.4, 0.0, -0.4, 0.25, 0.0, -0.25];
        let mut context = CurrentContext::new(Some(TOLERANCE));
        for _ in 0..400 {
            context.fade(0.01);
            context.learn(&read(sin.map(|sin| 0.2 - 0.15 * sin), sin));
        }
        for (wheel, sin) in sin.into_iter().enumerate() {
            let (shift, _) = context.shift(wheel, sin);
            let expected = 0.2 - 0.15 * sin;
            assert!((shift - expected).abs() < 0.02, "{wheel}: {shift}");
        }
        let mut level = CurrentContext::new(Some(TOLERANCE));
        for _ in 0..4000 {
            level.fade(0.01);
            level.learn(&read([-0.1, 0.02, 0.02, 0.02, 0.02, 0.02], [0.0; 6]));
        }
        // A fifth of what it lost at most is taken for its own, or for a slope.
        assert!(level.shift(0, 0.0).0.abs() < 0.02);
        assert!(level.shift(1, 0.0).0.abs() < 0.02);
    }

    #[test]
    fn without_a_tolerance_nothing_is_learned() {
        let mut context = CurrentContext::new(None);
        context.learn(&read([0.2; 6], [0.0; 6]));
        context.fade(1.0);
        assert_eq!(context.shift(0, 0.3), (0.0, 0.0));
    }
}

//! How far a body may be behind the command.

use vigil_checkpoint::CheckpointValue;

/// Bounds of what the body is apart from the command.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Behind {
    /// Of its curvature, 1/m.
    pub curvature_1_m: f64,
    /// Of its speed, m/s.
    pub speed_m_s: f64,
    /// Of its yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
}

/// The bounds. Each change of the command adds its magnitude, which fades with the longest
/// time constant: of a body with a shorter one, whatever it is, less is left.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub(super) struct LagBounds {
    lag_s: f64,
    before: [f64; 3],
    /// At the end of the last observation.
    left: [f64; 3],
    /// At any time since the one before.
    behind: [f64; 3],
}

impl LagBounds {
    /// Of a body whose time constant is so long at most, s.
    pub fn new(lag_s: f64) -> Self {
        Self {
            lag_s,
            before: [0.0; 3],
            left: [0.0; 3],
            behind: [0.0; 3],
        }
    }

    /// A body whose past is not known may stand as yet.
    pub fn reset(&mut self) {
        *self = Self::new(self.lag_s);
    }

    /// Takes the mean command (curvature 1/m, speed m/s) of an observation, `dt_s` after the last.
    /// Between two observations the command goes from one to the other, at any time: neither the
    /// change nor what was left before it has faded for all of that.
    pub fn advance(&mut self, command: [f64; 2], dt_s: f64) {
        let [curvature, speed] = command;
        let now = [curvature, speed, curvature * speed];
        let before = std::mem::replace(&mut self.before, now);
        let stays = (-dt_s.max(0.0) / self.lag_s).exp();
        for (axis, (now, before)) in now.into_iter().zip(before).enumerate() {
            let change = (now - before).abs();
            self.behind[axis] = self.left[axis] + change;
            self.left[axis] = self.left[axis] * stays + change;
        }
    }

    /// The bounds between the last two observations.
    pub fn behind(&self) -> Behind {
        let [curvature_1_m, speed_m_s, yaw_rate_rad_s] = self.behind;
        Behind {
            curvature_1_m,
            speed_m_s,
            yaw_rate_rad_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::LagBounds;

    #[test]
    fn a_body_of_any_lag_up_to_the_longest_stays_within_the_bounds() {
        const FINE: u32 = 100;
        for lag_s in [0.01, 0.05, 0.1, 0.2] {
            // It stands as yet.
            let (mut lag, mut body) = (LagBounds::new(0.2), [0.0_f64; 3]);
            let mut before = [0.0; 3];
            let mut tight = 0;
            for step in 0..400_u32 {
                // Commands that jump, as a hash of the time says, at any time of the interval.
                let curvature = f64::from(step / 13 * 7919 % 10) / 10.0 - 0.4;
                let speed = 0.1 + 0.2 * f64::from(step / 17 % 3);
                let now = [curvature, speed, curvature * speed];
                lag.advance([curvature, speed], 0.05);
                let behind = lag.behind();
                let most = [
                    behind.curvature_1_m,
                    behind.speed_m_s,
                    behind.yaw_rate_rad_s,
                ];
                for fine in 0..FINE {
                    let command = if fine < step * 37 % FINE { before } else { now };
                    for (axis, body) in body.iter_mut().enumerate() {
                        let apart = (*body - now[axis]).abs();
                        assert!(apart <= most[axis] + 1e-9, "{lag_s} s, step {step}, {axis}");
                        tight += u32::from(apart > 0.9 * most[axis] && apart > 0.01);
                        *body += (1.0 - f64::exp(-0.05 / 100.0 / lag_s)) * (command[axis] - *body);
                    }
                }
                before = now;
            }
            // They are reached.
            assert!(tight > 10, "{tight}");
        }
    }
}

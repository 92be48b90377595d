//! The planned drive, and the rates at which a command may change.

use vigil_setup::graph_file::DriveSegment;

/// Fastest change of the executed curvature, 1/m per s. Chosen: the steering servos' limit.
pub const CURVATURE_RATE_MAX_1_M_S: f64 = 0.5;
/// Largest magnitude of acceleration, m/s². Chosen: the rover reaches its speed within a second.
pub const ACCELERATION_MAX_M_S2: f64 = 0.5;

/// Curvature (1/m, left positive) and speed (m/s) of the body's centre.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DriveCommand {
    /// Signed curvature, 1/m.
    pub curvature_1_m: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

/// Segments, repeated for ever. Without segments: standing still.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    segments: Vec<DriveSegment>,
    period_s: f64,
    elapsed_s: f64,
}

impl Drive {
    pub(crate) fn new(segments: &[DriveSegment]) -> Self {
        Self {
            segments: segments.to_vec(),
            period_s: segments.iter().map(|segment| segment.duration_s).sum(),
            elapsed_s: 0.0,
        }
    }

    /// The command of the present segment.
    pub(crate) fn command(&self) -> DriveCommand {
        let mut rest_s = self.elapsed_s;
        let present = self.segments.iter().find(|segment| {
            rest_s -= segment.duration_s;
            rest_s < 0.0
        });
        // Rounding may leave a rest at the very end of the last segment.
        present
            .or(self.segments.last())
            .map_or(DriveCommand::default(), |segment| DriveCommand {
                curvature_1_m: segment.curvature_1_m,
                speed_m_s: segment.speed_m_s,
            })
    }

    pub(crate) fn advance(&mut self, dt_s: f64) {
        if self.period_s > 0.0 {
            self.elapsed_s = (self.elapsed_s + dt_s) % self.period_s;
        }
    }
}

/// A command that follows its target at limited rates.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RateLimiter {
    /// The command at present.
    pub(crate) at: DriveCommand,
}

impl RateLimiter {
    pub(crate) fn follow(&mut self, target: DriveCommand, dt_s: f64) {
        let toward = |value: f64, target: f64, rate: f64| {
            let step = rate * dt_s;
            if (target - value).abs() <= step {
                target
            } else {
                value + step.copysign(target - value)
            }
        };
        let (curvature, speed) = (self.at.curvature_1_m, self.at.speed_m_s);
        self.at = DriveCommand {
            curvature_1_m: toward(curvature, target.curvature_1_m, CURVATURE_RATE_MAX_1_M_S),
            speed_m_s: toward(speed, target.speed_m_s, ACCELERATION_MAX_M_S2),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(duration_s: f64, curvature_1_m: f64, speed_m_s: f64) -> DriveSegment {
        DriveSegment {
            duration_s,
            curvature_1_m,
            speed_m_s,
        }
    }

    #[test]
    fn segments_follow_each_other_and_begin_again() {
        let mut drive = Drive::new(&[segment(2.0, 0.5, 0.2), segment(1.0, -0.5, 0.1)]);
        let mut seen = Vec::new();
        for _ in 0..8 {
            seen.push(drive.command().curvature_1_m);
            drive.advance(0.75);
        }
        // At 0, .75, 1.5, 2.25, 0 (3.0), .75, ...
        assert_eq!(seen, [0.5, 0.5, 0.5, -0.5, 0.5, 0.5, 0.5, -0.5]);
    }

    #[test]
    fn an_empty_drive_stands_still() {
        let mut drive = Drive::new(&[]);
        drive.advance(1.0);
        assert_eq!(drive.command(), DriveCommand::default());
    }

    #[test]
    fn a_limited_command_reaches_its_target_exactly_and_no_faster_than_allowed() {
        let mut limiter = RateLimiter::default();
        let target = DriveCommand {
            curvature_1_m: -0.4,
            speed_m_s: 0.2,
        };
        for tick in 1..=100 {
            limiter.follow(target, 0.01);
            let t = f64::from(tick) * 0.01;
            let curvature = (-0.5 * t).max(-0.4);
            let speed = (0.5 * t).min(0.2);
            assert!((limiter.at.curvature_1_m - curvature).abs() < 1e-9);
            assert!((limiter.at.speed_m_s - speed).abs() < 1e-9);
        }
        assert_eq!(limiter.at, target);
    }
}

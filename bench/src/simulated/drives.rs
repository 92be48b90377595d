//! What the simulated rover drives, and frames from it.

use vigil_blocks::SensorFrame;
use vigil_robot::injection::Change;
use vigil_sensor_sim::{EffectiveCommand, World, WorldError};
use vigil_setup::schema::{DriveSegment, Simulator};

use super::Rover;

/// One curvature and speed for ever.
#[must_use]
pub fn constant(curvature_1_m: f64, speed_m_s: f64) -> Vec<DriveSegment> {
    vec![segment(1e6, curvature_1_m, speed_m_s)]
}

/// The curvature changes by ±0.3 /m every second, for faults that a steady drive does not show.
#[must_use]
pub fn weaving(curvature_1_m: f64, speed_m_s: f64) -> Vec<DriveSegment> {
    let either = |by: f64| segment(1.0, curvature_1_m + by, speed_m_s);
    vec![either(0.3), either(-0.3)]
}

const fn segment(duration_s: f64, curvature_1_m: f64, speed_m_s: f64) -> DriveSegment {
    DriveSegment {
        duration_s,
        curvature_1_m,
        speed_m_s,
    }
}

/// In which world and how a run is driven.
#[derive(Debug, Clone)]
pub struct Conditions {
    /// Soil, noise, lag.
    pub simulator: Simulator,
    /// The drive.
    pub drive: Vec<DriveSegment>,
    /// Frames per second.
    pub rate_hz: f64,
    /// Seed of the world.
    pub seed: u64,
}

impl Conditions {
    /// Drives for `duration_s`, giving each frame with its time to `take`; each of
    /// `changes`, in the order of their times, s, happens then. Times count from the first frame.
    ///
    /// # Errors
    /// [`WorldError`] if a setting or the change is impossible.
    pub fn drive(
        &self,
        rover: &Rover,
        duration_s: f64,
        changes: &[(Change, f64)],
        mut take: impl FnMut(f64, &SensorFrame),
    ) -> Result<World, WorldError> {
        let (rate_hz, seed) = (self.rate_hz, self.seed);
        let mut world = World::new(&rover.robot, &self.simulator, &self.drive, rate_hz, seed)?;
        let mut pending = changes.iter().peekable();
        let mut frame = SensorFrame::default();
        let frames = (duration_s * rate_hz).round() as u64;
        let period_ns = (1e9 / rate_hz).round() as u64;
        for k in 0..frames {
            let t_s = k as f64 / rate_hz;
            while let Some((change, _)) = pending.next_if(|(_, at_s)| *at_s <= t_s) {
                world.change(*change)?;
            }
            let command = EffectiveCommand::as_planned(world.planned());
            world.step(1.0 / rate_hz, command);
            world.measure(&mut frame);
            frame.header.t_capture_ns = (k + 1) * period_ns;
            frame.header.seq = k;
            take(t_s, &frame);
        }
        Ok(world)
    }
}

//! A detection made by hand: an alarm between two instants, and a healthy robot at the pose.

use vigil_blocks::{
    DetectionBelief, HealthyBelief, ParticleBlock, SensorFrame, WeightedHypothesis,
};

/// Detections for frames of a run: an alarm stands from `from_s` to `to_s`.
pub struct Alarm {
    pub from_s: f64,
    pub to_s: f64,
    pub belief: DetectionBelief,
    pub hypotheses: Box<ParticleBlock>,
}

impl Alarm {
    pub fn between(from_s: f64, to_s: f64) -> Self {
        let belief = DetectionBelief {
            noise_scale: [1.0; 3],
            noise_scale_wheels: [1.0; 8],
            noise_scale_steer: [1.0; 8],
            ..DetectionBelief::default()
        };
        Self {
            from_s,
            to_s,
            belief,
            hypotheses: Box::default(),
        }
    }

    /// Sets belief and hypotheses for a frame, whose first channels are the pose.
    pub fn set(&mut self, frame: &SensorFrame) {
        let pose = [frame.channel[0], frame.channel[1], frame.channel[2]];
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        let alarm = (self.from_s..self.to_s).contains(&t_s);
        self.belief.alarm = u32::from(alarm);
        self.belief.alarm_t_capture_ns = if alarm { (self.from_s * 1e9) as u64 } else { 0 };
        self.belief.p_fault = if alarm { 0.999 } else { 1e-6 };
        // On the ground learned on, and known well.
        self.hypotheses.healthy = HealthyBelief {
            pose,
            pose_covariance: [2.5e-5, 0.0, 0.0, 2.5e-5, 0.0, 2.5e-5],
            deviation_covariance: [1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6],
            wheel_ratio: [0.0, 1e-6],
            wheel_offset_variance: [1e-6; 8],
            ..HealthyBelief::default()
        };
        self.hypotheses.count = 1;
        self.hypotheses.hypotheses[0] = WeightedHypothesis {
            pose,
            ..WeightedHypothesis::default()
        };
    }
}

//! A rover that drives with one command, of which wheels stick and encoders die.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_diagnosis::identify::LeafMap;
use vigil_robot::slip::{Condition, Situation, SlipModel, Soil};
use vigil_robot::{ChannelMap, Description};

pub const WHEELS: usize = 6;
pub const ONSET_S: f64 = 2.0;
/// The body has followed the change.
pub const SETTLED_S: f64 = ONSET_S + 0.6;
const RATE_HZ: f64 = 20.0;
const LAG_S: f64 = 0.1;
const POSE_SD: f64 = 0.005;
const RATE_SD: f64 = 0.05;
const STEER_SD: f64 = 0.003;

/// The wheels that stick and the one whose encoder dies, as bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faults {
    pub stuck: u32,
    pub dead: u32,
}

impl Faults {
    /// The nodes of these faults, as bits.
    pub fn nodes(self, leaves: &LeafMap) -> u64 {
        let bits = |set: u32, nodes: &[Option<usize>]| -> u64 {
            let inside = (0..WHEELS).filter(|wheel| set >> wheel & 1 == 1);
            inside.map(|wheel| 1 << nodes[wheel].unwrap()).sum()
        };
        bits(self.stuck, &leaves.stuck) | bits(self.dead, &leaves.encoder)
    }
}

/// Frames of a drive at 20 Hz with one command, and the true pose at [`SETTLED_S`].
pub fn drive(
    robot: &Description,
    slip: &SlipModel,
    faults: Faults,
    (seed, end_s): (u64, f64),
) -> (Vec<SensorFrame>, [f64; 3]) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (curvature, speed) = (rng.random_range(-0.9..0.9), rng.random_range(0.12..0.28));
    let targets = slip.kinematics().targets(curvature, speed);
    let motion = |set: u32| {
        let situation = Situation {
            curvature_1_m: curvature,
            speed_m_s: speed,
            stuck: std::array::from_fn(|wheel| set >> wheel & 1 == 1),
            soil: Soil::uniform(0.63, 0.21),
            condition: Condition::default(),
        };
        slip.solve(&situation, None).unwrap()
    };
    let motions = [motion(0), motion(faults.stuck)];
    let mut velocity = motions[0].velocity;
    let (mut pose, mut settled) = ([0.0_f64; 3], [0.0; 3]);
    let mut noise = |sd: f64| -> f64 {
        let drawn: f64 = StandardNormal.sample(&mut rng);
        sd * drawn
    };
    let map = ChannelMap::new(robot);
    let frame = |k: usize| {
        let t_s = k as f64 / RATE_HZ;
        let faulty = t_s >= ONSET_S;
        let now = &motions[usize::from(faulty)];
        let keep = (-1.0 / (RATE_HZ * LAG_S)).exp();
        for (velocity, target) in velocity.iter_mut().zip(now.velocity) {
            *velocity = target + (*velocity - target) * keep;
        }
        let [forward, lateral, yaw] = velocity.map(|v| v / RATE_HZ);
        let (sin, cos) = (pose[2] + 0.5 * yaw).sin_cos();
        pose[0] += forward * cos - lateral * sin;
        pose[1] += forward * sin + lateral * cos;
        pose[2] += yaw;
        if t_s < SETTLED_S {
            settled = pose;
        }
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (k as u64 + 1) * 50_000_000;
        frame.run_id = 1;
        frame.set_command(0, curvature);
        frame.set_command(1, speed);
        map.set_pose(&mut frame, pose.map(|value| value + noise(POSE_SD)));
        for wheel in 0..WHEELS {
            let silent = faulty && faults.dead >> wheel & 1 == 1;
            let read = now.wheel_rate_rad_s[wheel] + noise(RATE_SD);
            map.set_wheel_rate(&mut frame, wheel, if silent { 0.0 } else { read });
            let angle_rad = targets.steer_rad[wheel] + noise(STEER_SD);
            map.set_steer(&mut frame, wheel, angle_rad);
        }
        frame
    };
    let frames = (0..(end_s * RATE_HZ) as usize).map(frame).collect();
    (frames, settled)
}

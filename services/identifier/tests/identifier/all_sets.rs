//! The identifier's filter against an oracle that leaves nothing out: it is told when the faults
//! appeared, and weighs every set of stuck wheels with every set of broken encoders.

use std::path::PathBuf;

use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{SensorFrame, Valid};
use vigil_identifier::{Exact, Leaves, Posterior};
use vigil_inference::track::Track;
use vigil_robot::Description;
use vigil_robot::learned::wheel_evidence::{BREAKAGE_SHARES, BREAKAGES};
use vigil_robot::learned::{
    FaultRates, Healthy, Model, MotionMode, Moved, NoiseScales, Observation, Observer,
    WheelContext, WheelEvidence, motion_modes,
};
use vigil_robot::slip::{Condition, Situation, SlipModel, Soil};
use vigil_setup::schema::Sensors;

const WHEELS: usize = 6;
const SETS: usize = 1 << WHEELS;
const RATE_HZ: f64 = 20.0;
const ONSET_S: f64 = 2.0;
const END_S: f64 = 6.0;
/// The oracle begins when the body has followed the change, with the pose that is true then.
const SETTLED_S: f64 = ONSET_S + 0.6;
const LAG_S: f64 = 0.1;
const POSE_SD: f64 = 0.005;
const RATE_SD: f64 = 0.05;
const STEER_SD: f64 = 0.003;
/// Prior of several stuck wheels beside that of one, and of each broken encoder.
const P_AT_ONCE: f64 = 0.1;
const P_ENCODER: f64 = 1e-4;

/// The wheels that stick and the one whose encoder dies, as bits.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Faults {
    stuck: u32,
    dead: u32,
}

/// A file of the project.
fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(name)
}

struct Rig {
    robot: Description,
    model: Model,
    leaves: Leaves,
    slip: SlipModel,
    modes: Vec<MotionMode>,
}

impl Rig {
    fn new() -> Self {
        // The oracle knows one ground.
        let robot = Description {
            tolerance: None,
            ..vigil_setup::load_robot(&path("config/robots/rover.toml")).unwrap()
        };
        let model = std::fs::read_to_string(path("config/models/rover.toml")).unwrap();
        let model = Model::from_toml(&model).unwrap();
        let tree = vigil_setup::load_tree(&path("config/trees/rover.toml")).unwrap();
        let modes = motion_modes(&model, &robot, SETS as u32 - 1, false, true);
        Self {
            leaves: Leaves::new(&tree, &model, &robot, Sensors::PoseEncoders).unwrap(),
            slip: SlipModel::new(&robot).unwrap(),
            modes: (0..SETS as u32)
                .map(|set| {
                    let moved = match set {
                        0 => Moved::Nominal,
                        set => Moved::Stuck(set),
                    };
                    modes
                        .iter()
                        .find(|mode| mode.moved == moved)
                        .unwrap()
                        .clone()
                })
                .collect(),
            robot,
            model,
        }
    }

    /// Frames of a drive, and the true pose at [`SETTLED_S`].
    fn drive(&self, faults: Faults, seed: u64) -> (Vec<SensorFrame>, [f64; 3]) {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (curvature, speed) = (rng.random_range(-0.9..0.9), rng.random_range(0.12..0.28));
        let targets = self.slip.kinematics().targets(curvature, speed);
        let motion = |set: u32| {
            let situation = Situation {
                curvature_1_m: curvature,
                speed_m_s: speed,
                stuck: std::array::from_fn(|wheel| set >> wheel & 1 == 1),
                soil: Soil::uniform(0.63, 0.21),
                condition: Condition::default(),
            };
            self.slip.solve(&situation, None).unwrap()
        };
        let motions = [motion(0), motion(faults.stuck)];
        let mut velocity = motions[0].velocity;
        let (mut pose, mut settled) = ([0.0_f64; 3], [0.0; 3]);
        let mut noise = |sd: f64| -> f64 {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            sd * drawn
        };
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
            frame.valid = Valid::POSE | Valid::command(0) | Valid::command(1);
            (frame.command[0], frame.command[1]) = (curvature, speed);
            frame.pose = pose.map(|value| value + noise(POSE_SD));
            for wheel in 0..WHEELS {
                let silent = faulty && faults.dead >> wheel & 1 == 1;
                let read = now.wheel_rate_rad_s[wheel] + noise(RATE_SD);
                frame.wheel_rate[wheel] = if silent { 0.0 } else { read };
                frame.steer[wheel] = targets.steer_rad[wheel] + noise(STEER_SD);
                frame.valid |= Valid::wheel_rate(wheel);
                if self.robot.wheels[wheel].steered {
                    frame.valid |= Valid::steer(wheel);
                }
            }
            frame
        };
        let frames = (0..(END_S * RATE_HZ) as usize).map(frame).collect();
        (frames, settled)
    }

    fn observations(&self, frames: &[SensorFrame]) -> Vec<Observation> {
        let mut observer = Observer::new(&self.model, &self.robot);
        let observed = frames.iter().filter_map(|frame| {
            let complete = observer.push(frame).complete;
            complete.then(|| *observer.observation())
        });
        observed.collect()
    }

    /// The set that the filter holds most probable.
    fn filtered(&self, observations: &[Observation]) -> u64 {
        let rates = FaultRates {
            fault_1_s: 8e-4,
            unknown_1_s: 5e-4,
            further: 1.0,
            death_1_s: 1.0 / 60.0,
        };
        let mut filter = Exact::new(&self.model, &self.robot, &self.leaves, true, rates);
        let (first, rest) = observations.split_first().unwrap();
        let start = Healthy {
            pose: first.pose.into(),
            ..Healthy::unsure(&self.model, &self.robot)
        };
        filter.restart(&start, first.t_ns);
        let mut posterior = Posterior::nominal();
        for observation in rest {
            filter.step(observation, NoiseScales::default());
        }
        filter.posterior(None, &mut posterior);
        posterior.sets[0].leaves
    }

    /// The best of all sets, and its probability.
    fn best_of_all(&self, observations: &[Observation], settled: [f64; 3]) -> (u64, f64) {
        let is_late = |observation: &&Observation| observation.t_ns as f64 * 1e-9 > SETTLED_S;
        let late: Vec<&Observation> = observations.iter().filter(is_late).collect();
        let (mut best, mut sum) = ((0, f64::NEG_INFINITY), Vec::new());
        for (set, mode) in self.modes.iter().enumerate() {
            let (motion, wheels) = self.heard(mode, &late, settled);
            let prior = if set.count_ones() > 1 { P_AT_ONCE } else { 1.0 };
            for encoders in 0..SETS {
                let readings = wheels.iter().enumerate();
                let log_p: f64 = readings
                    .map(|(wheel, [whole, broken])| match encoders >> wheel & 1 {
                        0 => *whole,
                        _ => P_ENCODER.ln() + broken,
                    })
                    .sum();
                let log_p = log_p + motion + prior.ln();
                sum.push(log_p);
                if log_p > best.1 {
                    best = (self.nodes(set, encoders), log_p);
                }
            }
        }
        let total: f64 = sum.iter().map(|log_p| (log_p - best.1).exp()).sum();
        (best.0, 1.0 / total)
    }

    /// Log-likelihoods of the motion, and of each wheel's readings by a whole and a broken encoder.
    fn heard(
        &self,
        mode: &MotionMode,
        observations: &[&Observation],
        settled: [f64; 3],
    ) -> (f64, [[f64; 2]; WHEELS]) {
        let scales = NoiseScales::default();
        let spread = Matrix3::identity() * 1e-6;
        let mut track = Track::new(Vector3::from(settled), spread, &mode.noise);
        let (mut motion, mut whole) = (0.0, [0.0; WHEELS]);
        let mut broken = [[0.0; BREAKAGES.len()]; WHEELS];
        for observation in observations {
            track.predict(
                &observation.displacement(&self.model, &mode.motion),
                &mode.noise,
            );
            let variance = observation.pose_variance(&self.model, scales.pose);
            motion += track.update(observation.pose, variance).unwrap();
            let (model, robot) = (&self.model, &self.robot);
            let ground = WheelContext::default();
            let evidence = WheelEvidence::new(model, robot, observation, scales, &ground);
            for wheel in 0..WHEELS {
                whole[wheel] += evidence.whole(&self.model, observation, mode, false, wheel);
                for (sum, log_p) in broken[wheel].iter_mut().zip(evidence.broken[wheel]) {
                    *sum += log_p;
                }
            }
        }
        let any = |sums: [f64; BREAKAGES.len()]| {
            let largest = sums.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let parts = sums.iter().zip(BREAKAGE_SHARES);
            largest
                + parts
                    .map(|(sum, share)| share * (sum - largest).exp())
                    .sum::<f64>()
                    .ln()
        };
        (
            motion,
            std::array::from_fn(|wheel| [whole[wheel], any(broken[wheel])]),
        )
    }

    fn nodes(&self, stuck: usize, encoders: usize) -> u64 {
        let bits = |set: usize, nodes: &[Option<usize>]| -> u64 {
            let inside = nodes
                .iter()
                .enumerate()
                .filter(|(wheel, _)| set >> wheel & 1 == 1);
            inside.map(|(_, node)| 1 << node.unwrap()).sum()
        };
        bits(stuck, &self.leaves.stuck) | bits(encoders, &self.leaves.encoder)
    }
}

#[test]
fn the_filter_finds_what_the_best_of_all_sets_is() {
    let rig = Rig::new();
    let stuck = (1..SETS as u32).map(|stuck| Faults { stuck, dead: 0 });
    // One or two stuck wheels and the encoder of another wheel, exactly zero.
    let with_encoder = (1..SETS as u32).filter(|stuck| stuck.count_ones() < 3);
    let with_encoder = with_encoder.map(|stuck| Faults {
        stuck,
        dead: 1 << (!stuck).trailing_zeros(),
    });
    let (mut sure, mut wrong) = (0, Vec::new());
    for (seed, faults) in stuck.chain(with_encoder).enumerate() {
        let (frames, settled) = rig.drive(faults, 900 + seed as u64);
        let observations = rig.observations(&frames);
        let (best, p) = rig.best_of_all(&observations, settled);
        if p < 0.9 {
            continue;
        }
        sure += 1;
        let found = rig.filtered(&observations);
        if found != best {
            wrong.push(format!(
                "{faults:?}: {found:#b}, best of all {best:#b} ({p:.3})"
            ));
        }
        assert_eq!(
            best,
            rig.nodes(faults.stuck as usize, faults.dead as usize),
            "{faults:?}"
        );
    }
    assert!(sure >= 75, "{sure}");
    assert!(wrong.len() <= 1, "{}", wrong.join("\n"));
}

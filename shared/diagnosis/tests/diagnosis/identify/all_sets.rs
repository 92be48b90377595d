//! The identifier's filter against an oracle that leaves nothing out: it is told when the faults
//! appeared, and weighs every set of stuck wheels with every set of broken encoders.

use nalgebra::{Matrix3, Vector3};
use vigil_blocks::SensorFrame;
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify::{LeafMap, MultipleHypothesis, TreeBelief};
use vigil_inference::track::Track;
use vigil_robot::Description;
use vigil_robot::learned::wheel_evidence::{BREAKAGE_SHARES, BREAKAGES};
use vigil_robot::learned::{
    FaultRates, Healthy, Model, MotionMode, Mover, NoiseScales, Observation, Observer,
    WheelContext, WheelEvidence, motion_modes,
};
use vigil_robot::slip::SlipModel;

use super::driven::{Faults, SETTLED_S, WHEELS, drive};
use crate::recorded::path;

const SETS: usize = 1 << WHEELS;
const END_S: f64 = 6.0;
/// Prior of several stuck wheels beside that of one, and of each broken encoder.
const P_AT_ONCE: f64 = 0.1;
const P_ENCODER: f64 = 1e-4;

struct Rig {
    robot: Description,
    model: Model,
    leaves: LeafMap,
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
            leaves: LeafMap::new(&tree, &model, &robot, Sensors::PoseEncoders).unwrap(),
            slip: SlipModel::new(&robot).unwrap(),
            modes: (0..SETS as u32)
                .map(|set| {
                    let moved = match set {
                        0 => Mover::Nominal,
                        set => Mover::Stuck(set),
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
        let mut filter =
            MultipleHypothesis::new(&self.model, &self.robot, &self.leaves, true, rates);
        let (first, rest) = observations.split_first().unwrap();
        let start = Healthy {
            pose: first.pose.into(),
            ..Healthy::unsure(&self.model, &self.robot)
        };
        filter.restart(&start, first.t_ns);
        let mut posterior = TreeBelief::nominal();
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
                    let faults = Faults {
                        stuck: set as u32,
                        dead: encoders as u32,
                    };
                    best = (faults.nodes(&self.leaves), log_p);
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
        let (frames, settled) = drive(&rig.robot, &rig.slip, faults, (900 + seed as u64, END_S));
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
        assert_eq!(best, faults.nodes(&rig.leaves), "{faults:?}");
    }
    assert!(sure >= 75, "{sure}");
    assert!(wrong.len() <= 1, "{}", wrong.join("\n"));
}

//! No input breaks a guarantee: hostile frames, blocks and journals, under every assertion of both
//! steps.

use std::sync::LazyLock;

use clap::ValueEnum;
use proptest::prelude::*;
use vigil_blocks::{DetectionBelief, Entry, FaultBelief, ParticleBlock, SensorFrame};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect::{self, Detector, Form, MonitorSettings};
use vigil_diagnosis::identify::{
    self, ChannelIdentifier, Diagnoser, Identifier, IdentifierFilter, Input, Models,
};
use vigil_robot::RobotModel;
use vigil_robot::channel_model::tree;

use crate::recorded::{path, runs};

/// A robot of the configuration, its model and its tree.
struct Robot {
    model: RobotModel,
    robot: vigil_robot::Description,
    tree: vigil_robot::FaultTree,
}

impl Robot {
    fn load(name: &str, tree: &str) -> Self {
        let robot = vigil_setup::load_robot(&path(&format!("config/robots/{name}.toml"))).unwrap();
        let model = path(&format!("config/models/{name}.toml"));
        Self {
            model: vigil_setup::load_model(&model, Some(&robot)).unwrap(),
            tree: match tree {
                "generated" => tree::tree(&robot).unwrap(),
                tree => {
                    vigil_setup::load_tree(&path(&format!("config/trees/{tree}.toml"))).unwrap()
                }
            },
            robot,
        }
    }

    fn detector(&self, sensors: Sensors, form: Form) -> Detector {
        let settings = detect::Settings {
            sensors,
            form,
            // Each form reaches the threshold of this interval.
            false_alarm_interval_h: 1.0,
            ..detect::Settings::default()
        };
        let detector = match &self.model {
            RobotModel::Faults(model) => Detector::new(model, &self.robot, &settings),
            RobotModel::Channels(model) => Detector::of_channels(model, &self.robot, &settings),
        };
        let detector = detector.unwrap().in_graph(&self.robot, 0.02, true);
        detector.with_monitors(Some(&MonitorSettings::default()))
    }

    fn identifier(&self, filter: IdentifierFilter, sensors: Sensors) -> Diagnoser {
        let model = match &self.model {
            RobotModel::Faults(model) => model,
            RobotModel::Channels(model) => {
                let settings = (sensors, 1.0);
                let identifier = ChannelIdentifier::new(model, &self.robot, &self.tree, settings);
                return Diagnoser::from(identifier.unwrap());
            }
        };
        let decision = vigil_setup::load_decision(&path("config/rover.pomdp")).unwrap();
        let risks = vigil_setup::state_risks(&decision).unwrap();
        let models = Models {
            model,
            robot: &self.robot,
            tree: &self.tree,
            risks: Some(&risks),
        };
        let settings = identify::Settings {
            filter,
            ..identify::Settings::default()
        };
        Diagnoser::from(Identifier::new(&models, &settings, sensors, 1).unwrap())
    }
}

/// A number as a broken sensor or a strange writer may give it.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -3.0..3.0_f64,
        1 => any::<f64>(),
        1 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e308, 1e308, 0.0, -0.0, 5e-324,
        ]),
    ]
}

/// What is wrong with a frame.
#[derive(Debug, Clone)]
enum Spoiling {
    /// Nothing.
    Sound,
    /// Any numbers in every channel.
    Numbers(Vec<f64>),
    /// Any channels are missing.
    Validity(u64),
    /// It was captured at any time.
    Time(u64),
    /// It was captured this much before the frame that it follows, ns.
    Back(u64),
    /// It is of another run.
    Run(u64),
    /// Its pose starts anew.
    PoseReset(u32),
}

impl Spoiling {
    fn apply(&self, frame: &mut SensorFrame) {
        match self {
            Self::Sound => {}
            Self::Numbers(v) => {
                frame.command.copy_from_slice(&v[..8]);
                frame.planned_pose.copy_from_slice(&v[8..11]);
                frame.channel = std::array::from_fn(|i| v[i % v.len()]);
                frame.channel_valid = u64::MAX;
                (frame.command_valid, frame.planned_pose_valid) = (u32::MAX, 1);
            }
            Self::Validity(valid) => {
                frame.channel_valid = *valid;
                frame.command_valid = (*valid >> 48) as u32;
            }
            Self::Time(t_ns) => frame.header.t_capture_ns = *t_ns,
            Self::Back(by_ns) => {
                let t_ns = &mut frame.header.t_capture_ns;
                *t_ns = t_ns.saturating_sub(*by_ns);
            }
            Self::Run(run_id) => frame.run_id = *run_id,
            Self::PoseReset(count) => frame.pose_reset_count = *count,
        }
    }
}

fn spoiling() -> impl Strategy<Value = Spoiling> {
    prop_oneof![
        12 => Just(Spoiling::Sound),
        3 => prop::collection::vec(number(), 35).prop_map(Spoiling::Numbers),
        1 => any::<u64>().prop_map(Spoiling::Validity),
        1 => any::<u64>().prop_map(Spoiling::Time),
        1 => (0..3_000_000_000_u64).prop_map(Spoiling::Back),
        1 => (0..3_u64).prop_map(Spoiling::Run),
        1 => (0..3_u32).prop_map(Spoiling::PoseReset),
    ]
}

/// An entry of a journal.
#[derive(Debug, Clone)]
enum Turn {
    Frame(Spoiling),
    Missed(u32),
    Budget(u32),
    Reset,
}

fn turn() -> impl Strategy<Value = Turn> {
    prop_oneof![
        20 => spoiling().prop_map(Turn::Frame),
        2 => prop_oneof![1..4_u32, any::<u32>()].prop_map(Turn::Missed),
        1 => prop_oneof![0..40_u32, any::<u32>()].prop_map(Turn::Budget),
        1 => Just(Turn::Reset),
    ]
}

/// What a strange detector makes of its blocks.
#[derive(Debug, Clone)]
enum Forgery {
    /// The detector's own words.
    Sound,
    /// No detection comes with the frame.
    Lost,
    /// An alarm, of this age and probability.
    Alarm(u64, f64),
    /// Any numbers in all of it.
    Numbers(Vec<f64>, u32),
}

impl Forgery {
    fn apply(&self, belief: &mut DetectionBelief, block: &mut ParticleBlock) {
        match self {
            Self::Sound | Self::Lost => {}
            Self::Alarm(t_ns, p_fault) => {
                (belief.alarm, belief.alarm_t_capture_ns) = (1, *t_ns);
                belief.p_fault = *p_fault;
            }
            Self::Numbers(v, word) => {
                (belief.alarm, belief.blind, block.count) = (word % 2, word % 9, *word);
                belief.p_fault = v[0];
                belief.log_odds = v[1];
                belief.noise_scale = [v[2]; 3];
                belief.noise_scale_wheels.fill(v[3]);
                belief.noise_scale_steer.fill(v[4]);
                belief.outlier_rate = [v[5]; 3];
                belief.outlier_rate_wheels.fill(v[6]);
                belief.channel_log_odds.fill(v[7]);
                let healthy = &mut block.healthy;
                healthy.pose.copy_from_slice(&v[8..11]);
                healthy.pose_covariance.copy_from_slice(&v[11..17]);
                healthy.deviation.copy_from_slice(&v[17..20]);
                healthy.deviation_covariance.copy_from_slice(&v[20..26]);
                healthy.direction = v[26].signum();
                healthy.wheel_ratio.copy_from_slice(&v[27..29]);
                healthy.wheel_offset.fill(v[29]);
                healthy.wheel_offset_variance.fill(v[30].abs());
                block.hypotheses[0].log_weight = v[31];
                block.hypotheses[1].pose[0] = v[32];
            }
        }
    }
}

fn forgery() -> impl Strategy<Value = Forgery> {
    let numbers = (prop::collection::vec(number(), 33), any::<u32>());
    prop_oneof![
        3 => Just(Forgery::Sound),
        1 => Just(Forgery::Lost),
        3 => (any::<u64>(), number()).prop_map(|(t_ns, p)| Forgery::Alarm(t_ns, p)),
        1 => numbers.prop_map(|(numbers, word)| Forgery::Numbers(numbers, word)),
    ]
}

/// Both stages, on recorded frames that are spoilt on their way.
struct Chain {
    detector: Detector,
    identifier: Diagnoser,
    detection: DetectionBelief,
    detected: Box<ParticleBlock>,
    belief: FaultBelief,
    hypotheses: Box<ParticleBlock>,
}

impl Chain {
    fn new(robot: &Robot, filter: IdentifierFilter, sensors: Sensors, form: Form) -> Self {
        Self {
            detector: robot.detector(sensors, form),
            identifier: robot.identifier(filter, sensors),
            detection: DetectionBelief::default(),
            detected: Box::default(),
            belief: FaultBelief::default(),
            hypotheses: Box::default(),
        }
    }

    fn turn(&mut self, frame: &SensorFrame, turn: &Turn, forgery: &Forgery) {
        let (belief, out) = (&mut self.belief, &mut self.hypotheses);
        let entry = match turn {
            Turn::Frame(_) => Entry::Frame(frame),
            Turn::Missed(count) => Entry::Missed(*count),
            Turn::Budget(count) => Entry::Budget(*count),
            Turn::Reset => Entry::Reset,
        };
        self.detector
            .step(entry, &mut self.detection, &mut self.detected);
        let (mut detection, mut detected) = (self.detection, self.detected.clone());
        forgery.apply(&mut detection, &mut detected);
        let is_lost = matches!(forgery, Forgery::Lost);
        let entry = match entry {
            Entry::Frame(frame) => Entry::Frame(Input {
                frame,
                detection: (!is_lost).then_some((&detection, &*detected)),
            }),
            Entry::Missed(count) => Entry::Missed(count),
            Entry::Budget(count) => Entry::Budget(count),
            Entry::Reset => Entry::Reset,
        };
        self.identifier.step(entry, belief, out);
    }

    /// What the blocks of both stages must hold for whoever reads them.
    fn check(&self) {
        let values = [self.detection.evidence, self.belief.entropy];
        let all = values.iter().chain(&self.detection.noise_scale);
        let mut all = all.chain(&self.belief.channel_evidence);
        assert!(all.all(|value| value.is_finite()));
        for block in [&self.detected, &self.hypotheses] {
            for hypothesis in block.used() {
                assert!(hypothesis.pose.iter().all(|value| value.is_finite()));
                assert!(hypothesis.log_weight.is_finite());
            }
        }
    }
}

static ROVER: LazyLock<Robot> = LazyLock::new(|| Robot::load("rover", "rover"));
static ROVER_ALL: LazyLock<Robot> = LazyLock::new(|| Robot::load("rover", "rover-all"));
static KOBUKI: LazyLock<Robot> = LazyLock::new(|| Robot::load("kobuki", "generated"));
static RECORDED: LazyLock<Vec<SensorFrame>> = LazyLock::new(recorded);

/// A recorded run of the rover, in which a wheel sticks after a while.
fn recorded() -> Vec<SensorFrame> {
    let (runs, labels) = runs();
    let label = labels.iter().find(|label| label.mode == "RM_STUCK");
    let id = label.unwrap().run;
    let run = runs.iter().find(|run| run.id == id);
    run.unwrap().frames.clone()
}

fn run(chain: &mut Chain, frames: &[SensorFrame], turns: &[(Turn, Forgery)]) {
    let mut k = 0;
    for (turn, forgery) in turns {
        let mut frame = frames[k % frames.len()];
        if let Turn::Frame(spoiling) = turn {
            spoiling.apply(&mut frame);
            k += 1;
        }
        chain.turn(&frame, turn, forgery);
        chain.check();
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 100,
        failure_persistence: None,
        max_shrink_iters: 300,
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_input_breaks_a_guarantee_of_the_steps_with_faults(
        turns in prop::collection::vec((turn(), forgery()), 1..160),
        at in 0..100_usize,
        filter in prop::sample::select(IdentifierFilter::value_variants()),
        sensors in prop::sample::select(vec![Sensors::Pose, Sensors::PoseEncoders, Sensors::All]),
        form in prop::sample::select(vec![Form::LearnedBias, Form::EDetector]),
    ) {
        let robot = match filter {
            IdentifierFilter::MultipleHypothesis if sensors == Sensors::All => &ROVER_ALL,
            _ => &ROVER,
        };
        let mut chain = Chain::new(robot, filter, sensors, form);
        // Sound frames first, so that the filters have something to lose.
        let sound = vec![(Turn::Frame(Spoiling::Sound), Forgery::Sound); at];
        run(&mut chain, &RECORDED, &sound);
        run(&mut chain, &RECORDED[at..], &turns);
    }

    #[test]
    fn no_input_breaks_a_guarantee_of_the_steps_over_channels(
        turns in prop::collection::vec((turn(), forgery()), 1..200),
        form in prop::sample::select(vec![Form::LearnedBias]),
    ) {
        let (filter, sensors) = (IdentifierFilter::default(), Sensors::PoseEncoders);
        let mut chain = Chain::new(&KOBUKI, filter, sensors, form);
        let frames: Vec<SensorFrame> = (0..400).map(driving).collect();
        run(&mut chain, &frames, &turns);
    }
}

/// A frame of a small robot with two wheels that drives straight on, at 50 Hz.
fn driving(k: u64) -> SensorFrame {
    let mut frame = SensorFrame {
        run_id: 1,
        channel_valid: 0b11111,
        command_valid: 0b11,
        ..SensorFrame::default()
    };
    frame.header.t_capture_ns = (k + 1) * 20_000_000;
    frame.command[0] = 0.2;
    frame.channel[..2].fill(0.2 / 0.035);
    frame
}

//! The simulated rover and its watchers in one thread.
#![allow(dead_code)]

use std::path::PathBuf;

use vigil_blocks::{DetectionBelief, Entry, FaultBelief, ParticleBlock, SensorFrame};
use vigil_diagnosis::detect::Detector;
use vigil_diagnosis::identify::{Diagnoser, Input};
use vigil_robot::{Fault, FaultKind};
use vigil_sensor_sim::{EffectiveCommand, World};
use vigil_setup::{GraphArgs, Setup};

const RATE_HZ: f64 = 100.0;
const PERIOD_NS: u64 = 10_000_000;

fn setup() -> Setup {
    let config = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config/rover.toml");
    let args = GraphArgs {
        config,
        ..GraphArgs::default()
    };
    args.load().unwrap()
}

/// The rover and its watchers in one thread.
pub struct WatchedRover {
    pub setup: Setup,
    pub world: World,
    detector: Detector,
    identifier: Diagnoser,
    frame: SensorFrame,
    pub detection: Box<DetectionBelief>,
    pub diagnosis: Box<FaultBelief>,
    particles: [Box<ParticleBlock>; 2],
}

impl WatchedRover {
    pub fn new(seed: u64) -> Self {
        Self::with_noise(seed, 1.0)
    }

    pub fn with_noise(seed: u64, noise_scale: f64) -> Self {
        let mut setup = setup();
        setup.file.simulator.noise_scale = noise_scale;
        let file = &setup.file;
        let world = World::new(&setup.robot, &file.simulator, &file.drive, RATE_HZ, seed);
        Self {
            world: world.unwrap(),
            detector: vigil_detector::assemble(&setup).unwrap(),
            identifier: vigil_identifier::assemble(&setup).unwrap(),
            frame: SensorFrame::default(),
            detection: Box::default(),
            diagnosis: Box::default(),
            particles: [Box::default(), Box::default()],
            setup,
        }
    }

    pub fn step(&mut self) {
        self.step_with(|_| ());
    }

    /// Other processes take over from both watchers; the detector begins so many cycles before the
    /// identifier.
    pub fn replace_watchers(&mut self, lead: usize) {
        self.detector = vigil_detector::assemble(&self.setup).unwrap();
        for _ in 0..lead {
            self.detect(|_| ());
        }
        self.identifier = vigil_identifier::assemble(&self.setup).unwrap();
    }

    /// One cycle whose frame is changed before anyone takes it.
    pub fn step_with(&mut self, change: impl Fn(&mut SensorFrame)) {
        self.detect(change);
        let [detected, drawn] = &mut self.particles;
        let input = Input {
            frame: &self.frame,
            detection: Some((&*self.detection, &**detected)),
        };
        let entry = Entry::Frame(input);
        self.identifier.step(entry, &mut self.diagnosis, drawn);
    }

    fn detect(&mut self, change: impl Fn(&mut SensorFrame)) {
        let command = EffectiveCommand::as_planned(self.world.planned());
        self.world.step(1.0 / RATE_HZ, command);
        self.world.measure(&mut self.frame);
        self.frame.header.t_capture_ns += PERIOD_NS;
        change(&mut self.frame);
        let entry = Entry::Frame(&self.frame);
        let [detected, _] = &mut self.particles;
        self.detector.step(entry, &mut self.detection, detected);
    }

    pub fn drive(&mut self, seconds: f64) {
        self.drive_with(seconds, |_| ());
    }

    /// Drives with frames that are changed before anyone takes them.
    pub fn drive_with(&mut self, seconds: f64, change: impl Fn(&mut SensorFrame)) {
        for _ in 0..(seconds * RATE_HZ) as usize {
            self.step_with(&change);
        }
    }

    /// Sets the clock of the frames back.
    pub fn frame_time_back(&mut self, by_s: f64) {
        self.frame.header.t_capture_ns -= (by_s * 1e9) as u64;
    }

    pub fn leaf(&self, fault: Fault) -> usize {
        let wheel = &self.setup.robot.wheels[fault.wheel].name;
        let kind = match fault.kind {
            FaultKind::Stuck => "STUCK",
            _ => "ENC",
        };
        self.setup.tree.index(&format!("{wheel}_{kind}")).unwrap()
    }
}

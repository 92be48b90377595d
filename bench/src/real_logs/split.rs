//! Logs of real robots: a part to learn from, and a part to judge.

use std::error::Error;

use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{self, Log};
use vigil_recording::frames::Run;
use vigil_robot::channel_model::{Model, tree::tree};
use vigil_robot::{Description, RobotModel};
use vigil_setup::Setup;

use super::logs;
use crate::load;

/// Logs that are split.
pub const LOGS: [&str; 3] = ["kobuki", "robotino", "husky"];
/// Of the Robotino's 729 short runs one in so many is learned from.
const LEARNED_EVERY: u32 = 8;
/// And of those left, those with this remainder are judged.
const JUDGED: [u32; 2] = [7, 1];
/// Of the runs judged, one in so many gets faults.
const FAULTY_EVERY: usize = 10;

/// A robot with its log.
#[derive(Debug)]
pub struct Split {
    /// Graph of the robot, with the model of the part learned from.
    pub setup: Setup,
    /// The model.
    pub model: Model,
    /// Healthy runs that were not learned from.
    pub judged: Vec<Run>,
    /// Those into which faults are put.
    pub faulty: Vec<usize>,
}

impl Split {
    /// Reads the log of this name from `VIGIL_DATA`, and learns from a part of it.
    ///
    /// # Errors
    /// What is missing or malformed, and a log that supports no model.
    pub fn new(log: &str) -> Result<Self, Box<dyn Error>> {
        let (robot, learned, judged) = match log {
            "kobuki" => {
                let log = logs::log("kobuki_wheel_fault", log)?;
                let healthy: Vec<Run> = log.runs.into_iter().take(1).collect();
                let (learned, judged) = halves(&healthy);
                (log.robot, learned, judged)
            }
            "robotino" => {
                let log = logs::log("robotino_slip", log)?;
                let (learned, others): (Vec<Run>, Vec<Run>) = log
                    .runs
                    .into_iter()
                    .partition(|run| run.id % LEARNED_EVERY == 0);
                let [divisor, remainder] = JUDGED;
                let is_judged = |run: &Run| run.id % divisor == remainder;
                (
                    log.robot,
                    learned,
                    others.into_iter().filter(is_judged).collect(),
                )
            }
            "husky" => {
                let log = logs::log("husky_boreal", log)?;
                let (learned, judged) = halves(&log.runs);
                (log.robot, learned, judged)
            }
            other => return Err(format!("log '{other}': allowed are {}", LOGS.join(", ")).into()),
        };
        let (model, _) = channel_learning::learn(&Log::of_healthy(&learned), &robot)?;
        let every = if log == "robotino" { FAULTY_EVERY } else { 1 };
        Ok(Self {
            setup: setup(robot, &model)?,
            model,
            faulty: (0..judged.len()).filter(|i| i % every == 0).collect(),
            judged,
        })
    }

    /// The robot.
    #[must_use]
    pub const fn robot(&self) -> &Description {
        &self.setup.robot
    }
}

/// The graph of any robot with a model of its channels: that of the Kobuki, with its tree.
///
/// # Errors
/// A configuration that is refused, and a tree larger than a block.
pub fn setup(robot: Description, model: &Model) -> Result<Setup, Box<dyn Error>> {
    let mut setup = load("kobuki.toml")?;
    setup.tree = tree(&robot)?;
    setup.robot = robot;
    setup.model = RobotModel::Channels(Box::new(model.clone()));
    Ok(setup)
}

/// First and second halves of runs.
fn halves(runs: &[Run]) -> (Vec<Run>, Vec<Run>) {
    let half = |run: &Run, frames: &[SensorFrame]| Run {
        id: run.id,
        frames: frames.to_vec(),
    };
    runs.iter()
        .map(|run| {
            let (first, second) = run.frames.split_at(run.frames.len() / 2);
            (half(run, first), half(run, second))
        })
        .unzip()
}

//! How long does a step of detector and identifier take on a robot of 24 channels?
//!
//! The robot is simulated: six wheels with encoders and currents, a pose, a gyro, eight further
//! channels, and eight declared faults: 36 components, each with up to nine kinds of faults. Every
//! frame completes an observation, so that every step weighs all of them.

use std::error::Error;
use std::time::Instant;

use serde_json::json;
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::large_robot::{Broken, LargeRobot, RATE_HZ, description};
use vigil_bench::quantile;
use vigil_bench::real_logs::split::setup;
use vigil_bench::simulated::taxonomy;
use vigil_evaluation::stages::{Stages, Vocabulary};
use vigil_learning::channel_learning::{Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::channel_model::{components, targets};

/// Time that is learned from, s.
const LEARNED_S: f64 = 900.0;
/// Steps of each kind that are timed, and those before them that are not.
const STEPS: usize = 5000;
const BEFORE: usize = 200;
/// What the slowest step in a hundred may take, us.
const BAR_US: f64 = 150.0;

/// How it is printed.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let robot = description()?;
    let mut driven = LargeRobot::new(&robot, 1);
    let log = Run {
        id: 0,
        frames: (0..(LEARNED_S * RATE_HZ) as usize)
            .map(|_| driven.frame(Broken::Nothing))
            .collect(),
    };
    let begun = Instant::now();
    let (model, _) = learn(&Log::of_healthy(&[log]), &robot)?;
    let learned_s = begun.elapsed().as_secs_f64();
    let mut setup = setup(robot, &model)?;
    setup.file.graph.rate_hz = RATE_HZ;
    let mut archive = Archive::new("step", Outlet::by_flag(args.json))?;
    archive.say(&format!(
        "{} channels, {} components; learned from {LEARNED_S} s in {learned_s:.1} s. Steps of \
         detector and identifier together, {STEPS} of each row.",
        targets(&setup.robot).len(),
        components(&setup.robot).len(),
    ));
    archive.say("");
    archive.say("| broken | p50, us | p99, us | most, us |");
    archive.say("|---|---|---|---|");
    let (mut slowest_us, mut figures) = (0.0_f64, Vec::new());
    let kinds = [
        (Broken::Nothing, "nothing"),
        (Broken::Encoder, "an encoder"),
        (Broken::EncoderAndGyro, "an encoder and the gyro"),
    ];
    for (seed, (broken, name)) in (2..).zip(kinds) {
        let vocabulary = Vocabulary {
            taxonomy: taxonomy(&setup),
            robot: setup.robot.clone(),
            actions: setup.decision.actions().to_vec(),
        };
        let (detector, identifier) = (
            vigil_detector::assemble(&setup)?,
            vigil_identifier::assemble(&setup)?,
        );
        let mut stages = Stages::new(detector, identifier, None, vocabulary);
        let mut driven = LargeRobot::new(&setup.robot, seed);
        let mut took_us = Vec::with_capacity(STEPS);
        for step in 0..BEFORE + STEPS {
            let frame = driven.frame(broken);
            let begun = Instant::now();
            stages.take(&frame);
            if step >= BEFORE {
                took_us.push(begun.elapsed().as_secs_f64() * 1e6);
            }
        }
        let [half, most, all] = [0.5, 0.99, 1.0].map(|q| quantile(&mut took_us, q));
        slowest_us = slowest_us.max(most);
        archive.say(&format!("| {name} | {half:.1} | {most:.1} | {all:.1} |"));
        figures.push(json!({"broken": name, "p50_us": half, "p99_us": most, "max_us": all}));
    }
    let is_met = slowest_us <= BAR_US;
    let result = if is_met { "met" } else { "not met" };
    archive.say("");
    archive.say(&format!("p99 at most {BAR_US} us: {result}."));
    let figures = json!({"bar_us": BAR_US, "is_met": is_met, "rows": figures});
    archive.store("step.json", &figures)?;
    Ok(archive.close()?)
}

//! Are two stuck wheels named, both and no other, and is a second one told from a dead encoder?
//!
//! Every pair of wheels in every turn, at once and one 2 s after the other, on the soil learned
//! from, with encoders; and every pair again whose second wheel turns on while its encoder dies to
//! zero with the sensor's noise, as a stuck wheel's reads.
//!
//! The simulator's physics also told what to expect of two wheels (`SAME_SIDE` in the learned
//! robot's motion modes): there are no recordings of two, so this is no independent judge.

use std::error::Error;
use std::path::Path;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::machine;
use vigil_bench::matched::in_parallel;
use vigil_bench::shares::Share;
use vigil_bench::simulated::{Chain, Conditions, Rover, constant};
use vigil_robot::Injection;
use vigil_setup::schema::{Sensors, Simulator};

const RADII_M: [f64; 7] = [1.0, -1.0, 2.0, -2.0, 6.0, -6.0, 1e3];
const SPEEDS_M_S: [f64; 3] = [0.1, 0.2, 0.3];
/// Time from the first stuck wheel to the second fault, s, and whether that is a dead encoder.
const CASES: [(f64, bool); 3] = [(0.0, false), (2.0, false), (2.0, true)];
const ONSET_S: f64 = 4.0;
/// Times after the second onset at which the set is judged, s.
const JUDGED_S: [f64; 2] = [2.0, 5.0];
const RATE_HZ: f64 = 20.0;

/// One run, and what was said of it.
#[derive(Debug, Clone)]
struct Run {
    wheels: [usize; 2],
    apart_s: f64,
    is_encoder: bool,
    radius_m: f64,
    speed_m_s: f64,
    seed: u64,
    said: [String; JUDGED_S.len()],
}

/// Worlds of every cell.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Worlds per cell.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seeds: u64,
    /// Seed of the first; tuning takes 100000 or more, and so no run that is archived.
    #[arg(long, value_name = "S", default_value_t = 1)]
    first_seed: u64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let rover = Rover::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))?;
    let jobs = jobs(&rover, args.seeds, args.first_seed);
    let drive = |job: &Run| drive(&rover, job.clone()).map_err(|error| error.to_string());
    let runs: Result<Vec<Run>, String> = in_parallel(&jobs, drive).into_iter().collect();
    let runs = runs?;
    let named = |case: (f64, bool), at: usize| {
        let own = runs
            .iter()
            .filter(|run| (run.apart_s, run.is_encoder) == case);
        Share::of(own, |run| run.said[at] == expected(&rover, run))
    };
    let shares = CASES.map(|case| [0, 1].map(|at| named(case, at)));
    let rows = CASES
        .iter()
        .zip(&shares)
        .map(|(&(apart_s, is_encoder), shares)| {
            let named = shares.each_ref().map(Share::json);
            let second = second(is_encoder);
            json!({ "second": second, "apart_s": apart_s, "judged_s": JUDGED_S, "named": named })
        });
    let document = json!({ "machine": machine::facts(), "runs": rows.collect::<Vec<_>>() });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("two-wheels")?;
    archive.store("two-wheels.json", &document)?;
    let lines: Vec<String> = runs.iter().map(|run| line(&rover, run)).collect();
    let head = "wheels,second,apart_s,radius_m,speed_m_s,seed,set_2s,set_5s";
    archive.store_text("runs.csv", &format!("{head}\n{}\n", lines.join("\n")))?;
    archive.say(
        "Two stuck wheels of the simulated rover, or a stuck one and a dead encoder, 20 Hz, with \
         encoders: named, both and no other, 2 s and 5 s after the second.\n",
    );
    for ((apart_s, is_encoder), [soon, late]) in CASES.iter().zip(&shares) {
        archive.say(&format!(
            "- second {}, {apart_s} s apart: {}; {}",
            second(*is_encoder),
            soon.long(),
            late.long()
        ));
    }
    archive.close()?;
    Ok(())
}

fn jobs(rover: &Rover, seeds: u64, first_seed: u64) -> Vec<Run> {
    let mut jobs = Vec::new();
    let count = rover.robot.wheels.len();
    for a in 0..count {
        for b in (0..count).filter(|b| *b != a) {
            for (r, radius_m) in RADII_M.into_iter().enumerate() {
                for (apart_s, is_encoder) in CASES {
                    // At once there is no first and second.
                    if apart_s == 0.0 && b < a {
                        continue;
                    }
                    for _ in 0..seeds {
                        jobs.push(Run {
                            wheels: [a, b],
                            apart_s,
                            is_encoder,
                            radius_m,
                            speed_m_s: SPEEDS_M_S[(a + b + r) % SPEEDS_M_S.len()],
                            seed: first_seed + jobs.len() as u64,
                            said: Default::default(),
                        });
                    }
                }
            }
        }
    }
    jobs
}

fn drive(rover: &Rover, mut job: Run) -> Result<Run, Box<dyn Error>> {
    let mut changes = Vec::new();
    for (wheel, at_s) in job.wheels.into_iter().zip([ONSET_S, ONSET_S + job.apart_s]) {
        let name = &rover.robot.wheels[wheel].name;
        let words = match job.is_encoder && !changes.is_empty() {
            true => format!("encoder-scale:{name}:0"),
            false => format!("stuck:{name}"),
        };
        let change = Injection::parse_change(&words, &rover.robot)?;
        changes.push((change, at_s));
    }
    let conditions = Conditions {
        simulator: Simulator::default(),
        drive: constant(1.0 / job.radius_m, job.speed_m_s),
        rate_hz: RATE_HZ,
        seed: job.seed,
    };
    let mut chain = Chain::new(rover, Sensors::PoseEncoders, job.seed)?;
    let due_s = JUDGED_S.map(|after_s| ONSET_S + job.apart_s + after_s);
    let duration_s = due_s[1] + 2.0 / RATE_HZ;
    conditions.drive(rover, duration_s, &changes, |t_s, frame| {
        chain.take(frame);
        for (said, due_s) in job.said.iter_mut().zip(due_s) {
            if said.is_empty() && t_s >= due_s {
                *said = chain.said().fault_set;
            }
        }
    })?;
    Ok(job)
}

const fn second(is_encoder: bool) -> &'static str {
    if is_encoder { "dead encoder" } else { "stuck" }
}

/// The set of these faults, as a diagnosis names it: in the order of the tree's leaves, which is
/// that of the robot's wheels, stuck ones first.
fn expected(rover: &Rover, run: &Run) -> String {
    let name = |wheel: usize| rover.robot.wheels[wheel].name.as_str();
    let [first, second] = run.wheels;
    if run.is_encoder {
        return format!("{}_STUCK+{}_ENC", name(first), name(second));
    }
    let (low, high) = (first.min(second), first.max(second));
    format!("{}_STUCK+{}_STUCK", name(low), name(high))
}

fn line(rover: &Rover, run: &Run) -> String {
    let wheels = run.wheels.map(|w| rover.robot.wheels[w].name.as_str());
    format!(
        "{},{},{},{},{},{},{}",
        wheels.join("+"),
        second(run.is_encoder),
        run.apart_s,
        run.radius_m,
        run.speed_m_s,
        run.seed,
        run.said.join(",")
    )
}

//! Are verdicts and actions the same, bit for bit, as those of `bench/bits.txt`?

use std::collections::BTreeSet;
use std::error::Error;

use clap::ValueEnum;
use vigil_bench::simulated::{ALL_SETS, stages};
use vigil_bench::{load, root};
use vigil_blocks::{Action, DetectionBelief, FaultBelief, fnv1a};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify::IdentifierFilter;
use vigil_recording::frames::{self, Run};
use vigil_setup::Setup;
use vigil_terminal::output;

/// Runs that are hashed, evenly over those that `vigil learn` left out.
const RUNS: usize = 30;
/// Frames a second of the recorded runs.
const RATE_HZ: f64 = 10.0;
const SEED: u64 = 1;

/// What is done with the hash.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Keep the hash in bench/bits.txt; the commit that does so says why it changed.
    #[arg(long)]
    keep: bool,
}

/// Hashes, prints, and compares or keeps.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let (setup, setup_all) = (load("rover.toml")?, load("rover-all.toml")?);
    let runs = left_out(&setup)?;
    let mut text = String::new();
    let mut total = fnv1a::BASIS;
    for (sensors, name) in ALL_SETS {
        // Only the default filter knows the faults of all channels.
        let (setup, filters) = match sensors {
            Sensors::All => (&setup_all, &[IdentifierFilter::default()][..]),
            _ => (&setup, IdentifierFilter::value_variants()),
        };
        for filter in filters {
            let hash = hash_runs(setup, sensors, *filter, &runs)?;
            total = fnv1a::hash_u64(total, hash);
            say(&mut text, &format!("{hash:016x} {name} {filter}"))?;
        }
    }
    say(&mut text, &format!("{total:016x} all"))?;
    let file = root().join("bench/bits.txt");
    if args.keep {
        return Ok(std::fs::write(&file, text)?);
    }
    match std::fs::read_to_string(&file)? == text {
        true => Ok(()),
        false => Err("verdicts or actions differ from those of bench/bits.txt".into()),
    }
}

/// Adds a line to the text, and prints it.
fn say(text: &mut String, line: &str) -> std::io::Result<()> {
    text.push_str(line);
    text.push('\n');
    output::line(line)
}

/// The runs, evenly drawn from those that the model was not learned from.
fn left_out(setup: &Setup) -> Result<Vec<Run>, Box<dyn Error>> {
    let model = setup.model.clone().with_faults();
    let model = model.ok_or("the rover's model has no faults")?;
    let held_out: BTreeSet<u32> = model.provenance.runs_held_out.iter().copied().collect();
    let file = root().join("tests/data/rover/learn_frames.csv.gz");
    let runs = frames::read(&file, &setup.robot)?;
    let runs: Vec<Run> = runs
        .into_iter()
        .filter(|run| held_out.contains(&run.id))
        .collect();
    let drawn = (0..RUNS).filter_map(|i| runs.get(i * runs.len() / RUNS).cloned());
    Ok(drawn.collect())
}

/// Hash over everything that the three stages say of every frame.
fn hash_runs(
    setup: &Setup,
    sensors: Sensors,
    filter: IdentifierFilter,
    runs: &[Run],
) -> Result<u64, Box<dyn Error>> {
    let mut setup = setup.clone();
    setup.file.identifier.filter = filter;
    let mut hash = fnv1a::BASIS;
    for run in runs {
        let mut stages = stages(&setup, sensors, RATE_HZ, SEED)?;
        for frame in &run.frames {
            stages.take(frame);
            hash = hash_detection(hash, stages.detection());
            hash = hash_diagnosis(hash, stages.diagnosis());
            hash = hash_action(hash, stages.action());
        }
    }
    Ok(hash)
}

fn hash_values<'a>(hash: u64, values: impl IntoIterator<Item = &'a f64>) -> u64 {
    let add = |hash, value: &f64| fnv1a::hash_u64(hash, value.to_bits());
    values.into_iter().fold(hash, add)
}

fn hash_words(hash: u64, words: impl IntoIterator<Item = u32>) -> u64 {
    let add = |hash, word| fnv1a::hash_u64(hash, u64::from(word));
    words.into_iter().fold(hash, add)
}

fn hash_detection(hash: u64, belief: &DetectionBelief) -> u64 {
    let hash = hash_values(hash, [&belief.p_fault, &belief.log_odds, &belief.evidence]);
    let hash = hash_values(hash, &belief.channel_log_odds);
    let hash = fnv1a::hash_u64(hash, belief.alarm_t_capture_ns);
    hash_words(
        hash,
        [
            belief.alarm,
            belief.alarm_count,
            belief.symptoms,
            belief.blind,
        ],
    )
}

fn hash_diagnosis(hash: u64, belief: &FaultBelief) -> u64 {
    let probabilities = belief.p.iter().chain(&belief.p_predicted);
    let sizes = belief.size.iter().chain(&belief.size_sd);
    let unknown = [&belief.p_unknown, &belief.p_unknown_predicted];
    let mut hash = hash_values(hash, probabilities.chain(sizes).chain(unknown));
    for set in &belief.sets {
        hash = hash_values(fnv1a::hash_u64(hash, set.leaves), [&set.p]);
    }
    let words = [belief.mode, belief.reported, belief.runner_up];
    hash_words(hash, words.into_iter().chain(belief.size_kind))
}

fn hash_action(hash: u64, action: &Action) -> u64 {
    let values = action.belief.iter().chain(&action.value);
    let parameters = [
        &action.speed_scale,
        &action.curvature_gain,
        &action.curvature_offset,
    ];
    let hash = hash_values(hash, values.chain(parameters));
    let wheels = action.answered().to_event() as u32;
    let words = [action.action, action.kind, wheels];
    hash_words(
        hash,
        words
            .into_iter()
            .chain([action.control_mode, action.alarm, action.blind]),
    )
}

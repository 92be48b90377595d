//! Recorded runs as scenarios: the rover's, and logs of real robots.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

use vigil_diagnosis::Sensors;
use vigil_evaluation::scoring::Taxonomy;
use vigil_evaluation::scoring::field::{Scorer, Stretch};
use vigil_learning::channel_learning::{self, Log};
use vigil_recording::{frames, labels};
use vigil_setup::Setup;

use super::frames::{Fate, RunConditions, Way};
use super::ground::stream;
use super::job::{Job, ScoredRun};
use super::scenario::{Scenario, Source};
use super::timeline::Timeline;
use super::watch::Watch;
use crate::load;
use crate::real_logs::{self, logs};
use crate::run_time::{period_s, span_s, time_s};
use crate::simulated;

/// A run, and what is true in it.
#[derive(Debug, Clone)]
struct Case {
    run: frames::Run,
    ground: String,
    /// The leaf, and since when, s.
    fault: Option<(String, f64)>,
}

/// The runs of one scenario, and who watches them.
#[derive(Debug, Clone)]
pub struct Material {
    setup: Setup,
    taxonomy: Taxonomy,
    cases: Vec<Case>,
}

/// The runs of every scenario, by the scenario's name.
pub type Library = BTreeMap<String, Material>;

/// Reads what the scenarios name; nothing without `VIGIL_DATA`, which is said.
///
/// # Errors
/// What is missing or malformed.
pub fn library(scenarios: &[&Scenario]) -> Result<Library, Box<dyn Error>> {
    let named = scenarios
        .iter()
        .filter_map(|s| Some((s, s.recorded.as_ref()?)));
    let Ok(data) = std::env::var("VIGIL_DATA") else {
        for (scenario, _) in named {
            eprintln!("field: {} is SKIPPED: VIGIL_DATA is not set", scenario.name);
        }
        return Ok(Library::new());
    };
    let data = PathBuf::from(data);
    let (mut library, mut read) = (Library::new(), BTreeMap::new());
    for (scenario, source) in named {
        if let Some(missing) = source.missing(&data) {
            let (name, file) = (&scenario.name, missing.display());
            eprintln!("field: {name} is SKIPPED: {file} is not there");
            continue;
        }
        let key = (source.log.clone(), source.half);
        if !read.contains_key(&key) {
            read.insert(key.clone(), material(&data, source)?);
        }
        let Some(whole) = read.get(&key) else {
            continue;
        };
        let mut mine = whole.clone();
        mine.cases.retain(|case| source.takes(case, &mine.taxonomy));
        if mine.cases.is_empty() {
            return Err(format!("{}: there is no such recorded run", scenario.name).into());
        }
        library.insert(scenario.name.clone(), mine);
    }
    Ok(library)
}

impl Source {
    /// What may be missing and is: recordings that everybody makes for himself.
    fn missing(&self, data: &Path) -> Option<PathBuf> {
        let frames = data.join("rover/mujoco_frames.csv.gz");
        (self.log == "mujoco" && !frames.is_file()).then_some(frames)
    }

    fn takes(&self, case: &Case, taxonomy: &Taxonomy) -> bool {
        let of_fault = |(leaf, _): &(String, f64)| taxonomy.class_or_unmodelled(leaf).to_owned();
        let class = case.fault.as_ref().map_or("nominal".to_owned(), of_fault);
        let is = |wanted: &Option<String>, found: &str| {
            wanted.as_deref().is_none_or(|wanted| wanted == found)
        };
        is(&self.ground, &case.ground) && is(&self.class, &class)
    }
}

impl Material {
    /// Number of runs.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.cases.len()
    }

    /// True without a run.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.cases.is_empty()
    }
}

fn material(data: &Path, source: &Source) -> Result<Material, Box<dyn Error>> {
    match source.log.as_str() {
        "left-out" | "grounds" | "mujoco" => rover(data, &source.log),
        "kobuki" => {
            let log = logs::log("kobuki_wheel_fault", "kobuki")?;
            let whole = log.runs.into_iter().next().ok_or("no run")?;
            let middle = whole.frames.len() / 2;
            let half = |id: u32, frames: &[vigil_blocks::SensorFrame]| {
                let run = frames::Run {
                    id,
                    frames: frames.to_vec(),
                };
                ("nonfaulty".to_owned(), run)
            };
            let (first, second) = whole.frames.split_at(middle);
            let halves = vec![half(0, first), half(1, second)];
            learned(log.robot, halves, source.half.unwrap_or(1))
        }
        "husky" => {
            let log = logs::log("husky_boreal", "husky")?;
            let ground = |name: &String| name.split('/').next().unwrap_or_default().to_owned();
            let runs = log.names.iter().map(ground).zip(log.runs);
            learned(log.robot, runs.collect(), source.half.unwrap_or(1))
        }
        other => Err(format!(
            "log '{other}': allowed are left-out, grounds, mujoco, kobuki, husky"
        )
        .into()),
    }
}

/// The rover with its shipped model, which was learned from the other runs alone.
fn rover(data: &Path, log: &str) -> Result<Material, Box<dyn Error>> {
    let setup = load("rover.toml")?;
    let name = match log {
        "grounds" => "grounds_dev",
        "mujoco" => "mujoco",
        _ => "learn",
    };
    let at = |kind: &str| data.join("rover").join(format!("{name}_{kind}"));
    let runs = frames::read(&at("frames.csv.gz"), &setup.robot)?;
    let labelled = labels::read(&at("runs.csv"), &setup.robot)?;
    let labelled: BTreeMap<u32, _> = labelled.into_iter().map(|l| (l.run, l)).collect();
    let left_out = &setup.model.provenance().runs_held_out;
    let mut cases = Vec::new();
    for run in runs {
        if log == "left-out" && !left_out.contains(&run.id) {
            continue;
        }
        let label = labelled.get(&run.id).ok_or("a run has no label")?;
        cases.push(Case {
            ground: labels::terrain(&at("runs.csv"), &[run.id])?,
            fault: label.onset_s.map(|onset_s| (label.mode.clone(), onset_s)),
            run,
        });
    }
    Ok(Material {
        taxonomy: simulated::taxonomy(&setup),
        setup,
        cases,
    })
}

/// A robot learned from every second run; the others are judged.
fn learned(
    robot: vigil_robot::Description,
    runs: Vec<(String, frames::Run)>,
    judged: usize,
) -> Result<Material, Box<dyn Error>> {
    let is_judged = |run: &frames::Run| run.id as usize % 2 == judged;
    let others = runs.iter().filter(|(_, run)| !is_judged(run));
    let others: Vec<frames::Run> = others.map(|(_, run)| run.clone()).collect();
    let (model, _) = channel_learning::learn(&Log::of_healthy(&others), &robot)?;
    let cases = runs.into_iter().filter(|(_, run)| is_judged(run));
    let cases = cases.map(|(ground, run)| Case {
        run,
        ground,
        fault: None,
    });
    let setup = real_logs::split::setup(robot, &model)?;
    Ok(Material {
        cases: cases.collect(),
        taxonomy: simulated::taxonomy(&setup),
        setup,
    })
}

impl Case {
    fn truth(&self, sensors: Sensors, taxonomy: &Taxonomy) -> Vec<Stretch> {
        // By the pose alone nothing can be seen of an encoder.
        let sees = |leaf: &str| sensors != Sensors::Pose || taxonomy.class(leaf) != Some("encoder");
        let fault = self.fault.as_ref().filter(|(leaf, _)| sees(leaf));
        let (leaf, onset_s) = fault.map_or(("", None), |(leaf, s)| (leaf.as_str(), Some(*s)));
        Stretch::of_label(leaf, onset_s, taxonomy)
    }
}

/// Plays a recorded run to every set of sensors.
///
/// # Errors
/// Stages that cannot be made.
pub fn play(material: &Material, job: &Job<'_>) -> Result<Vec<ScoredRun>, Box<dyn Error>> {
    let Material {
        setup,
        taxonomy,
        cases,
    } = material;
    let case = cases.get(job.run).ok_or("there is no such run")?;
    let mut scored = Vec::new();
    for (sensors, name) in job.scenario.sets() {
        let period_s = period_s(&case.run);
        let seed = u64::from(case.run.id);
        let truth = case.truth(sensors, taxonomy);
        let scorer = Scorer::new(&truth, taxonomy, span_s(&case.run), seed);
        let mut watch = Watch::new(setup, sensors, 1.0 / period_s, seed, scorer)?;
        watch.timeline = Timeline::asked_for(job, seed, name);
        let mut rng = stream(job.scenario.first_seed + seed, 4);
        let later_s = job.scenario.spread_s * rand::RngExt::random::<f64>(&mut rng);
        // What was recorded has its noise already.
        let conditions = RunConditions {
            run: job.run,
            rate_hz: 1.0 / period_s,
            noise: 0.0,
            later_s,
        };
        let mut way = Way::new(&job.scenario.frames, &setup.robot, conditions, rng);
        let mut held = None;
        for frame in &case.run.frames {
            let t_s = time_s(frame);
            let fate = way.fate(t_s);
            fate.deliver(frame, held.as_ref(), &mut |frame| watch.take(frame));
            held = (fate == Fate::Overtaken).then_some(*frame);
            watch.score(t_s, frame);
        }
        scored.push(ScoredRun {
            sensors: name,
            run: watch.finish(),
        });
    }
    Ok(scored)
}

//! Runs of scenarios.

use std::error::Error;

use vigil_diagnosis::Sensors;
use vigil_evaluation::scoring::Taxonomy;
use vigil_evaluation::scoring::field::{Scorer, Stretch};
use vigil_robot::learned::Model;
use vigil_robot::{Description, Injection};
use vigil_sensor_sim::{ActionGate, EffectiveCommand, World};
use vigil_setup::Setup;
use vigil_setup::graph_file::Simulator;

use super::course::{Range, course};
use super::fault::{self, Places};
use super::frames::{RunConditions, Way};
use super::ground::{Ground, stream};
use super::job::{Job, ScoredRun};
use super::passage::Passage;
use super::recorded::{self, Library, Material};
use super::scenario::{File, Scenario};
use super::timeline::Timeline;
use super::watch::Watch;
use crate::load;
use crate::simulated::taxonomy;

/// Every run of the scenarios; `scale` multiplies their number, at least one each stays. Recorded
/// runs are all played, whatever the scale, and none without their files. Of a `timeline` only the
/// run with its number.
#[must_use]
pub fn jobs<'a>(
    scenarios: &[&'a Scenario],
    scale: f64,
    library: &Library,
    timeline: Option<usize>,
) -> Vec<Job<'a>> {
    let runs = |scenario: &Scenario| match &scenario.recorded {
        Some(_) => library.get(&scenario.name).map_or(0, Material::len),
        None => (scenario.runs as f64 * scale).round().max(1.0) as usize,
    };
    let all = scenarios.iter().flat_map(|scenario| {
        (0..runs(scenario)).map(|run| Job {
            scenario,
            run,
            timeline: timeline.is_some(),
        })
    });
    all.filter(|job| timeline.is_none_or(|run| run == job.run))
        .collect()
}

/// The rover's graph as it ships.
#[derive(Debug, Clone)]
pub struct Graph {
    setup: Setup,
    model: Model,
    taxonomy: Taxonomy,
    /// The same with every channel of the frames.
    all: Box<(Setup, Taxonomy)>,
}

impl Graph {
    /// Reads `config/rover.toml` and `config/rover-all.toml`.
    ///
    /// # Errors
    /// A configuration that is refused.
    pub fn read() -> Result<Self, Box<dyn Error>> {
        let (setup, all) = (load("rover.toml")?, load("rover-all.toml")?);
        let model = setup.model.clone().with_faults();
        Ok(Self {
            model: model.ok_or("the rover's model has no faults")?,
            taxonomy: taxonomy(&setup),
            setup,
            all: Box::new((all.clone(), taxonomy(&all))),
        })
    }

    /// Setup and words for a set of sensors.
    pub(super) fn setup(&self, sensors: Sensors) -> (&Setup, &Taxonomy) {
        match sensors {
            Sensors::All => (&self.all.0, &self.all.1),
            _ => (&self.setup, &self.taxonomy),
        }
    }
}

/// What is the same for every set of sensors in a run.
pub(super) struct Conditions {
    pub(super) rate_hz: f64,
    pub(super) simulator: Simulator,
    pub(super) drive: Vec<vigil_setup::graph_file::DriveSegment>,
    /// Faults, which count as such, and everything that changes in the world.
    pub(super) faults: Vec<Injection>,
    pub(super) changes: Vec<Injection>,
    pub(super) ground: Ground,
    pub(super) way: Way,
    pub(super) seed: u64,
}

impl Conditions {
    /// Draws those of a run.
    pub(super) fn draw(graph: &Graph, job: &Job<'_>) -> Result<Self, String> {
        let Job { scenario, run, .. } = *job;
        let seed = scenario.first_seed + run as u64;
        let (robot, rng) = (&graph.setup.robot, &mut stream(seed, 0));
        let rate_hz = scenario.rate_hz.sample(run, rng);
        let usual = Simulator::default();
        let mut of = |draw: &Option<super::Draw>, otherwise: f64| {
            draw.as_ref()
                .map_or(otherwise, |draw| draw.sample(run, rng))
        };
        let noise = of(&scenario.world.noise, 1.0);
        let mut simulator = Simulator {
            lag_s: of(&scenario.world.lag_s, usual.lag_s),
            friction_scatter: of(&scenario.world.scatter, usual.friction_scatter),
            noise_scale: Way::world_noise(&scenario.frames, noise),
            ..usual
        };
        let range = Range {
            command: &graph.model.command,
            robot,
            graph: &graph.setup.file.drive,
        };
        let drive = course(&scenario.drive, range, scenario.run_s, &mut stream(seed, 1))?;
        let mut rng = stream(seed, 2);
        let places = Places::draw(robot, run, &mut rng);
        let later_s = scenario.spread_s * rand::RngExt::random::<f64>(&mut rng);
        let specs = |all: &[String]| scenario.specs(all, run);
        let faults = fault::changes(&specs(&scenario.faults), &places, robot, later_s)?;
        let context = fault::changes(&specs(&scenario.context), &places, robot, later_s)?;
        let mut changes: Vec<Injection> = faults.iter().chain(&context).copied().collect();
        changes.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Ok(Self {
            ground: Ground::new(
                &scenario.world,
                &mut simulator,
                (robot, graph.model.command.curvature_max_1_m),
                run,
                stream(seed, 3),
            ),
            way: Way::new(
                &scenario.frames,
                robot,
                RunConditions {
                    run,
                    rate_hz,
                    noise,
                    later_s,
                },
                stream(seed, 4),
            ),
            rate_hz,
            simulator,
            drive,
            faults,
            changes,
            seed,
        })
    }
}

impl Conditions {
    /// The rover at the beginning of the run.
    ///
    /// # Errors
    /// A simulator that is refused.
    pub(super) fn begin(&self, robot: &Description) -> Result<Passage<'_>, Box<dyn Error>> {
        let (simulator, segments) = (&self.simulator, &self.drive);
        let world = World::new(robot, simulator, segments, self.rate_hz, self.seed)?;
        let ways = (self.ground.clone(), self.way.clone());
        Passage::begin(world, ways, &self.changes, self.rate_hz)
    }
}

impl std::fmt::Display for Conditions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { rate_hz, way, .. } = self;
        let Simulator {
            lag_s,
            friction_scatter,
            noise_scale,
            ..
        } = self.simulator;
        write!(
            f,
            "{rate_hz} Hz, lag {lag_s} s, friction scatter {friction_scatter:.3}, \
             noise {noise_scale:.2}, {way}"
        )
    }
}

/// Drives a run with every set of sensors of its scenario.
///
/// # Errors
/// A scenario that cannot be driven, with its name.
pub fn run(graph: &Graph, library: &Library, job: &Job<'_>) -> Result<Vec<ScoredRun>, String> {
    let named = |error: String| format!("{}: {error}", job.scenario.name);
    if let Some(material) = library.get(&job.scenario.name) {
        return recorded::play(material, job).map_err(|error| named(error.to_string()));
    }
    let conditions = Conditions::draw(graph, job).map_err(named)?;
    if job.timeline {
        eprintln!("{} {}: {conditions}", job.scenario.name, conditions.seed);
    }
    let sets: Vec<(Sensors, &'static str)> = job.scenario.sets().collect();
    // A world that obeys is another one for each set.
    let groups: Vec<&[(Sensors, &'static str)]> = match job.scenario.obeys {
        true => sets.chunks(1).collect(),
        false => vec![&sets],
    };
    let mut scored = Vec::new();
    for group in groups {
        let found = drive(graph, job, &conditions, group);
        scored.extend(found.map_err(|error| named(error.to_string()))?);
    }
    Ok(scored)
}

/// One world, and the stages that watch it.
fn drive(
    graph: &Graph,
    job: &Job<'_>,
    conditions: &Conditions,
    sets: &[(Sensors, &'static str)],
) -> Result<Vec<ScoredRun>, Box<dyn Error>> {
    let (robot, scenario) = (&graph.setup.robot, job.scenario);
    let &Conditions { rate_hz, seed, .. } = conditions;
    let truths = sets.iter().map(|(sensors, _)| {
        let tree = &graph.setup(*sensors).0.tree;
        fault::truth(&conditions.faults, tree, robot, *sensors)
    });
    let truths: Vec<Vec<Stretch>> = truths.collect();
    let mut watches = Vec::new();
    for ((sensors, name), truth) in sets.iter().zip(&truths) {
        let (setup, words) = graph.setup(*sensors);
        let scorer = Scorer::new(truth, words, [0.0, scenario.run_s], seed);
        let mut watch = Watch::new(setup, *sensors, rate_hz, seed, scorer)?;
        watch.timeline = Timeline::asked_for(job, seed, name);
        watches.push(watch);
    }
    let mut passage = conditions.begin(robot)?;
    let mut gate = ActionGate::new(&robot.limits);
    for k in 0..(scenario.run_s * rate_hz).round() as u64 {
        passage.advance(
            |planned| match watches.first().filter(|_| scenario.obeys && k > 0) {
                Some(watch) => gate.apply(planned, Some(watch.stages.action()), 0),
                None => EffectiveCommand::as_planned(planned),
            },
        )?;
        for watch in &mut watches {
            passage.deliver(&mut |frame| watch.take(frame));
            watch.score(passage.t_s, &passage.frame);
        }
    }
    let named = watches.into_iter().zip(sets);
    Ok(named
        .map(|(watch, (_, sensors))| ScoredRun {
            sensors,
            run: watch.finish(),
        })
        .collect())
}

/// The scenarios of a file whose names begin with any of `names`; all without one.
///
/// # Errors
/// A name that no scenario begins with.
pub fn select<'a>(file: &'a File, names: &[String]) -> Result<Vec<&'a Scenario>, String> {
    let begins = |name: &String| {
        let mut all = file.scenario.iter();
        all.any(|scenario| scenario.name.starts_with(name.as_str()))
    };
    if let Some(unknown) = names.iter().find(|name| !begins(name)) {
        return Err(format!("no scenario begins with '{unknown}': see --list"));
    }
    let is = |scenario: &&Scenario| {
        let mut wanted = names.iter();
        names.is_empty() || wanted.any(|name| scenario.name.starts_with(name.as_str()))
    };
    Ok(file.scenario.iter().filter(is).collect())
}

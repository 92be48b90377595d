//! Scenarios as their file states them.

use std::error::Error;
use std::path::Path;

use rand::{Rng, RngExt};
use serde::Deserialize;
use vigil_diagnosis::Sensors;

use super::bar::Bar;
use super::departure::Departure;
use super::recorded::Source;
use crate::simulated::ALL_SETS;

/// The file of all scenarios.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// Scenarios, in the order in which they are shown.
    pub scenario: Vec<Scenario>,
}

/// One scenario.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Its name: words joined by `/`, the general one first.
    pub name: String,
    /// What it is about, in a sentence.
    pub about: String,
    /// Sets of sensors: `pose`, `pose+encoders`, `all`; default the first two.
    #[serde(default = "both")]
    pub sensors: Vec<String>,
    /// Frames per second; default 20.
    #[serde(default = "twenty")]
    pub rate_hz: Draw,
    /// Length of a run, s.
    #[serde(default)]
    pub run_s: f64,
    /// Runs; of recorded ones all there are.
    #[serde(default)]
    pub runs: usize,
    /// Recorded runs instead of simulated ones; only `frames` then changes anything.
    #[serde(default)]
    pub recorded: Option<Source>,
    /// Seed of the first run; the others follow it.
    pub first_seed: u64,
    /// What is driven: `random`, `stops`, `reversals`, `creep`, `tight`, `mixed`, `graph` (the
    /// drive of `config/rover.toml`), or segments `CURVATURE_1_M:SPEED_M_S:S` joined by commas.
    #[serde(default)]
    pub drive: String,
    /// True if the world obeys the supervisor's actions; default false.
    #[serde(default)]
    pub obeys: bool,
    /// A scenario of its own is made of each of these; it takes the place of `EACH` in `faults` and
    /// `context`.
    #[serde(default)]
    pub each: Vec<String>,
    /// One of these takes the place of `EACH` instead, run by run: figures then are over all of
    /// them.
    #[serde(default)]
    pub in_turn: Vec<String>,
    /// Sizes that take the place of `SIZE` in `faults`: a scenario of each.
    #[serde(default)]
    pub departure: Option<Departure>,
    /// Changes of health as `SPEC@T`, s: `stuck:W1@10`, `clear:W1@30`. `W1` to `W6` are different
    /// wheels, drawn for each run, `S1` a steered one, `SIDE` a side. A time may be a sum.
    #[serde(default)]
    pub faults: Vec<String>,
    /// All times of `faults`, `context` and gaps are later by up to so much, s, drawn for each run;
    /// default 2.
    #[serde(default = "two")]
    pub spread_s: f64,
    /// The same, but of the ground or of what counts as healthy.
    #[serde(default)]
    pub context: Vec<String>,
    /// The world.
    #[serde(default)]
    pub world: World,
    /// What becomes of the frames.
    #[serde(default)]
    pub frames: Frames,
    /// Bars.
    #[serde(default)]
    pub bars: Vec<Bar>,
}

/// Settings of the world. Those not given are the simulator's.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct World {
    /// Time constant of the body's velocity, s.
    pub lag_s: Option<Draw>,
    /// Factor on the noise of every sensor.
    pub noise: Option<Draw>,
    /// Factor on the soil's friction.
    pub friction: Option<Draw>,
    /// Factor on the soil's shear modulus.
    pub shear_modulus: Option<Draw>,
    /// Relative scatter of the friction.
    pub scatter: Option<Draw>,
    /// Slope ahead, rad.
    pub slope_rad: Option<Draw>,
    /// Slope to the side, rad.
    pub side_slope_rad: Option<Draw>,
    /// Friction, shear modulus and slopes are drawn anew after so much driving, m.
    pub ground_each_m: Option<Draw>,
    /// They change over this length, m, alike left and right; default 0.5.
    pub ground_over_m: Option<Draw>,
    /// Ground on which the robot departs by more than its tolerance is drawn again: there an alarm
    /// is right.
    pub within_tolerance: bool,
}

/// What becomes of the frames on their way.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Frames {
    /// Share of frames that are lost one by one.
    pub loss: Option<Draw>,
    /// Gaps at given times: from, to, s.
    pub gaps_s: Vec<[f64; 2]>,
    /// Length of gaps at random times, s.
    pub burst_s: Option<Draw>,
    /// Mean time between them, s; default 20.
    pub burst_each_s: Option<Draw>,
    /// Instants of capture differ by up to so much of a period from regular ones, either way.
    pub jitter: Option<Draw>,
    /// Stamps differ by so much from the instants of capture, which are regular.
    pub stamp_jitter: Option<Draw>,
    /// Share of frames that come after the deadline: every stage misses them first.
    pub late: Option<Draw>,
    /// Share of frames that come after their successor.
    pub overtaken: Option<Draw>,
    /// Share of frames that come twice.
    pub doubled: Option<Draw>,
    /// Factor on the noise of x alone.
    pub noise_x: Option<Draw>,
    /// Factor on the noise of y alone.
    pub noise_y: Option<Draw>,
    /// Factor on the noise of yaw alone.
    pub noise_yaw: Option<Draw>,
    /// Factor on the noise of one encoder alone.
    pub noise_encoder: Option<Draw>,
    /// Share of samples of pose and encoders with ten times the noise.
    pub outliers: Option<Draw>,
    /// Noise is Student's with so many degrees of freedom, above 2, instead of normal, with the
    /// same standard deviation.
    pub student: Option<Draw>,
    /// The pose is an odometry whose yaw drifts, rad/s.
    pub yaw_drift_rad_s: Option<Draw>,
    /// The same: distances are scaled by a factor.
    pub pose_scale: Option<Draw>,
}

/// A number for each run.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Draw {
    /// Always this one.
    Always(f64),
    /// One after the other, run by run.
    InTurn(Vec<f64>),
    /// Any of these, drawn for each run.
    Any {
        /// The numbers.
        any: Vec<f64>,
    },
    /// Evenly drawn for each run.
    Between {
        /// Least value.
        from: f64,
        /// Greatest value.
        to: f64,
    },
}

impl Draw {
    /// The number of a run.
    pub fn sample(&self, run: usize, rng: &mut impl Rng) -> f64 {
        match self {
            Self::Always(value) => *value,
            Self::InTurn(values) => *values.get(run % values.len().max(1)).unwrap_or(&f64::NAN),
            Self::Any { any } => {
                let at = rng.random_range(0..any.len().max(1));
                *any.get(at).unwrap_or(&f64::NAN)
            }
            Self::Between { from, to } => from + (to - from) * rng.random::<f64>(),
        }
    }
}

fn both() -> Vec<String> {
    ["pose", "pose+encoders"].map(str::to_owned).to_vec()
}

const fn twenty() -> Draw {
    Draw::Always(20.0)
}

const fn two() -> f64 {
    2.0
}

impl File {
    /// Reads a file of scenarios; those with `each` become several.
    ///
    /// # Errors
    /// What is malformed, and names that appear twice.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let at = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let text = std::fs::read_to_string(path).map_err(|error| at(&error))?;
        let mut table: toml::Table = toml::from_str(&text).map_err(|error| at(&error))?;
        vary(&mut table).map_err(|error| at(&error))?;
        let file: Self = table.try_into().map_err(|error| at(&error))?;
        let spread: Result<Vec<_>, String> = file.scenario.iter().map(Scenario::spread).collect();
        let scenario = spread.map_err(|error| at(&error))?.concat();
        let mut names: Vec<&str> = scenario.iter().map(|s| s.name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(at(&format!("scenario '{}' appears twice", twice[0])).into());
        }
        let allowed = ALL_SETS.map(|(_, set)| set);
        for Scenario { name, sensors, .. } in &scenario {
            if let Some(other) = sensors.iter().find(|set| !allowed.contains(&set.as_str())) {
                let allowed = allowed.join(", ");
                let error = format!("scenario '{name}': sensors '{other}': allowed are {allowed}");
                return Err(at(&error).into());
            }
        }
        Ok(Self { scenario })
    }
}

/// Makes several scenarios of each with `vary = { key = "world.lag_s", values = [..] }`: one for
/// each value, which is put in the place of the key and ends the name.
fn vary(file: &mut toml::Table) -> Result<(), String> {
    let Some(toml::Value::Array(all)) = file.get_mut("scenario") else {
        return Ok(());
    };
    let mut varied = Vec::new();
    for scenario in std::mem::take(all) {
        let toml::Value::Table(mut scenario) = scenario else {
            return Err("a scenario is no table".to_owned());
        };
        let Some(how) = scenario.remove("vary") else {
            varied.push(toml::Value::Table(scenario));
            continue;
        };
        let how: Variation = how.try_into().map_err(|error| format!("vary: {error}"))?;
        for value in how.values {
            let name = scenario.get("name").and_then(toml::Value::as_str);
            let word = value
                .as_str()
                .map_or_else(|| value.to_string(), str::to_owned);
            let name = format!("{}/{word}", name.unwrap_or_default());
            let mut one = scenario.clone();
            one.insert("name".to_owned(), name.into());
            put(&mut one, &how.key, value);
            varied.push(toml::Value::Table(one));
        }
    }
    *all = varied;
    Ok(())
}

/// What differs between scenarios that are written as one.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Variation {
    /// Which setting: names joined by points.
    key: String,
    /// Its values.
    values: Vec<toml::Value>,
}

fn put(table: &mut toml::Table, key: &str, value: toml::Value) {
    match key.split_once('.') {
        None => {
            table.insert(key.to_owned(), value);
        }
        Some((head, rest)) => {
            let below = table
                .entry(head)
                .or_insert_with(|| toml::Table::new().into());
            if let toml::Value::Table(below) = below {
                put(below, rest, value);
            }
        }
    }
}

impl Scenario {
    /// The sets of sensors, and their names.
    pub(super) fn sets(&self) -> impl Iterator<Item = (Sensors, &'static str)> {
        let asked = |name: &str| self.sensors.iter().any(|asked| asked == name);
        ALL_SETS.into_iter().filter(move |(_, name)| asked(name))
    }

    /// Changes of a run: one of `in_turn` in the place of `EACH`.
    pub(super) fn specs(&self, specs: &[String], run: usize) -> Vec<String> {
        let each = self.in_turn.get(run % self.in_turn.len().max(1));
        let put = |spec: &String| match each {
            Some(each) => spec.replace("EACH", each),
            None => spec.clone(),
        };
        specs.iter().map(put).collect()
    }

    fn spread(&self) -> Result<Vec<Self>, String> {
        if let Some(departure) = &self.departure {
            return departure.spread(self);
        }
        if self.each.is_empty() {
            return Ok(vec![self.clone()]);
        }
        let one = |each: &String| {
            let put = |specs: &[String]| -> Vec<String> {
                specs
                    .iter()
                    .map(|spec| spec.replace("EACH", each))
                    .collect()
            };
            let kind = each.split(':').next().unwrap_or(each);
            Self {
                name: format!("{}/{kind}", self.name),
                faults: put(&self.faults),
                context: put(&self.context),
                each: Vec::new(),
                ..self.clone()
            }
        };
        Ok(self.each.iter().map(one).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::field::course::{Range, course};
    use crate::field::fault::{Places, changes, truth};
    use crate::field::ground::stream;
    use crate::simulated::Rover;
    use vigil_diagnosis::Sensors;
    use vigil_evaluation::scoring::field::{Run, Truth, figures};
    use vigil_robot::disturbance_kind::KINDS;

    fn shipped() -> (File, Rover) {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let file = File::read(&here.join("field.toml")).unwrap();
        (file, Rover::read(&here.join("..")).unwrap())
    }

    #[test]
    fn every_scenario_can_be_driven_and_every_bar_has_a_figure() {
        let (file, rover) = shipped();
        let mut run = Run {
            healthy_driven_s: 1.0,
            duration_s: 1.0,
            ..Run::default()
        };
        run.from_2_s.driven_s = 1.0;
        run.from_10_s.driven_s = 1.0;
        let names = figures(&[run]);
        let of_cases = [
            "detected",
            "leaf",
            "side",
            "alarm_cleared",
            "name_cleared",
            "delay",
            "size",
            "ece",
            "log_score",
        ];
        let mut seeds = BTreeSet::new();
        for scenario in file.scenario.iter().filter(|s| s.recorded.is_none()) {
            let rng = &mut stream(scenario.first_seed, 1);
            let range = Range {
                command: &rover.model.command,
                robot: &rover.robot,
                graph: &[],
            };
            course(&scenario.drive, range, scenario.run_s, rng).unwrap();
            let places = Places::draw(&rover.robot, 0, rng);
            for specs in [&scenario.faults, &scenario.context] {
                let specs = scenario.specs(specs, 0);
                changes(&specs, &places, &rover.robot, 0.0).unwrap();
            }
            for bar in &scenario.bars {
                let known = names.iter().any(|figure| figure.name == bar.figure);
                let is_case = of_cases.iter().any(|head| bar.figure.starts_with(head));
                assert!(known || is_case, "{}: {bar}", scenario.name);
            }
            seeds.insert(scenario.first_seed);
        }
        let disturbed = file.scenario.iter();
        let disturbed = disturbed.flat_map(|s| s.faults.iter().chain(&s.in_turn));
        let disturbed: BTreeSet<&str> = disturbed.filter_map(|s| s.split(':').next()).collect();
        assert!(KINDS.iter().all(|row| disturbed.contains(row.name)));
        assert!(seeds.len() > 40);
    }

    #[test]
    fn values_and_places_are_put_in() {
        let text = "[[scenario]]\nname = \"a\"\nabout = \"b\"\nrun_s = 1\nruns = 1\n\
                    first_seed = 1\ndrive = \"random\"\nvary = { key = \"world.lag_s\", \
                    values = [0.1, 0.2] }\neach = [\"tether:10\", \"slope\"]\n\
                    faults = [\"EACH@1\"]\n";
        let path = std::env::temp_dir().join(format!("vigil-field-{}.toml", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let file = File::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let names: Vec<&str> = file.scenario.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(
            names,
            ["a/0.1/tether", "a/0.1/slope", "a/0.2/tether", "a/0.2/slope"]
        );
        assert_eq!(file.scenario[2].world.lag_s, Some(Draw::Always(0.2)));
        assert_eq!(file.scenario[2].faults, ["tether:10@1"]);
    }

    #[test]
    fn a_departure_becomes_a_scenario_of_each_size() {
        let (file, _) = shipped();
        let named = |name: &str| file.scenario.iter().find(|s| s.name == name).unwrap();
        let healthy = named("departure/encoder-gain/0.5");
        assert_eq!(healthy.faults, ["encoder-scale:W1:1.012000@10"]);
        let bars = |s: &Scenario| s.bars.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(bars(healthy), ["detected <= 0"]);
        assert!(named("departure/encoder-gain/1").bars.is_empty());
        let faulty = bars(named("departure/encoder-gain/3"));
        assert_eq!(faulty, ["detected >= 1", "standing_share_10s >= 0.99"]);
    }

    #[test]
    fn truth_follows_what_breaks_and_mends() {
        let (_, rover) = shipped();
        let specs = [
            "stuck:LF@10",
            "encoder:RM:zero@20+5",
            "clear:LF@30",
            "tether:20@40",
        ];
        let specs = specs.map(str::to_owned);
        let places = Places::draw(&rover.robot, 0, &mut stream(1, 1));
        let all = changes(&specs, &places, &rover.robot, 1.0).unwrap();
        let of = |sensors| -> Vec<(f64, Truth)> {
            let found = truth(&all, &rover.tree, &rover.robot, sensors);
            found.into_iter().map(|s| (s.from_s, s.truth)).collect()
        };
        let faults =
            |names: &[&str]| Truth::Faults(names.iter().map(ToString::to_string).collect());
        let unmodelled = Truth::Unmodelled { own: None };
        assert_eq!(
            of(Sensors::PoseEncoders),
            [
                (0.0, Truth::Healthy),
                (11.0, faults(&["LF_STUCK"])),
                (26.0, faults(&["LF_STUCK", "RM_ENC"])),
                (31.0, faults(&["RM_ENC"])),
                (41.0, unmodelled.clone()),
            ]
        );
        assert_eq!(
            of(Sensors::Pose),
            [
                (0.0, Truth::Healthy),
                (11.0, faults(&["LF_STUCK"])),
                (31.0, Truth::Healthy),
                (41.0, unmodelled),
            ]
        );
    }
}

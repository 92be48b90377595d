//! Scenarios as their file states them.

use std::error::Error;
use std::path::Path;

use rand::{Rng, RngExt};
use serde::Deserialize;
use vigil_diagnosis::Sensors;

use super::bar::Bar;
use crate::simulated::ALL_SETS;

/// Sizes over the tolerance that are tried.
const OVER_TOLERANCE: [f64; 8] = [0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0];
/// So much of the tolerance and less is healthy.
const HEALTHY: f64 = 0.5;
/// So much of it and more is a fault. Between, only the curve is reported.
const FAULTY: f64 = 2.0;
/// Bars of healthy sizes.
const HEALTHY_BARS: [&str; 1] = ["detected <= 0"];
/// Bars of faulty sizes.
const FAULTY_BARS: [&str; 2] = ["detected >= 1", "standing_share_10s >= 0.99"];

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

/// Which recorded runs.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// `left-out` (the third of the rover's learn runs that was left out), `grounds` (the rover on
    /// other grounds), `mujoco` (what `examples/mujoco_rover/record.py` has written to
    /// `$VIGIL_DATA/rover`), `kobuki`, `husky`.
    pub log: String,
    /// Only runs on this ground.
    pub ground: Option<String>,
    /// Only runs whose label has this kind (`nominal`, `stuck`, `encoder`).
    pub class: Option<String>,
    /// Of logs that are learned from, too: which half is judged, 0 or 1, by the model of the other.
    pub half: Option<usize>,
}

/// How large a departure is. A scenario of its own is made of each size, which takes the place of
/// `SIZE` in `faults`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Departure {
    /// The largest size that is still healthy, in the unit of the change.
    pub tolerance: f64,
    /// Unit of the tolerance.
    pub unit: String,
    /// What the change's parameter is without a departure: 1 of a factor; default 0.
    #[serde(default)]
    pub base: f64,
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

impl Departure {
    /// A scenario for each size.
    fn spread(&self, scenario: &Scenario) -> Result<Vec<Scenario>, String> {
        let one = |over: f64| {
            let size = format!("{:.6}", self.base + over * self.tolerance);
            let of_size: &[&str] = match over {
                o if o <= HEALTHY => &HEALTHY_BARS,
                o if o >= FAULTY => &FAULTY_BARS,
                _ => &[],
            };
            let of_size = of_size.iter().map(|bar| bar.parse::<Bar>());
            let mut bars = scenario.bars.clone();
            bars.extend(of_size.collect::<Result<Vec<Bar>, String>>()?);
            let faults = scenario.faults.iter();
            Ok(Scenario {
                name: format!("{}/{over}", scenario.name),
                faults: faults.map(|spec| spec.replace("SIZE", &size)).collect(),
                bars,
                ..scenario.clone()
            })
        };
        OVER_TOLERANCE.into_iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests;

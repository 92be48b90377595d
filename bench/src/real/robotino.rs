//! Robotino: learned on single grounds, watched while it runs onto another.

use std::collections::BTreeMap;
use std::error::Error;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use vigil_evaluation::learning_nominal::{self, Report};
use vigil_recording::frames::Run;
use vigil_robot::learned::Form;
use vigil_robot::learned::monitor::Channels;
use vigil_robot::nominal::{Model, Monitor, Observer, Track};

use super::border::{self, Border, Crosser};
use super::seen::{self, Observed, Seen};
use super::{FALSE_ALARM_INTERVAL_H, FAULT_RATE_1_H, Log};

/// Runs held out of each ground.
const HELD_OUT_PER_GROUND: usize = 5;
/// Seed of that choice.
const SEED: u64 = 1;
/// Jump, in deviations, from which a run's change of ground counts.
pub const JUMP_SD: f64 = 2.0;
/// An alarm so close to the change, s, has found it.
pub const WITHIN_S: f64 = 1.0;
/// Mean times between false alarms at which alarms are counted besides, h.
pub const INTERVALS_H: [f64; 4] = [24.0, 4.0, 1.0, 0.25];
/// As the monitor has it: motion before residuals count, and steady commands before those of a
/// pose do, s.
const MOVING_S: f64 = 0.5;
const SETTLED_S: f64 = 1.0;
/// Bounds of a whitened residual and of a residual.
const CLIP: f64 = 6.0;
const GLITCH: f64 = 30.0;
/// Deviation of a bias that the monitor expects.
const BIAS: f64 = 3.0;

/// Borders by folder, and runs over two grounds.
type Watched = (BTreeMap<String, Border>, Vec<Change>);

/// One run over two grounds.
#[derive(Debug, Clone, Serialize)]
pub struct Change {
    /// File.
    pub file: String,
    /// Its change of ground, s.
    pub change_t_s: f64,
    /// Size of the change in the displacement, deviations.
    pub z: f64,
    /// First alarm, s.
    pub alarm_t_s: Option<f64>,
    /// Commanded speed, m/s.
    pub speed_m_s: f64,
    /// First alarm at each of [`INTERVALS_H`], s.
    pub alarms_t_s: [Option<f64>; INTERVALS_H.len()],
    /// When wheels cross the border, s.
    pub crossings_t_s: Vec<f64>,
    /// What could be seen of the change.
    pub seen: Option<Seen>,
}

/// What was measured.
#[derive(Debug, Serialize)]
pub struct Robotino {
    /// What was learned.
    pub learned: Report,
    /// Log-odds of the alarm.
    pub alarm_log_odds: f64,
    /// Runs over two grounds, those with a clear change first.
    pub changes: Vec<Change>,
    /// The border of each folder of runs over two grounds.
    pub borders: BTreeMap<String, Border>,
    /// Difference of means within a second that one in 20 runs on one ground exceeds somewhere.
    pub usual_difference: f64,
    /// The same that all channels together need to alarm within a second.
    pub needed: f64,
    /// Runs on one ground with an alarm at each of [`INTERVALS_H`]: held out, learned from.
    pub at_intervals: [(usize, usize); INTERVALS_H.len()],
    /// Runs held out, and those of them with an alarm.
    pub held_out: (usize, usize),
    /// Runs learned from, and those of them with an alarm.
    pub learned_alarms: (usize, usize),
}

/// Learns on single grounds and watches the others.
///
/// # Errors
/// What is missing or malformed.
pub fn measure() -> Result<Robotino, Box<dyn Error>> {
    let log = super::log("robotino_slip", "robotino")?;
    let ground = |name: &str| -> Option<String> {
        let (_, rest) = name.split_once("one_surface_type/")?;
        Some(rest.split('/').next()?.to_owned())
    };
    let mut grounds = BTreeMap::<String, Vec<u32>>::new();
    for (run, name) in log.runs.iter().zip(&log.names) {
        if let Some(ground) = ground(name) {
            grounds.entry(ground).or_default().push(run.id);
        }
    }
    let mut rng = Pcg64Mcg::seed_from_u64(SEED);
    let mut held_out = Vec::new();
    for ids in grounds.values_mut() {
        ids.shuffle(&mut rng);
        held_out.extend(ids.iter().take(HELD_OUT_PER_GROUND));
    }
    let single: Vec<Run> = log
        .runs
        .iter()
        .zip(&log.names)
        .filter(|(_, name)| ground(name).is_some())
        .map(|(run, _)| run.clone())
        .collect();
    let (model, learned) = learning_nominal::learn(&single, &held_out, f64::INFINITY, &log.robot)?;
    let calibration = model.calibration(Channels::PoseEncoders, Form::LearnedBias)?;
    let alarm = calibration.alarm_log_odds(FALSE_ALARM_INTERVAL_H, FAULT_RATE_1_H);
    let count = |is_held_out: bool| {
        let runs = single
            .iter()
            .filter(|run| held_out.contains(&run.id) == is_held_out);
        let alarms = runs.map(|run| first_alarm(&model, &log, run, alarm));
        let alarms: Vec<bool> = alarms.map(|t| t.is_some()).collect();
        (alarms.len(), alarms.iter().filter(|&&alarm| alarm).count())
    };
    let mut at_each = [(0, 0); INTERVALS_H.len()];
    for run in &single {
        let is_held_out = held_out.contains(&run.id);
        for (count, alarm) in at_each.iter_mut().zip(at_intervals(&model, &log, run)) {
            count.0 += usize::from(is_held_out && alarm.is_some());
            count.1 += usize::from(!is_held_out && alarm.is_some());
        }
    }
    let (borders, changes) = changes(&model, &log, alarm)?;
    Ok(Robotino {
        borders,
        at_intervals: at_each,
        usual_difference: usual_difference(&model, &log, &single),
        needed: needed(&model, alarm),
        held_out: count(true),
        learned_alarms: count(false),
        changes,
        alarm_log_odds: alarm,
        learned,
    })
}

/// The runs of `derived_change_points.csv`, watched, and the borders that they cross.
fn changes(model: &Model, log: &Log, alarm: f64) -> Result<Watched, Box<dyn Error>> {
    let text = std::fs::read_to_string(log.folder.join("derived_change_points.csv"))?;
    let mut out = Vec::new();
    let mut folders = BTreeMap::<String, Vec<(usize, Crosser)>>::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [file, speed, change, .., z] = cells.as_slice() else {
            return Err(format!("derived_change_points.csv: '{line}' has too few cells").into());
        };
        let mut runs = log.runs.iter().zip(&log.names);
        let run = runs.find(|(_, name)| name.ends_with(*file));
        let (run, _) = run.ok_or_else(|| format!("there is no run {file}"))?;
        let observed = observed(model, log, run);
        let residuals = observed.iter().map(|o| (o.t_s, o.residuals.clone()));
        let crosser = Crosser::new(run, &log.robot, &residuals.collect::<Vec<_>>());
        let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
        let inside = folders.entry(folder.to_owned()).or_default();
        inside.push((out.len(), crosser));
        let change_t_s = change.parse()?;
        out.push(Change {
            file: (*file).to_owned(),
            change_t_s,
            z: z.parse()?,
            alarm_t_s: first_alarm(model, log, run, alarm),
            speed_m_s: speed.parse()?,
            alarms_t_s: at_intervals(model, log, run),
            crossings_t_s: Vec::new(),
            seen: seen::seen(&observed, change_t_s),
        });
    }
    let mut borders = BTreeMap::new();
    for (folder, runs) in folders {
        let (places, runs): (Vec<usize>, Vec<Crosser>) = runs.into_iter().unzip();
        let border = border::fit(&runs).ok_or("no runs over two grounds")?;
        for (at, run) in places.into_iter().zip(&runs) {
            let crossings = run.crossings(border.line);
            out[at].crossings_t_s = crossings.into_iter().map(|(t_s, _)| t_s).collect();
        }
        borders.insert(folder, border);
    }
    out.sort_by(|a, b| b.z.abs().total_cmp(&a.z.abs()));
    Ok((borders, out))
}

/// First alarms of a run at each of [`INTERVALS_H`].
fn at_intervals(model: &Model, log: &Log, run: &Run) -> [Option<f64>; INTERVALS_H.len()] {
    let found = model.calibration(Channels::PoseEncoders, Form::LearnedBias);
    INTERVALS_H.map(|interval_h| {
        let alarm = found.as_ref().ok()?;
        let alarm = alarm.alarm_log_odds(interval_h, FAULT_RATE_1_H);
        first_alarm(model, log, run, alarm)
    })
}

/// Residuals of a run, from where the monitor has settled on.
fn observed(model: &Model, log: &Log, run: &Run) -> Vec<Observed> {
    let mut observer = Observer::new(&log.robot);
    let mut tracks: Vec<Track> = model.channel.iter().map(Track::new).collect();
    let mut out = Vec::new();
    for frame in &run.frames {
        if !observer.push(frame).complete {
            continue;
        }
        let history = observer.history();
        let Some(now) = history.ago(0).filter(|now| now.moving_s >= MOVING_S) else {
            continue;
        };
        let (mut residuals, mut whitened) = (Vec::new(), Vec::new());
        for (channel, track) in model.channel.iter().zip(&mut tracks) {
            let settled = now.steady_s >= SETTLED_S || !channel.target.quantity.is_pose();
            let residual = channel.residual(history, &model.sizes());
            let Some(residual) = residual.filter(|_| settled) else {
                track.interrupt();
                continue;
            };
            let (apart, spread) = track.step(channel, residual.apart, residual.variance, false);
            whitened.push((apart / spread.sqrt()).clamp(-CLIP, CLIP));
            residuals.push((residual.apart / residual.variance.sqrt()).clamp(-GLITCH, GLITCH));
        }
        if whitened.len() == model.channel.len() {
            out.push(Observed {
                t_s: now.t_ns as f64 * 1e-9,
                residuals,
                whitened,
            });
        }
    }
    out
}

/// Largest difference of means within a second that one in 20 runs on one ground exceeds.
fn usual_difference(model: &Model, log: &Log, single: &[Run]) -> f64 {
    let highest = |run: &Run| {
        let found = seen::differences(&observed(model, log, run));
        found.iter().map(|(_, d)| *d).fold(0.0, f64::max)
    };
    let mut all: Vec<f64> = single.iter().map(highest).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() * 19 / 20).copied().unwrap_or(0.0)
}

/// Squares of the sum of whitened residuals over their number, after a second, at which all
/// channels together alarm: the marginal likelihood ratio of one onset, solved for it.
fn needed(model: &Model, alarm: f64) -> f64 {
    let Some(tail) = model.joint(Channels::PoseEncoders, Form::LearnedBias) else {
        return f64::INFINITY;
    };
    let raw = tail.level_log_odds + (alarm - tail.interval_h.ln()) / tail.slope;
    let channels = model.channel.len() as f64;
    let observations = seen::FIRST_S / model.interval_s;
    let birth = FAULT_RATE_1_H / 3600.0 * model.interval_s / channels;
    let spread = 1.0 + observations * BIAS * BIAS / channels;
    let log_ratio = raw - birth.ln() + 0.5 * channels * spread.ln();
    2.0 * log_ratio * spread / (spread - 1.0)
}

fn first_alarm(model: &Model, log: &Log, run: &Run, alarm: f64) -> Option<f64> {
    let mut monitor = Monitor::new(
        model,
        Channels::PoseEncoders,
        Form::LearnedBias,
        FAULT_RATE_1_H,
    );
    let mut observer = Observer::new(&log.robot);
    for frame in &run.frames {
        if !observer.push(frame).complete {
            continue;
        }
        monitor.step(observer.history(), false);
        if !monitor.is_ready() {
            monitor.forget_evidence();
        } else if monitor.report().log_odds > alarm {
            return Some(frame.header.t_capture_ns as f64 * 1e-9);
        }
    }
    None
}

impl Robotino {
    /// The summary.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let clear: Vec<&Change> = self
            .changes
            .iter()
            .filter(|c| c.z.abs() > JUMP_SD)
            .collect();
        let late = |c: &&&Change| c.alarm_t_s.map(|t| t - c.change_t_s);
        let count = |low: f64, high: f64| {
            clear
                .iter()
                .filter(|c| late(c).is_some_and(|l| l >= low && l <= high))
                .count()
        };
        let unclear = self.changes.iter().filter(|c| c.z.abs() <= JUMP_SD);
        let (others, alarmed) = unclear.fold((0, 0), |(n, a), c| {
            (n + 1, a + usize::from(c.alarm_t_s.is_some()))
        });
        let mut delays: Vec<f64> = clear.iter().filter_map(|c| late(&c)).collect();
        delays.sort_by(f64::total_cmp);
        let never = clear.len() - delays.len();
        vec![
            "\n## Robotino: learned on single grounds\n".to_owned(),
            self.learned.to_string(),
            format!(
                "alarm at log-odds {:.1} ({FALSE_ALARM_INTERVAL_H} h between false alarms)\n",
                self.alarm_log_odds
            ),
            format!(
                "single ground, held out: {} of {} alarm; learned from: {} of {}",
                self.held_out.1, self.held_out.0, self.learned_alarms.1, self.learned_alarms.0
            ),
            format!(
                "two grounds, jump above {JUMP_SD} sd: {} runs; first alarm within \
                 {WITHIN_S} s of the change: {}; \
                earlier: {}; later: {}; never: {never}; in all by {WITHIN_S} s after it: {}",
                clear.len(),
                count(-WITHIN_S, WITHIN_S),
                count(f64::NEG_INFINITY, -WITHIN_S - 1e-9),
                count(WITHIN_S + 1e-9, f64::INFINITY),
                count(f64::NEG_INFINITY, WITHIN_S)
            ),
            format!(
                "alarm less change, s: {:?}",
                delays
                    .iter()
                    .map(|d| (d * 100.0).round() / 100.0)
                    .collect::<Vec<_>>()
            ),
            format!("two grounds, no clear jump (not scored): {others} runs, {alarmed} alarm"),
        ]
    }
}

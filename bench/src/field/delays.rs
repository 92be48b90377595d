//! Scenarios with the detector alone, in several of its forms: how late, and how often wrongly.

use std::error::Error;

use vigil_blocks::{DetectionBelief, Entry, ParticleBlock, SensorFrame};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect::{Detector, Form};
use vigil_evaluation::scoring::field::Truth;
use vigil_sensor_sim::{EffectiveCommand, World};

use super::fault;
use super::frames::Fate;
use super::job::Job;
use super::run::{Conditions, Graph};

/// A fault that is not seen for so long is missed, s.
pub const MISSED_S: f64 = 60.0;
/// Longest healthy run, s.
const HEALTHY_S: f64 = 300.0;

/// What one detector did in a run.
#[derive(Debug, Clone, Copy)]
pub struct Detected {
    /// Name of its sensors.
    pub sensors: &'static str,
    /// Its form.
    pub form: Form,
    /// How long the run was healthy, s.
    pub healthy_s: f64,
    /// Alarms in that time.
    pub false_alarms: u32,
    /// From the first fault to the first alarm after it, s: infinite without one. None in a run
    /// without a fault that its sensors can show.
    pub delay_s: Option<f64>,
}

/// A detector at work.
struct Watcher {
    detector: Detector,
    belief: DetectionBelief,
    hypotheses: Box<ParticleBlock>,
    onset_s: Option<f64>,
    alarms: u32,
    found: Detected,
}

impl Watcher {
    fn take(&mut self, t_s: f64, entry: Entry<&SensorFrame>) {
        self.detector
            .step(entry, &mut self.belief, &mut self.hypotheses);
        let risen = self.belief.alarm_count > self.alarms;
        self.alarms = self.belief.alarm_count;
        match self.onset_s.filter(|onset_s| t_s >= *onset_s) {
            None => {
                self.found.healthy_s = t_s;
                self.found.false_alarms += u32::from(risen);
            }
            Some(onset_s) if risen => {
                let delay_s = self.found.delay_s.get_or_insert(f64::INFINITY);
                *delay_s = delay_s.min(t_s - onset_s);
            }
            Some(_) => {}
        }
    }

    fn deliver(&mut self, t_s: f64, frame: &SensorFrame, fate: Fate, held: Option<&SensorFrame>) {
        match fate {
            Fate::Lost | Fate::Overtaken => self.take(t_s, Entry::Missed(1)),
            Fate::Late => {
                self.take(t_s, Entry::Missed(1));
                self.take(t_s, Entry::Frame(frame));
            }
            Fate::Comes | Fate::Doubled => self.take(t_s, Entry::Frame(frame)),
        }
        if let Some(held) = held {
            self.take(t_s, Entry::Frame(held));
        }
        if fate == Fate::Doubled {
            self.take(t_s, Entry::Frame(frame));
        }
    }
}

/// Drives a simulated run with each set of sensors of its scenario and each form. It ends
/// [`MISSED_S`] after its first fault.
///
/// # Errors
/// A scenario that cannot be driven, with its name.
pub fn detect(graph: &Graph, job: &Job<'_>, forms: &[Form]) -> Result<Vec<Detected>, String> {
    let named = |error: String| format!("{}: {error}", job.scenario.name);
    let conditions = Conditions::draw(graph, job).map_err(named)?;
    let found = drive(graph, job, &conditions, forms);
    found.map_err(|error| named(error.to_string()))
}

fn watchers(
    graph: &Graph,
    job: &Job<'_>,
    conditions: &Conditions,
    forms: &[Form],
) -> Result<Vec<Watcher>, Box<dyn Error>> {
    let mut watchers = Vec::new();
    for (sensors, name) in job.scenario.sets() {
        // Gyro and currents have no declared null.
        if sensors == Sensors::All {
            continue;
        }
        let mut setup = graph.setup(sensors).0.clone();
        let truth = fault::truth(&conditions.faults, &setup.tree, &setup.robot, sensors);
        let mut wrong = truth.iter().filter(|it| it.truth != Truth::Healthy);
        let onset_s = wrong.next().map(|stretch| stretch.from_s);
        setup.file.graph.rate_hz = conditions.rate_hz;
        setup.file.detector.sensors = sensors;
        for &form in forms {
            setup.file.detector.form = form;
            watchers.push(Watcher {
                detector: vigil_detector::assemble(&setup)?,
                belief: DetectionBelief::default(),
                hypotheses: Box::default(),
                onset_s,
                alarms: 0,
                found: Detected {
                    sensors: name,
                    form,
                    healthy_s: 0.0,
                    false_alarms: 0,
                    delay_s: onset_s.map(|_| f64::INFINITY),
                },
            });
        }
    }
    Ok(watchers)
}

fn drive(
    graph: &Graph,
    job: &Job<'_>,
    conditions: &Conditions,
    forms: &[Form],
) -> Result<Vec<Detected>, Box<dyn Error>> {
    let mut watchers = watchers(graph, job, conditions, forms)?;
    let onsets = watchers.iter().filter_map(|watcher| watcher.onset_s);
    let last_s = onsets.fold(f64::NEG_INFINITY, f64::max);
    let until_s = match last_s.is_finite() {
        true => last_s + MISSED_S,
        false => HEALTHY_S,
    };
    let Conditions { rate_hz, seed, .. } = *conditions;
    let robot = &graph.setup(Sensors::PoseEncoders).0.robot;
    let (simulator, segments) = (&conditions.simulator, &conditions.drive);
    let mut world = World::new(robot, simulator, segments, rate_hz, seed)?;
    let (mut ground, mut way) = (conditions.ground.clone(), conditions.way.clone());
    ground.begin(&mut world)?;
    let mut pending = conditions.changes.iter().peekable();
    let mut held: Option<SensorFrame> = None;
    let (mut frame, mut t_s) = (SensorFrame::default(), 0.0);
    let steps = job.scenario.run_s.min(until_s) * rate_hz;
    for k in 0..steps.round() as u64 {
        while let Some(injection) = pending.next_if(|change| change.at_s <= t_s) {
            world.change(injection.change)?;
        }
        let (planned, before) = (world.planned(), world.true_state().pose);
        let dt_s = way.instant_s(t_s, (k + 1) as f64 / rate_hz) - t_s;
        world.step(dt_s, EffectiveCommand::as_planned(planned));
        t_s += dt_s;
        world.measure(&mut frame);
        let pose = world.true_state().pose;
        ground.advance((pose[0] - before[0]).hypot(pose[1] - before[1]), &mut world)?;
        way.blur(&mut frame, pose, dt_s);
        frame.header.epoch = 1;
        frame.header.seq = k;
        frame.header.t_capture_ns = (1e9 * way.stamp_s(t_s)).round() as u64;
        let fate = way.fate(t_s);
        for watcher in &mut watchers {
            watcher.deliver(t_s, &frame, fate, held.as_ref());
        }
        held = (fate == Fate::Overtaken).then_some(frame);
    }
    Ok(watchers.into_iter().map(|watcher| watcher.found).collect())
}

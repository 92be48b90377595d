//! Scenarios with the detector alone, in several of its forms: how late, and how often wrongly.

use std::error::Error;

use vigil_blocks::{DetectionBelief, Entry, ParticleBlock, SensorFrame};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::detect::{Detector, Form};
use vigil_evaluation::scoring::field::Truth;
use vigil_sensor_sim::EffectiveCommand;

use super::fault;
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
    /// Takes what arrived in place of the frame of `t_s`; none for one that is missed.
    fn take(&mut self, t_s: f64, frame: Option<&SensorFrame>) {
        let entry = frame.map_or(Entry::Missed(1), Entry::Frame);
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
    let robot = &graph.setup(Sensors::PoseEncoders).0.robot;
    let mut passage = conditions.begin(robot)?;
    let steps = job.scenario.run_s.min(until_s) * conditions.rate_hz;
    for _ in 0..steps.round() as u64 {
        passage.advance(EffectiveCommand::as_planned)?;
        for watcher in &mut watchers {
            passage.deliver(&mut |frame| watcher.take(passage.t_s, frame));
        }
    }
    Ok(watchers.into_iter().map(|watcher| watcher.found).collect())
}

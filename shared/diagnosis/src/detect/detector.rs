//! The detector's step: frames to observations, log-odds of a fault, alarm, report.

use vigil_blocks::{
    DetectionBelief, Entry, HealthyBelief, MODE_UNKNOWN, ParticleBlock, Readiness, SensorFrame,
    Symptoms, WeightedHypothesis,
};
use vigil_checkpoint::Checkpoint;
use vigil_inference::ending::Ending;
use vigil_inference::logspace::{log_add, log_sum_exp, probability};
use vigil_robot::channel_model;
use vigil_robot::declared::{self, Promise, UndeclaredError};
use vigil_robot::learned::channels::Channels;
use vigil_robot::learned::{Form, Model, ModelError, Monitor, NoiseScales, Observer};
use vigil_robot::publisher_check::Finding;
use vigil_robot::slot::{SLOTS, Slot};
use vigil_robot::{Alarm, AlarmError, ChannelMap, Description};

use crate::detect::blindness::BlindnessTimer;
use crate::detect::detection_filter::{DetectionFilter, Interval};
use crate::detect::monitors::Monitors;
use crate::detect::publisher::Publisher;
use crate::detect::settings::{MonitorSettings, Settings};
use crate::invariants;
use crate::sensors::Sensors;

/// Without monitors, pose log-odds beyond which the detector reports an error in position: even
/// odds, as the planner weighs the symptom by its own model.
const SYMPTOM_LOG_ODDS: f64 = 0.0;
/// Log-odds of channels that the robot does not have: those of the filters without any evidence.
const NO_EVIDENCE: f64 = -700.0;

/// Why a detector was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DetectorError {
    /// The model does not fit.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// There is no threshold for the alarm, or it could never rise.
    #[error("detector: {0}")]
    Alarm(#[from] AlarmError),
    /// Nothing is declared of the robot that its form needs.
    #[error("detector: {0}")]
    Undeclared(#[from] UndeclaredError),
}

/// The detection filter at frame rate.
///
/// A step that completes an observation (about every learned interval, 50 ms) updates the belief;
/// the steps between repeat it. Equal entries give bit-identical beliefs.
#[derive(Debug, Clone, Checkpoint)]
pub struct Detector {
    filter: DetectionFilter,
    fault_rate_1_s: f64,
    alarm: Alarm,
    #[checkpoint(fixed)]
    map: ChannelMap,
    /// While an alarm stands: of each channel, whether its fault is still there.
    endings: [Ending; SLOTS],
    /// Log-odds of a fault now.
    log_odds: f64,
    armed: bool,
    /// Whether the last observation was of a robot in motion.
    moving: bool,
    blindness: BlindnessTimer,
    /// With a live publisher.
    #[checkpoint(each)]
    publisher: Option<Publisher>,
    period_s: f64,
    t_last_ns: u64,
    run_id: u64,
    alarm_t_ns: u64,
    alarm_count: u32,
    invalid_count: u32,
    symptoms: u32,
    external: u32,
    /// In a graph with a planned path: symptoms come from these, not from the pose's log-odds.
    #[checkpoint(each)]
    monitors: Option<Monitors>,
    /// Last action that the robot carried out, and its outcome, as the last frame says.
    action_seq: u64,
    action_outcome: u32,
}

impl Detector {
    /// A detector for `model` and its robot. The alarm threshold follows from the model's
    /// calibration and `settings.false_alarm_interval_h`.
    ///
    /// # Errors
    /// [`DetectorError`] if the model is of another robot, or has no calibration for channels and
    /// form, or the form needs what nobody has declared.
    pub fn new(
        model: &Model,
        robot: &Description,
        settings: &Settings,
    ) -> Result<Self, DetectorError> {
        model.check_robot(robot)?;
        let (rate, interval_h) = (settings.fault_rate_1_h, settings.false_alarm_interval_h);
        let channels = settings.sensors.into();
        let observer = Box::new(match channels {
            Channels::All => Observer::new(model, robot).with_further(),
            _ => Observer::new(model, robot),
        });
        let monitor = |form| Box::new(Monitor::new(model, robot, channels, form, rate));
        let (alarm_log_odds, filter) = if let Some(form) = settings.form.calibrated() {
            let alarm_log_odds = model.alarm_log_odds((channels, form), interval_h, rate)?;
            let monitor = monitor(form);
            (
                alarm_log_odds,
                DetectionFilter::Faults { observer, monitor },
            )
        } else {
            let promise = Promise {
                interval_h,
                fault_rate_1_h: rate,
            };
            let null = (&settings.null).into();
            let declared = declared::Monitor::new(model, robot, channels, null, promise)?;
            let filter = DetectionFilter::Declared {
                observer,
                tracking: monitor(Form::default()),
                monitor: Box::new(declared),
            };
            (promise.alarm_log_odds(), filter)
        };
        let interval_s = model.interval_s;
        Ok(Self::with_filter(
            interval_s,
            robot,
            alarm_log_odds,
            settings,
            filter,
        ))
    }

    /// A detector by a model of channels.
    ///
    /// # Errors
    /// As [`Detector::new`].
    pub fn of_channels(
        model: &channel_model::Model,
        robot: &Description,
        settings: &Settings,
    ) -> Result<Self, DetectorError> {
        model.check_robot(robot)?;
        let form = settings.form.calibrated();
        let form = form.ok_or_else(|| UndeclaredError::Model {
            robot: robot.name.clone(),
        })?;
        let channels = settings.sensors.into();
        let (rate, interval_h) = (settings.fault_rate_1_h, settings.false_alarm_interval_h);
        let alarm_log_odds = model.alarm_log_odds((channels, form), interval_h, rate)?;
        let monitor = channel_model::Monitor::new(model, robot, channels, rate);
        let monitor = monitor.ok_or_else(|| ModelError::Value {
            key: "direction".to_owned(),
            value: format!("{} directions", model.direction.len()),
            allowed: "those of a covariance of the channels in use".to_owned(),
        })?;
        let filter = DetectionFilter::Channels {
            observer: Box::new(channel_model::Observer::new(robot)),
            monitor: Box::new(monitor),
        };
        let interval_s = model.interval_s;
        Ok(Self::with_filter(
            interval_s,
            robot,
            alarm_log_odds,
            settings,
            filter,
        ))
    }

    fn with_filter(
        interval_s: f64,
        robot: &Description,
        alarm_log_odds: f64,
        settings: &Settings,
        filter: DetectionFilter,
    ) -> Self {
        Self {
            log_odds: filter.report().log_odds,
            filter,
            fault_rate_1_s: settings.fault_rate_1_h / 3600.0,
            alarm: Alarm::new(alarm_log_odds),
            endings: [Ending::new(robot.fault_prior.again_1_s, robot.fault_prior.mended_1_s);
                SLOTS],
            map: ChannelMap::new(robot),
            armed: false,
            moving: false,
            blindness: blindness_timer(robot, settings),
            publisher: None,
            period_s: interval_s,
            t_last_ns: 0,
            run_id: 0,
            alarm_t_ns: 0,
            alarm_count: 0,
            invalid_count: 0,
            symptoms: 0,
            external: 0,
            monitors: None,
            action_seq: 0,
            action_outcome: 0,
        }
    }

    /// The same detector with monitors of the pose against the planned pose, whose symptoms take
    /// the place of its own; with `None`, as it was.
    #[must_use]
    pub fn with_monitors(mut self, settings: Option<&MonitorSettings>) -> Self {
        self.monitors = settings.map(|settings| Monitors::new(settings, self.map));
        self
    }

    /// The same detector in a graph of this period, s: blindness counts by the graph's time, see
    /// [`BlindnessTimer::in_graph`]. A publisher that is `live`, not a recording, is tested too.
    #[must_use]
    pub fn in_graph(mut self, robot: &Description, period_s: f64, live: bool) -> Self {
        self.blindness = self.blindness.in_graph(period_s, live);
        self.publisher = live.then(|| Publisher::new(robot, period_s));
        self
    }

    /// Findings about the publisher since the last call.
    #[must_use]
    pub fn findings(&mut self) -> [Option<Finding>; 2] {
        self.publisher
            .as_mut()
            .map_or([None; 2], Publisher::take_findings)
    }

    /// Counts a frame that the border refused: it changes no belief.
    pub const fn refuse(&mut self) {
        self.blindness.refuse();
    }

    /// True with monitors of the planned pose.
    #[must_use]
    pub const fn is_monitoring(&self) -> bool {
        self.monitors.is_some()
    }

    /// Log-odds at which the alarm rises.
    #[must_use]
    pub const fn alarm_log_odds(&self) -> f64 {
        self.alarm.threshold_log_odds()
    }

    /// True once an alarm can rise: evidence from before the track has settled and the noise is
    /// known is no evidence.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// Takes one entry of the journal and fills the belief and the hypotheses (headers and causes
    /// are the caller's).
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(
        &mut self,
        entry: Entry<&SensorFrame>,
        belief: &mut DetectionBelief,
        hypotheses: &mut ParticleBlock,
    ) {
        let (mut missed, alarms_before) = (0, self.alarm_count);
        match entry {
            Entry::Frame(frame) => {
                self.blindness.take(frame);
                if let Some(publisher) = &mut self.publisher {
                    publisher.take(frame);
                    self.blindness.doubt(publisher.is_blinding());
                }
                self.take(frame);
            }
            Entry::Missed(count) => {
                self.blindness.miss(count);
                if let Some(publisher) = &mut self.publisher {
                    publisher.miss(count);
                }
                missed = count;
            }
            // Its cost is that of one track: there is nothing to shed.
            Entry::Budget(_) => {}
            Entry::Reset => {
                self.filter.reset_observer();
                self.begin_run();
            }
        }
        self.report(missed, belief);
        self.publish(belief.log_odds, hypotheses);
        invariants::probability(belief.p_fault);
        invariants::finite_log_odds(belief.log_odds, &belief.channel_log_odds);
        invariants::alarm_onset(belief.alarm != 0, belief.alarm_t_capture_ns);
        invariants::alarm_count(alarms_before, belief.alarm_count);
        let used = hypotheses.used().iter();
        invariants::sums_to_one(used.map(|hypothesis| hypothesis.log_weight.exp()));
    }

    fn begin_run(&mut self) {
        self.filter.reset();
        (self.armed, self.moving) = (false, false);
        self.alarm.reset();
        self.log_odds = self.filter.report().log_odds;
        (self.alarm_t_ns, self.symptoms) = (0, 0);
        if let Some(monitors) = &mut self.monitors {
            monitors.reset();
        }
    }

    fn take(&mut self, frame: &SensorFrame) {
        let intake = self.filter.push(frame);
        self.external = frame.symptoms & Symptoms::ALL;
        self.invalid_count = self.invalid_count.saturating_add(u32::from(intake.invalid));
        if intake.new_run {
            self.begin_run();
        }
        if frame.header.t_capture_ns > self.t_last_ns && !intake.new_run {
            let period_s = (frame.header.t_capture_ns - self.t_last_ns) as f64 * 1e-9;
            self.period_s = period_s.min(1.0);
        }
        self.t_last_ns = frame.header.t_capture_ns;
        self.run_id = frame.run_id;
        (self.action_seq, self.action_outcome) = (frame.action_seq, frame.action_outcome);
        if intake.complete {
            self.observe();
        }
        if let Some(monitors) = &mut self.monitors {
            monitors.observe(frame);
            self.symptoms = monitors.symptoms();
        }
    }

    fn observe(&mut self) {
        let observation = self.filter.step(self.alarm.stands());
        let moving = observation.moving;
        self.moving = moving;
        if !self.armed {
            // Evidence from before the noise scale is known is no evidence.
            self.armed = self.filter.is_ready();
            self.filter.forget_evidence();
        }
        self.weigh_end(&observation);
        let stood = self.alarm.stands();
        // Clearing needs evidence: time at rest does not count.
        if self.armed && self.alarm.take(self.log_odds, observation.dt_s, moving) {
            invariants::onset(observation.t_ns, self.t_last_ns);
            self.alarm_t_ns = observation.t_ns.max(1);
            self.alarm_count = self.alarm_count.saturating_add(1);
            self.endings.iter_mut().for_each(Ending::begin);
        } else if !self.alarm.stands() {
            self.alarm_t_ns = 0;
        }
        if stood && !self.alarm.stands() {
            // What spoke for the fault that has ended does not speak for the next one.
            self.filter.forget_evidence();
            self.log_odds = self.filter.report().log_odds;
        }
        let off_course = self.filter.report().channels[Slot::POSE] > SYMPTOM_LOG_ODDS;
        self.symptoms = if !off_course {
            0
        } else if moving {
            Symptoms::EPM
        } else {
            Symptoms::EPS
        };
    }

    /// Log-odds of a fault now: while an alarm stands, in no channel more than those that its fault
    /// has not ended there.
    fn weigh_end(&mut self, observation: &Interval) {
        let report = self.filter.report();
        if !self.alarm.stands() || self.filter.is_windowed() && observation.moving {
            self.log_odds = report.log_odds;
            return;
        }
        // At rest no fault ends, and none becomes more certain.
        if !observation.moving {
            return;
        }
        let (mut channels, gains) = (report.channels, report.gains);
        let endings = self.endings.iter_mut().zip(gains);
        for (log_odds, (ending, gain)) in channels.iter_mut().zip(endings) {
            ending.step(gain, observation.dt_s);
            *log_odds = log_odds.min(ending.log_odds());
        }
        self.log_odds = log_sum_exp(&channels);
    }

    fn report(&self, missed: u32, belief: &mut DetectionBelief) {
        let report = self.filter.report();
        let p_now = probability(self.log_odds);
        // The state stays at the last frame; what is published is its prediction.
        let appears = self.fault_rate_1_s * self.period_s * f64::from(missed);
        let p_fault = p_now + (1.0 - p_now) * (1.0 - (-appears).exp());
        let odds = (p_fault / (1.0 - p_fault)).ln();
        belief.run_id = self.run_id;
        belief.p_fault = p_fault;
        belief.log_odds = if missed > 0 && odds.is_finite() {
            odds
        } else {
            self.log_odds
        };
        belief.alarm_log_odds = self.alarm_log_odds();
        belief.evidence = if report.evidence.is_finite() {
            report.evidence
        } else {
            0.0
        };
        let NoiseScales {
            pose,
            wheels,
            steer,
            outliers,
        } = self.filter.scales();
        belief.noise_scale = pose;
        belief.noise_scale_wheels = wheels;
        belief.noise_scale_steer = steer;
        belief.outlier_rate = outliers.pose;
        belief.outlier_rate_wheels = outliers.wheels;
        belief.outlier_rate_steer = outliers.steer;
        belief.channel_log_odds = self.map.to_evidence(&report.channels, NO_EVIDENCE);
        belief.alarm_t_capture_ns = self.alarm_t_ns;
        belief.alarm = u32::from(self.alarm.stands());
        belief.alarm_count = self.alarm_count;
        belief.symptoms = self.symptoms | self.external;
        (belief.action_seq, belief.action_outcome) = (self.action_seq, self.action_outcome);
        belief.invalid_count = self.invalid_count;
        belief.blind = self.blindness.blind().map_or(0, |cause| cause as u32);
        belief.readiness = match (self.armed, self.moving) {
            (false, _) => Readiness::Arming,
            (true, true) => Readiness::Armed,
            (true, false) => Readiness::NotExcited,
        } as u32;
        belief.degenerate_count = report.degenerate_count;
        let changes = self.filter.changes();
        if let Some((changes, last)) = changes.and_then(|all| Some((all, all.last()?))) {
            belief.context_count = changes.count();
            belief.context = last.context as u32;
            belief.context_t_capture_ns = last.t_ns;
        }
    }

    /// Nominal or unknown, at these odds; where a pose is tracked, it is the healthy robot's.
    fn publish(&self, log_odds: f64, block: &mut ParticleBlock) {
        let healthy = self.filter.healthy();
        block.healthy = healthy.map_or_else(HealthyBelief::default, |it| it.to_block());
        let nominal = WeightedHypothesis {
            pose: block.healthy.pose,
            pose_covariance: block.healthy.pose_covariance,
            log_weight: -log_add(0.0, log_odds),
            ..WeightedHypothesis::default()
        };
        let unknown = WeightedHypothesis {
            onset_t_capture_ns: self.alarm_t_ns,
            log_weight: -log_add(0.0, -log_odds),
            mode: MODE_UNKNOWN,
            ..nominal
        };
        block.hypotheses[..2].copy_from_slice(&[nominal, unknown]);
        block.count = 2;
    }
}

/// What frames of `robot` must carry for these settings.
fn blindness_timer(robot: &Description, settings: &Settings) -> BlindnessTimer {
    let map = ChannelMap::new(robot);
    let channels = match settings.sensors {
        Sensors::Pose => map.pose_bits(),
        Sensors::PoseEncoders | Sensors::All => map.channel_bits(),
    };
    BlindnessTimer::new(channels, map.command_bits())
}

#[cfg(test)]
mod tests;

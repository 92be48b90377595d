//! The detector's `step`: guard, observe, monitor, alarm, report.

use vigil_blocks::{
    Channel, DetectionBelief, Entry, PARTICLE_CAPACITY, ParticleBlock, SensorFrame, Symptoms,
};
use vigil_inference::logspace::probability;
use vigil_inference::particles::PoseParticles;
use vigil_robot::Description;
use vigil_robot::learned::monitor::Channels;
use vigil_robot::learned::{Calibration, Form, Model, ModelError, Monitor, NoiseScales, Observer};
use vigil_robot::nominal;
use vigil_setup::schema;

use crate::watch::{Observed, Watch};

/// An alarm falls when the log-odds have stayed this far below those that raise it ..
const CLEAR_BELOW: f64 = 8.0;
/// .. and below these odds, whatever the threshold ..
const CLEAR_LOG_ODDS: f64 = -4.0;
/// .. for this long, moving, s.
const CLEAR_S: f64 = 1.0;
/// Pose log-odds beyond which the detector reports an error in position.
const SYMPTOM_LOG_ODDS: f64 = 0.0;

/// Why a detector was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DetectorError {
    /// The model does not fit.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Too few or too many particles.
    #[error("detector.particles: {0} is not allowed: 1 to {PARTICLE_CAPACITY}")]
    Particles(usize),
    /// A rate or an interval is not positive and finite.
    #[error("detector.{key}: {value} is not allowed: a positive finite number")]
    Value {
        /// The key.
        key: &'static str,
        /// What was found.
        value: f64,
    },
    /// The calibrated threshold lies above what the form's log-odds can reach.
    #[error(
        "detector.form: '{form}' cannot reach the alarm at log-odds {alarm_log_odds:.1} that \
         false_alarm_interval_h and fault_rate_1_h ask for: lower one of them, or take learned-bias"
    )]
    Unreachable {
        /// Name of the form.
        form: &'static str,
        /// The threshold.
        alarm_log_odds: f64,
    },
}

/// The detection filter at frame rate.
///
/// A step that completes an observation (about every learned interval, 50 ms) updates the belief;
/// the steps between repeat it. Equal entries and seeds give bit-identical beliefs.
#[derive(Debug, Clone)]
pub struct Detector {
    watch: Watch,
    fault_rate_1_s: f64,
    alarm_log_odds: f64,
    particles: usize,
    armed: bool,
    period_s: f64,
    t_last_ns: u64,
    run_id: u64,
    alarm_t_ns: u64,
    alarm_count: u32,
    quiet_s: f64,
    invalid_count: u32,
    symptoms: u32,
    external: u32,
}

impl Detector {
    /// A detector for `model` and its robot. The alarm threshold follows from the model's
    /// calibration and `settings.false_alarm_interval_h`.
    ///
    /// # Errors
    /// [`DetectorError`] if the model is of another robot, has no calibration for channels and
    /// form, or a setting is out of range.
    pub fn new(
        model: &Model,
        robot: &Description,
        settings: &schema::Detector,
        seed: u64,
    ) -> Result<Self, DetectorError> {
        model.check_robot(robot)?;
        let (channels, form) = chosen(settings);
        let calibration = model.calibration(channels, form)?;
        let rate = settings.fault_rate_1_h;
        Self::watching(model.interval_s, calibration, form, settings, |particles| {
            Watch::Faults {
                observer: Box::new(Observer::new(model, robot)),
                monitor: Box::new(Monitor::new(
                    model, robot, channels, form, particles, rate, seed,
                )),
            }
        })
    }

    /// A detector for a robot of which only the nominal behaviour is known.
    ///
    /// # Errors
    /// As [`Detector::new`].
    pub fn nominal(
        model: &nominal::Model,
        robot: &Description,
        settings: &schema::Detector,
    ) -> Result<Self, DetectorError> {
        model.check_robot(robot)?;
        let (channels, form) = chosen(settings);
        let calibration = model.calibration(channels, form)?;
        let rate = settings.fault_rate_1_h;
        Self::watching(model.interval_s, calibration, form, settings, |_| {
            Watch::Nominal {
                observer: Box::new(nominal::Observer::new(robot)),
                monitor: Box::new(nominal::Monitor::new(model, channels, form, rate)),
                last: Observed::default(),
            }
        })
    }

    fn watching(
        interval_s: f64,
        calibration: &Calibration,
        form: Form,
        settings: &schema::Detector,
        watch: impl FnOnce(usize) -> Watch,
    ) -> Result<Self, DetectorError> {
        if !(1..=PARTICLE_CAPACITY).contains(&settings.particles) {
            return Err(DetectorError::Particles(settings.particles));
        }
        let rate = positive("fault_rate_1_h", settings.fault_rate_1_h)?;
        let interval = positive("false_alarm_interval_h", settings.false_alarm_interval_h)?;
        let alarm_log_odds = calibration.alarm_log_odds(interval, rate);
        if alarm_log_odds > form.log_odds_max() {
            let form = form.name();
            return Err(DetectorError::Unreachable {
                form,
                alarm_log_odds,
            });
        }
        let particles = settings.particles;
        Ok(Self {
            watch: watch(particles),
            fault_rate_1_s: rate / 3600.0,
            alarm_log_odds,
            particles,
            armed: false,
            period_s: interval_s,
            t_last_ns: 0,
            run_id: 0,
            alarm_t_ns: 0,
            alarm_count: 0,
            quiet_s: 0.0,
            invalid_count: 0,
            symptoms: 0,
            external: 0,
        })
    }

    /// Log-odds at which the alarm rises.
    #[must_use]
    pub const fn alarm_log_odds(&self) -> f64 {
        self.alarm_log_odds
    }

    /// Takes one entry of the journal and fills the belief and the particles (headers and causes
    /// are the caller's).
    pub fn step(
        &mut self,
        entry: Entry<&SensorFrame>,
        belief: &mut DetectionBelief,
        particles: &mut ParticleBlock,
    ) {
        let mut missed = 0;
        match entry {
            Entry::Frame(frame) => self.take(frame),
            Entry::Missed(count) => missed = count,
            Entry::Budget(count) => {
                let count = (count as usize).clamp(1, self.particles);
                self.watch.resize(count);
            }
            Entry::Reset => {
                self.watch.reset_observer();
                self.begin_run();
            }
        }
        self.report(missed, belief);
        self.publish(particles);
    }

    fn begin_run(&mut self) {
        self.watch.reset();
        (self.armed, self.quiet_s) = (false, 0.0);
        (self.alarm_t_ns, self.symptoms) = (0, 0);
    }

    fn take(&mut self, frame: &SensorFrame) {
        let intake = self.watch.push(frame);
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
        if intake.complete {
            self.observe();
        }
    }

    fn observe(&mut self) {
        let observation = self.watch.step(self.alarm_t_ns != 0);
        let moving = observation.moving;
        if !self.armed {
            // Evidence from before the noise scale is known is no evidence.
            self.armed = self.watch.is_ready();
            self.watch.forget_evidence();
        }
        let log_odds = self.watch.report().log_odds;
        if self.alarm_t_ns == 0 {
            if self.armed && log_odds > self.alarm_log_odds {
                self.alarm_t_ns = observation.t_ns.max(1);
                self.alarm_count = self.alarm_count.saturating_add(1);
                self.quiet_s = 0.0;
            }
        } else if moving {
            // Clearing needs evidence: time at rest does not count.
            let clear = (self.alarm_log_odds - CLEAR_BELOW).min(CLEAR_LOG_ODDS);
            let quiet = log_odds < clear;
            self.quiet_s = if quiet {
                self.quiet_s + observation.dt_s
            } else {
                0.0
            };
            if self.quiet_s >= CLEAR_S {
                self.alarm_t_ns = 0;
            }
        }
        let off_course = self.watch.report().channels[Channel::POSE] > SYMPTOM_LOG_ODDS;
        self.symptoms = if !off_course {
            0
        } else if moving {
            Symptoms::EPM
        } else {
            Symptoms::EPS
        };
    }

    fn report(&self, missed: u32, belief: &mut DetectionBelief) {
        let report = self.watch.report();
        let p_now = probability(report.log_odds);
        // The state stays at the last frame; what is told is its prediction.
        let appears = self.fault_rate_1_s * self.period_s * f64::from(missed);
        let p_fault = p_now + (1.0 - p_now) * (1.0 - (-appears).exp());
        let odds = (p_fault / (1.0 - p_fault)).ln();
        belief.run_id = self.run_id;
        belief.p_fault = p_fault;
        belief.log_odds = if missed > 0 && odds.is_finite() {
            odds
        } else {
            report.log_odds
        };
        belief.alarm_log_odds = self.alarm_log_odds;
        belief.evidence = if report.evidence.is_finite() {
            report.evidence
        } else {
            0.0
        };
        belief.effective_sample_size = report.effective_sample_size;
        let NoiseScales {
            pose,
            wheels,
            steer,
        } = self.watch.scales();
        belief.noise_scale = pose;
        belief.noise_scale_wheels = wheels;
        belief.noise_scale_steer = steer;
        belief.channel_log_odds = report.channels;
        belief.alarm_t_capture_ns = self.alarm_t_ns;
        belief.alarm = u32::from(self.alarm_t_ns != 0);
        belief.alarm_count = self.alarm_count;
        belief.symptoms = self.symptoms | self.external;
        belief.invalid_count = self.invalid_count;
        belief.degenerate_count = report.degenerate_count;
        belief.particle_count = self.watch.particles().map_or(0, PoseParticles::len) as u32;
    }

    fn publish(&self, block: &mut ParticleBlock) {
        let Some(cloud) = self.watch.particles() else {
            block.count = 0;
            return;
        };
        let count = cloud.len().min(PARTICLE_CAPACITY);
        block.count = count as u32;
        block.mode[..count].fill(0);
        for i in 0..count {
            block.x[i] = cloud.x[i] as f32;
            block.y[i] = cloud.y[i] as f32;
            block.yaw[i] = cloud.yaw[i] as f32;
            block.log_weight[i] = cloud.log_weight[i] as f32;
        }
    }
}

fn chosen(settings: &schema::Detector) -> (Channels, Form) {
    let channels = match settings.sensors {
        schema::Sensors::Pose => Channels::Pose,
        schema::Sensors::PoseEncoders => Channels::PoseEncoders,
    };
    let form = match settings.form {
        schema::Form::LearnedBias => Form::LearnedBias,
        schema::Form::Constant => Form::Constant,
        schema::Form::Windowed => Form::Windowed,
    };
    (channels, form)
}

fn positive(key: &'static str, value: f64) -> Result<f64, DetectorError> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(DetectorError::Value { key, value })
}

//! How far an encoder is off that still follows its wheel: gain, bias, drift and delay.
//!
//! One estimate a wheel and way, shared by all hypotheses: it follows the rate that the most
//! probable named one expects of the wheel. Before each reading it is the mixture of what has been
//! learned since the fault and of what is known when it begins with this reading, as probable as
//! that hypothesis has them; after it, of the mixture's moments. So the onset needs no hypothesis
//! of its own, and what a healthy encoder read before it is forgotten at the first faulty reading.

use vigil_blocks::WHEELS;
use vigil_checkpoint::Checkpoint;
use vigil_inference::logspace::log_add;
use vigil_inference::size::{Prior, Size};
use vigil_robot::learned::wheel_context::FAR_SD;
use vigil_robot::learned::wheels::{ExpectedRate, STANDING_SD_RAD_S};
use vigil_robot::learned::{Model, MotionMode, Observation, WheelEvidence};
use vigil_robot::{Description, Tolerance};

use crate::identify::delay_belief::DelayBelief;
use crate::identify::encoders::Encoders;
use crate::identify::sized_ways::{BIAS, DELAY, DRIFT, GAIN, SIZED_SHARES, WAYS};

/// Prior mean of the gain of a broken encoder. Chosen by hand: lost pulses are commoner than pulses
/// too many.
const GAIN_MEAN: f64 = 0.75;
/// Its deviation: two span all pulses lost to two thirds too many.
const GAIN_SD: f64 = 0.45;
/// Prior deviation of a bias, in tolerances of one wheel's rate. Chosen by hand: some three times
/// the least bias ([`RATES`]); smaller fits large biases late, larger pays more nats for each.
const BIAS_SD: f64 = 10.0;
/// The same of a drift, per second: it reaches the deviation of a bias in four.
const DRIFT_SD_1_S: f64 = 2.5;
/// The same of the bias that a drift has reached when it is first tried: two seconds of it.
const DRIFTED_SD: f64 = 5.0;
/// A gain counts as a fault beyond this many tolerances of the wheels' ratio: what load and ground
/// make of a rate is no encoder's fault. Chosen by hand: smaller takes load for a fault, larger
/// leaves smaller faults unnamed.
const RATIOS: f64 = 2.0;
/// A bias counts as one beyond this many tolerances of a wheel's rate, for the same reason.
const RATES: f64 = 3.0;
/// A drift is one if it passes the tolerance of a rate within this time, s. Chosen: a slower one is
/// taken up as load.
const DRIFTS_S: f64 = 5.0;
/// Tolerance of the wheels' ratio of a robot that declares none: the rover's.
const UNDECLARED_RATIO: f64 = 0.08;
/// The same of a wheel's rate, rad/s: the rover's.
const UNDECLARED_RAD_S: f64 = 0.06;
/// Deviation by which a gain wanders from one reading to the next: 0.035 in a minute of 20 Hz, less
/// than half a tolerance.
const GAIN_WANDERS: f64 = 0.001;
/// That of a bias, as a part of the tolerance of a rate: in a minute it wanders by one.
const BIAS_WANDERS: f64 = 30.0;

/// What the last observation says of each wheel's encoder, if it is broken in each way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderSizes {
    /// Log-likelihoods, comparable within a wheel.
    pub logs: [[f64; WAYS]; WHEELS],
    /// That of a bias on a wheel that stands.
    pub standing: [f64; WHEELS],
    /// Wheels, as bits, of which a late encoder reads anything else than a timely one.
    pub late: u32,
}

/// The estimates.
#[derive(Debug, Clone, Checkpoint)]
pub struct Sizes {
    /// Of gain, bias and drift.
    #[checkpoint(fixed)]
    priors: [Prior; DELAY],
    fresh: [Size; DELAY],
    held: [[Size; DELAY]; WHEELS],
    late: DelayBelief,
}

/// One observation, with the rates of the most probable motion that has a name.
#[derive(Debug, Clone, Copy)]
pub struct SizeInput<'a> {
    /// The model.
    pub model: &'a Model,
    /// The observation.
    pub observation: &'a Observation,
    /// What its wheels say.
    pub evidence: &'a WheelEvidence,
    /// The motion.
    pub mode: &'a MotionMode,
    /// The encoders before the observation.
    pub encoders: &'a Encoders,
    /// Probabilities that each encoder breaks in it.
    pub births: &'a [f64; WHEELS],
}

impl SizeInput<'_> {
    /// Share of the fault that began before this observation, if the encoder is broken this way.
    pub fn begun(&self, wheel: usize, way: usize) -> f64 {
        let before = self.encoders.p_sized(wheel, way);
        let now = self.encoders.p_whole(wheel) * self.births[wheel] * SIZED_SHARES[way];
        let both = before + now;
        if both > 0.0 { before / both } else { 0.0 }
    }

    /// Log-likelihood of a wheel's readings about this rate.
    pub fn reads(&self, wheel: usize, about: ExpectedRate) -> f64 {
        self.evidence
            .reads(self.model, self.observation, wheel, about)
    }
}

impl Sizes {
    /// Nothing is known of any size.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        let declared = |t: Tolerance| (t.wheel_ratio, t.wheel_rate_rad_s);
        let (ratio, rate) = robot
            .tolerance
            .map_or((UNDECLARED_RATIO, UNDECLARED_RAD_S), declared);
        let (gain, bias) = (RATIOS * ratio, RATES * rate);
        let drift = rate / DRIFTS_S;
        let priors = [
            Prior {
                mean: [GAIN_MEAN, 0.0],
                sd: [GAIN_SD, 0.0],
                wander: [GAIN_WANDERS, 0.0],
                healthy: [1.0 - gain, 1.0 + gain],
            },
            Prior {
                mean: [0.0; 2],
                sd: [BIAS_SD * rate, 0.0],
                wander: [rate / BIAS_WANDERS, 0.0],
                healthy: [-bias, bias],
            },
            Prior {
                mean: [0.0; 2],
                sd: [DRIFT_SD_1_S * rate, DRIFTED_SD * rate],
                wander: [0.0, rate / BIAS_WANDERS],
                healthy: [-drift, drift],
            },
        ];
        let fresh = priors.each_ref().map(Size::new);
        Self {
            priors,
            fresh,
            held: [fresh; WHEELS],
            late: DelayBelief::default(),
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.held = [self.fresh; WHEELS];
        self.late.clear();
    }

    /// The robot stands: its wheels' rates are 0, and what drifts drifts on.
    pub fn rest(&mut self, observation: &Observation) {
        for held in &mut self.held {
            held[DRIFT].predict(observation.dt_s, &self.priors[DRIFT]);
        }
        self.late.keep(observation.t_ns, [(0.0, 0.0); WHEELS]);
    }

    /// Expected size and standard deviation of a way, in its unit.
    #[must_use]
    pub fn estimate(&self, wheel: usize, way: usize) -> (f64, f64) {
        match way {
            DELAY => self.late.estimate(wheel),
            _ => self.held[wheel][way].estimate(),
        }
    }

    /// Takes an observation of the first `wheels` wheels: what it says, and what it teaches.
    pub fn take(&mut self, input: &SizeInput<'_>, wheels: usize) -> EncoderSizes {
        let mut sizes = EncoderSizes {
            logs: [[f64::NEG_INFINITY; WAYS]; WHEELS],
            standing: [0.0; WHEELS],
            late: 0,
        };
        let rate = |i: usize| match i < wheels {
            true => {
                let (model, observation, mode) = (input.model, input.observation, input.mode);
                input.evidence.rate(model, observation, mode, i)
            }
            false => ExpectedRate {
                mean_rad_s: 0.0,
                variance: 0.0,
                tail: 0.0,
            },
        };
        let rates: [_; WHEELS] = std::array::from_fn(rate);
        for (wheel, &about) in rates.iter().enumerate().take(wheels) {
            for way in 0..DELAY {
                sizes.logs[wheel][way] = self.line(input, wheel, way, about);
            }
            let (bias, variance) = self.held[wheel][BIAS].expected([1.0, 0.0]);
            let spread = variance + STANDING_SD_RAD_S * STANDING_SD_RAD_S;
            sizes.standing[wheel] = input.reads(
                wheel,
                ExpectedRate {
                    mean_rad_s: bias,
                    variance: spread,
                    ..about
                },
            );
        }
        let means = rates.map(|rate| (rate.mean_rad_s, rate.variance));
        self.late.keep(input.observation.t_ns, means);
        for (wheel, &about) in rates.iter().enumerate().take(wheels) {
            let begun = input.begun(wheel, DELAY);
            let is_stuck = input.mode.moved.is_stuck(wheel);
            let reads = |about| input.reads(wheel, about);
            if let Some(log) = self.late.take(wheel, about.tail, begun, is_stuck, reads) {
                sizes.logs[wheel][DELAY] = log;
                sizes.late |= 1 << wheel;
            }
        }
        sizes
    }

    /// What a wheel's readings say for a gain, bias or drift while it turns at about this rate; the
    /// estimate learns from them, unless the wheel stands.
    fn line(
        &mut self,
        input: &SizeInput<'_>,
        wheel: usize,
        way: usize,
        about: ExpectedRate,
    ) -> f64 {
        let prior = &self.priors[way];
        let mut held = self.held[wheel][way];
        let dt_s = match way {
            DRIFT => input.observation.dt_s,
            _ => 0.0,
        };
        held.predict(dt_s, prior);
        let begun = input.begun(wheel, way);
        let (log_held, held) = take_reading(input, wheel, way, about, held, prior);
        let (log_fresh, fresh) = take_reading(input, wheel, way, about, self.fresh[way], prior);
        let (log_held, log_fresh) = (begun.ln() + log_held, (1.0 - begun).ln() + log_fresh);
        let log = log_add(log_held, log_fresh);
        if !input.mode.moved.is_stuck(wheel) && log.is_finite() {
            let share = (log_held - log).exp();
            self.held[wheel][way] = held.mixed(&fresh, share, prior);
        }
        log
    }
}

/// What a wheel's readings say for a size, and what it is after them.
fn take_reading(
    input: &SizeInput<'_>,
    wheel: usize,
    way: usize,
    about: ExpectedRate,
    mut size: Size,
    prior: &Prior,
) -> (f64, Size) {
    let ExpectedRate {
        mean_rad_s: rate,
        variance,
        ..
    } = about;
    let (by, base, variance) = match way {
        GAIN => {
            let (gain, _) = size.estimate();
            ([rate, 0.0], 0.0, gain * gain * variance)
        }
        BIAS => ([1.0, 0.0], rate, variance),
        _ => ([0.0, 1.0], rate, variance),
    };
    let (beside, uncertain) = size.expected(by);
    let log = input.reads(
        wheel,
        ExpectedRate {
            mean_rad_s: base + beside,
            variance: variance + uncertain,
            ..about
        },
    );
    let reading = &input.observation.wheels[wheel];
    if reading.plain == 0 {
        return (log, size);
    }
    let noise = variance + input.evidence.sample_variance(wheel, reading.plain);
    let residual = reading.mean - base - beside;
    if residual * residual > FAR_SD * FAR_SD * (noise + uncertain) {
        return (log, size);
    }
    let before = size.log_material();
    size.update(by, reading.mean - base, noise, prior);
    (log + size.log_material() - before, size)
}

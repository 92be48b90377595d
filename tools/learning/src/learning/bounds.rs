//! Bounds set by hand on what is learned of faults, and which numbers of a model stand on one.

use vigil_robot::Description;
use vigil_robot::learned::calibration::SLOPE_LIMITS;
use vigil_robot::learned::{Model, MotionModel, RateModel};

use crate::bounds::{Bounds, Limits};

const LENGTHS: &str = "tracks of 15 s at 0.2 m/s tell no longer length";
const IMPOSSIBLE: &str = "as much per metre as the metre itself: impossible";

/// Scatter from run to run, rad/m and m/m.
pub(super) const OFFSET_SD: Limits = Limits {
    number: "motion.offset_sd",
    least: (
        1e-3,
        "no robot repeats its own motion better than to a thousandth",
    ),
    most: (1.0, IMPOSSIBLE),
};
/// Variation within a run, rad/m and m/m.
pub(super) const DEVIATION_SD: Limits = Limits {
    number: "motion.deviation_sd",
    least: (2e-4, "a fifth of the least scatter from run to run"),
    most: (2.0, IMPOSSIBLE),
};
/// The same aside.
pub(super) const LATERAL_SD: Limits = Limits::least(
    "motion.deviation_sd[2]",
    3e-4,
    "taken from the forward motion's; a third of the least scatter from run to run",
);
/// Length of that variation, m.
pub(super) const LENGTH_M: Limits = Limits {
    number: "motion.deviation_length_m",
    least: (
        0.03,
        "three observations at 0.2 m/s: shorter is white noise",
    ),
    most: (3.0, LENGTHS),
};
/// White noise, per root metre.
pub(super) const WHITE_SD: Limits = Limits {
    number: "motion.white_sd",
    least: (1e-4, "a tenth of the least scatter from run to run"),
    most: (0.1, IMPOSSIBLE),
};
/// Largest correlation of yaw and forward motion, either way: the covariance stays positive.
pub(super) const CORRELATION_MAX: f64 = 0.98;
/// A correlation approaches its bound without an end: this near it stands on it.
const CORRELATION_NEAR: f64 = 0.999;
/// Scatter of a wheel's rate, rad/s.
pub(super) const RATE_SD: Limits = Limits::least(
    "rates.rate_sd_rad_s",
    0.008,
    "a sixth of an encoder's noise: runs on one soil must not promise more on others",
);
/// The same of a wheel that was never read: half of a slow wheel's rate.
pub(super) const RATE_SD_UNREAD: f64 = 0.1;
/// Repeats of a channel's samples.
pub(super) const REPEAT_RATE: Limits = Limits::least(
    "repeat_rate",
    1e-4,
    "a log of some minutes cannot tell less from none",
);
/// Noise of a broken encoder, rad/s.
pub(super) const BROKEN_SD: Limits = Limits::least(
    "encoder.broken_sd_rad_s",
    0.01,
    "an encoder whose rates scatter by less is not noisy",
);
/// Differences beyond this many deviations of the description's noise are no noise.
pub(super) const CLIP: f64 = 8.0;

/// Scatter of a current by the ground, A.
pub(super) fn current_sd(noise_a: f64) -> Limits {
    Limits::least(
        "further.currents.wheels.sd_a",
        0.02 * noise_a,
        "a mean of 2500 samples, two minutes, is known to a fiftieth of the sensor's noise",
    )
}

/// A sensor's noise beside that of the description: of less than three deviations, the log's noise
/// is cut off.
fn sensor_sd(described: f64) -> Limits {
    Limits::most(
        "noise",
        described * CLIP / 3.0,
        "differences beyond 8 of the description's deviations are left out: describe the sensor",
    )
}

/// What of `model` stands on a bound, or was not learned.
#[must_use]
pub fn bounds(model: &Model, robot: &Description) -> Bounds {
    let mut bounds = Bounds::default();
    motion(&mut bounds, "nominal", &model.nominal.motion);
    rates(&mut bounds, "nominal", &model.nominal.rates);
    for (i, stuck) in model.stuck.iter().enumerate() {
        let of = format!("stuck[{i}]");
        motion(&mut bounds, &of, &stuck.motion);
        rates(&mut bounds, &of, &stuck.rates);
    }
    sensors(&mut bounds, model, robot);
    further(&mut bounds, model);
    for (i, calibration) in model.calibration.iter().enumerate() {
        let key = format!("calibration[{i}].tail_slope");
        bounds.look(&SLOPE_LIMIT, key, calibration.tail_slope);
    }
    assumed(&mut bounds, model, robot);
    bounds
}

/// Slope of the tail of healthy log-odds.
pub(crate) const SLOPE_LIMIT: Limits = Limits {
    number: "tail_slope",
    least: (
        SLOPE_LIMITS.0,
        "an alarm's threshold would lie beyond all reach",
    ),
    most: (SLOPE_LIMITS.1, "that of a filter whose model has no error"),
};

fn motion(bounds: &mut Bounds, of: &str, motion: &MotionModel) {
    let key = |field: &str| format!("{of}.motion.{field}");
    for (axis, &sd) in motion.offset_sd.iter().enumerate() {
        bounds.look(&OFFSET_SD, key(&format!("offset_sd[{axis}]")), sd);
    }
    let limits = [&DEVIATION_SD, &DEVIATION_SD, &LATERAL_SD];
    for (axis, (limits, &sd)) in limits.iter().zip(&motion.deviation_sd).enumerate() {
        bounds.look(limits, key(&format!("deviation_sd[{axis}]")), sd);
    }
    bounds.look(
        &LENGTH_M,
        key("deviation_length_m"),
        motion.deviation_length_m,
    );
    bounds.look(&WHITE_SD, key("white_sd"), motion.white_sd[0]);
    let most = CORRELATION_NEAR * CORRELATION_MAX;
    let limits = Limits {
        number: "motion.correlation",
        least: (-most, "0.98 keeps a covariance positive"),
        most: (most, "0.98 keeps a covariance positive"),
    };
    bounds.look(&limits, key("correlation"), motion.correlation);
}

fn rates(bounds: &mut Bounds, of: &str, rates: &[RateModel]) {
    for (wheel, rate) in rates.iter().enumerate() {
        let key = format!("{of}.rates[{wheel}].rate_sd_rad_s");
        if is_unread(rate) {
            bounds.given(
                true,
                (RATE_SD.number, key),
                rate.rate_sd_rad_s,
                "this wheel was never read in motion",
            );
        } else {
            bounds.look(&RATE_SD, key, rate.rate_sd_rad_s);
        }
    }
}

fn is_unread(rate: &RateModel) -> bool {
    (rate.ratio, rate.droop_rad_s, rate.rate_sd_rad_s) == (1.0, [0.0; 3], RATE_SD_UNREAD)
}

fn sensors(bounds: &mut Bounds, model: &Model, robot: &Description) {
    let (noise, described) = (&model.noise, &robot.noise);
    let pairs = [
        ("position_m", noise.position_m, described.position_m),
        ("yaw_rad", noise.yaw_rad, described.yaw_rad),
        (
            "wheel_rate_rad_s",
            noise.wheel_rate_rad_s,
            described.wheel_rate_rad_s,
        ),
    ];
    for (field, learned, described) in pairs {
        bounds.look(&sensor_sd(described), format!("noise.{field}"), learned);
    }
    let encoder = &model.encoder;
    bounds.look(
        &REPEAT_RATE,
        "encoder.repeat_rate".into(),
        encoder.repeat_rate,
    );
    bounds.look(
        &BROKEN_SD,
        "encoder.broken_sd_rad_s".into(),
        encoder.broken_sd_rad_s,
    );
}

fn further(bounds: &mut Bounds, model: &Model) {
    let further = model.further.as_ref();
    if let Some(gyro) = further.and_then(|further| further.yaw_rate.as_ref()) {
        let key = "further.yaw_rate.repeat_rate".to_owned();
        bounds.look(&REPEAT_RATE, key, gyro.repeat_rate);
    }
    let Some(currents) = further.and_then(|further| further.currents.as_ref()) else {
        return;
    };
    let key = "further.currents.repeat_rate".to_owned();
    bounds.look(&REPEAT_RATE, key, currents.repeat_rate);
    let limits = current_sd(currents.noise_a);
    for (wheel, current) in currents.wheels.iter().enumerate() {
        let key = format!("further.currents.wheels[{wheel}].sd_a");
        bounds.look(&limits, key, current.sd_a);
    }
}

/// What is never learned, and what the log held no data for.
fn assumed(bounds: &mut Bounds, model: &Model, robot: &Description) {
    const DESCRIBED: &str = "the robot's description";
    const ASSUMED: &str = "assumed: no log of steady driving tells it";
    let (command, encoder) = (&model.command, &model.encoder);
    let always = [
        ("noise.steer_rad", model.noise.steer_rad, DESCRIBED),
        ("command.lag_s", command.lag_s, DESCRIBED),
        (
            "command.lag_uncertainty",
            command.lag_uncertainty,
            DESCRIBED,
        ),
        ("command.standing_m_s", command.standing_m_s, DESCRIBED),
        ("nominal.steer_sd_rad", model.nominal.steer_sd_rad, ASSUMED),
        (
            "encoder.resolution_rad_s",
            encoder.resolution_rad_s,
            ASSUMED,
        ),
    ];
    for (key, value, why) in always {
        bounds.given(true, (key, key.to_owned()), value, why);
    }
    let blank = super::blank(robot, &super::Options::default());
    let without = [
        (
            "noise.wheel_rate_rad_s",
            model.noise.wheel_rate_rad_s,
            blank.noise.wheel_rate_rad_s,
            "no wheel was read in steady motion: the description's",
        ),
        (
            "encoder.repeat_rate",
            encoder.repeat_rate,
            blank.encoder.repeat_rate,
            "no wheel was read in motion",
        ),
        (
            "encoder.broken_sd_rad_s",
            encoder.broken_sd_rad_s,
            blank.encoder.broken_sd_rad_s,
            "no run of a noisy encoder: a quarter of what an encoder can report",
        ),
    ];
    for (key, value, otherwise, why) in without {
        bounds.given(value == otherwise, (key, key.to_owned()), value, why);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::BoundCause;

    fn shipped() -> (Model, Description) {
        let read = |path: &str| {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/");
            std::fs::read_to_string(format!("{folder}{path}")).unwrap()
        };
        let model = Model::from_toml(&read("models/rover.toml")).unwrap();
        (model, toml::from_str(&read("robots/rover.toml")).unwrap())
    }

    #[test]
    fn every_clamped_number_of_a_model_is_told_with_its_key_and_no_other() {
        let (mut model, robot) = shipped();
        model.nominal.motion.offset_sd = [OFFSET_SD.hold(1e-6), OFFSET_SD.hold(0.01), 0.01];
        model.nominal.rates[2].rate_sd_rad_s = RATE_SD.hold(0.0);
        model.nominal.rates[3].rate_sd_rad_s = RATE_SD.hold(0.03);
        model.encoder.repeat_rate = REPEAT_RATE.hold(1e-9);
        model.noise.yaw_rad = 3.0 * robot.noise.yaw_rad;
        let found = bounds(&model, &robot);
        let held = |key: &str| {
            let bound = found.found.iter().find(|bound| bound.key == key);
            bound.map(|bound| (bound.value, bound.held))
        };
        assert_eq!(
            held("nominal.motion.offset_sd[0]"),
            Some((1e-3, BoundCause::Least))
        );
        assert_eq!(
            held("nominal.rates[2].rate_sd_rad_s"),
            Some((0.008, BoundCause::Least))
        );
        assert_eq!(held("encoder.repeat_rate"), Some((1e-4, BoundCause::Least)));
        assert_eq!(
            held("noise.yaw_rad").map(|held| held.1),
            Some(BoundCause::Most)
        );
        assert_eq!(
            held("command.lag_s"),
            Some((model.command.lag_s, BoundCause::Given))
        );
        for free in [
            "nominal.motion.offset_sd[1]",
            "nominal.motion.offset_sd[2]",
            "nominal.rates[3].rate_sd_rad_s",
            "noise.position_m",
            "encoder.broken_sd_rad_s",
        ] {
            assert_eq!(held(free), None, "{free}");
        }
    }

    #[test]
    fn the_rates_of_the_shipped_model_that_stand_on_the_floor_are_one_line() {
        let (model, robot) = shipped();
        let lines = bounds(&model, &robot).lines();
        let rates: Vec<_> = lines
            .iter()
            .filter(|line| line.contains("rate_sd_rad_s"))
            .collect();
        assert_eq!(rates.len(), 1, "{lines:#?}");
        assert!(
            rates[0].starts_with("on its bound: 36 of 42 rates.rate_sd_rad_s = 0.008 (least: ")
        );
    }
}

//! Gyro and motor currents, learned from healthy runs that hold them.

use vigil_blocks::WHEELS;
use vigil_recording::frames::Run;
use vigil_robot::learned::further::{CurrentModel, CurrentsModel, YawRateModel};
use vigil_robot::learned::wheels::rolling_rate;
use vigil_robot::learned::{Further, FurtherModel, Model, Observation, Observer, Reading};
use vigil_robot::{ChannelMap, Description};

use super::bounds::{REPEAT_RATE, current_sd};
use super::least_squares::LeastSquares;
use super::segments::SETTLE_S;
use super::{LearnError, calibrate};
use crate::data_hash::data_hash;

/// Observations averaged before the spread by the ground is found.
const WINDOW: usize = 20;
/// Samples that a channel needs.
const SAMPLES_MIN: f64 = 200.0;
/// Mode of these runs, in messages.
const MODE: &str = "ND";

/// One observation of a healthy run.
type HealthyObservation = (Observation, Further);

/// True if any frame holds a yaw rate or a current.
#[must_use]
pub fn is_in(runs: &[&Run], robot: &Description) -> bool {
    let bits = ChannelMap::new(robot).further_bits();
    let mut frames = runs.iter().flat_map(|run| &run.frames);
    frames.any(|frame| frame.channel_valid & bits != 0)
}

/// Learns what healthy `runs` of the model's robot hold of these channels, and calibrates the alarm
/// of all channels together on them. The model is not sealed.
///
/// # Errors
/// [`LearnError`] if they hold none of them, too few samples, or too little driving.
pub fn learn(
    model: &mut Model,
    runs: &[&Run],
    frames_file: &str,
    robot: &Description,
) -> Result<(), LearnError> {
    let seen: Vec<Vec<HealthyObservation>> =
        runs.iter().map(|run| observed(run, robot, model)).collect();
    let further = FurtherModel {
        frames_file: frames_file.to_owned(),
        data_hash: data_hash(runs, f64::INFINITY, &[]),
        runs: runs.iter().map(|run| run.id).collect(),
        yaw_rate: gyro(&seen, model),
        currents: currents(&seen, robot, model)?,
    };
    if further.yaw_rate.is_none() && further.currents.is_none() {
        return Err(LearnError::Missing {
            mode: MODE.to_owned(),
            missing: "yaw rate or motor currents in motion",
        });
    }
    model.further = Some(further);
    calibrate::fit_further(model, runs, robot)
}

/// Observations of one run in motion, settled.
fn observed(run: &Run, robot: &Description, model: &Model) -> Vec<HealthyObservation> {
    let mut observer = Observer::new(model, robot).with_further();
    let begin_ns = run.frames.first().map_or(0, |f| f.header.t_capture_ns);
    let mut out = Vec::new();
    for frame in &run.frames {
        let is_complete = observer.push(frame).complete;
        let settled = (frame.header.t_capture_ns - begin_ns) as f64 * 1e-9 >= SETTLE_S;
        let observation = *observer.observation();
        if let Some(further) = observer.further()
            && is_complete
            && settled
            && observation.moving
        {
            out.push((observation, *further));
        }
    }
    out
}

/// Noise of a channel per sample at the reference rate, from first differences while the command
/// stays as it is, and how often a sample repeats itself; None with too few samples.
fn noise(
    seen: &[Vec<HealthyObservation>],
    model: &Model,
    of: impl Fn(&Further) -> &Reading,
) -> Option<[f64; 2]> {
    let (mut sum, mut count, mut repeats, mut samples) = (0.0, 0.0, 0.0, 0.0);
    for two in seen.iter().flat_map(|run| run.windows(2)) {
        let (before, now) = (&two[0], &two[1]);
        let (was, is) = (of(&before.1), of(&now.1));
        repeats += f64::from(is.repeats);
        samples += f64::from(is.count());
        if before.0.command != now.0.command || was.plain == 0 || is.plain == 0 {
            continue;
        }
        let scale = f64::from(is.plain) * now.0.frame_s * model.noise.reference_rate_hz;
        sum += (is.mean - was.mean).powi(2) * scale / 2.0;
        count += 1.0;
    }
    let repeat_rate = (repeats + 1.0) / (samples + 2.0);
    (count >= SAMPLES_MIN && sum > 0.0).then(|| [f64::sqrt(sum / count), repeat_rate])
}

fn gyro(seen: &[Vec<HealthyObservation>], model: &Model) -> Option<YawRateModel> {
    let [noise_rad_s, repeat_rate] = noise(seen, model, |further| &further.yaw_rate)?;
    Some(YawRateModel {
        noise_rad_s,
        repeat_rate: REPEAT_RATE.hold(repeat_rate),
    })
}

fn currents(
    seen: &[Vec<HealthyObservation>],
    robot: &Description,
    model: &Model,
) -> Result<Option<CurrentsModel>, LearnError> {
    let wheels = robot.wheels.len().min(WHEELS);
    let (mut squares, mut repeat_rate) = (0.0, 0.0);
    for wheel in 0..wheels {
        let Some([sd, repeats]) = noise(seen, model, |further| &further.currents[wheel]) else {
            return Ok(None);
        };
        squares += sd * sd / wheels as f64;
        repeat_rate += repeats / wheels as f64;
    }
    let noise_a = squares.sqrt();
    let one = |wheel| current(seen, robot, wheel, noise_a);
    Ok(Some(CurrentsModel {
        noise_a,
        repeat_rate: REPEAT_RATE.hold(repeat_rate),
        wheels: (0..wheels).map(one).collect::<Result<_, _>>()?,
    }))
}

fn current(
    seen: &[Vec<HealthyObservation>],
    robot: &Description,
    wheel: usize,
    noise_a: f64,
) -> Result<CurrentModel, LearnError> {
    let basis = |observation: &Observation| {
        let [curvature, speed] = observation.command;
        let rolling = rolling_rate(robot, wheel, curvature, speed);
        CurrentModel::basis(rolling, curvature)
    };
    let mut fit = LeastSquares::<4>::default();
    for (observation, further) in seen.iter().flatten() {
        let read = &further.currents[wheel];
        if read.plain > 0 {
            fit.push(basis(observation), read.mean, f64::from(read.plain));
        }
    }
    let terms = fit.solve().ok_or_else(|| LearnError::Singular {
        mode: MODE.to_owned(),
        what: "motor currents",
    })?;
    // What the means of longer stretches scatter by beyond the sensor's noise is the ground's.
    let (mut sum, mut count) = (0.0, 0.0);
    for window in seen.iter().flat_map(|run| run.chunks_exact(WINDOW)) {
        let apart = |(observation, further): &HealthyObservation| {
            let basis = basis(observation);
            let expected: f64 = basis.iter().zip(terms).map(|(basis, c)| basis * c).sum();
            further.currents[wheel].mean - expected
        };
        let mean = window.iter().map(apart).sum::<f64>() / WINDOW as f64;
        sum += mean * mean - noise_a * noise_a / WINDOW as f64;
        count += 1.0;
    }
    let variance = if count > 0.0 { sum / count } else { 0.0 };
    Ok(CurrentModel {
        dry_a: [terms[0], terms[1], terms[2]],
        viscous_a_s_rad: terms[3],
        sd_a: current_sd(noise_a).hold(variance.max(0.0).sqrt()),
    })
}

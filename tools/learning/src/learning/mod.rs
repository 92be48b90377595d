//! Learns a robot's model from labelled runs.
//!
//! Per mode: displacement per commanded metre as a 4th-order polynomial of the signed curvature
//! (least squares), its noise (maximum likelihood of the tracking filter), wheel rates, and the
//! tail of the detector's nominal log-odds, from which alarm thresholds follow. Left and right
//! wheels are pooled by mirror symmetry. Runs left out take no part in any of it.

pub mod bounds;
mod calibrate;
pub mod further;
mod least_squares;
mod mirrored;
mod motion;
mod report;
mod segments;
mod sensors;
mod simplex;
mod view;
mod wheels;

use std::collections::BTreeSet;

use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_robot::learned::model::{
    CommandModel, Model, Noise, NominalModel, Provenance, StuckModel, VERSION,
};
use vigil_robot::learned::{Curve, EncoderModel, MotionModel, RateModel};

use crate::data_hash::data_hash;
use crate::plausibility::{RunCheck, RunDoubt};
pub use report::{ModeError, RESIDUAL_BAR, Report, Residual};
use segments::Segments;
pub use view::View;

/// How to learn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Interval over which frames are averaged into one observation, s.
    pub interval_s: f64,
    /// Evaluations of the likelihood per noise model.
    pub evaluations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            interval_s: 0.05,
            evaluations: 400,
        }
    }
}

/// Why a model could not be learned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    /// A run without a label.
    #[error("run {0} has no label")]
    Label(u32),
    /// Too few runs of a mode.
    #[error("{found} runs of {mode} to learn from, at least {needed} are needed")]
    Runs {
        /// Mode.
        mode: String,
        /// Runs found.
        found: usize,
        /// Runs needed.
        needed: usize,
    },
    /// A run cannot mean what its columns say.
    #[error(transparent)]
    Doubtful(RunDoubt),
    /// All runs turn to one side.
    #[error("the runs of {mode} turn only {side}, runs that turn to either side are needed")]
    OneSide {
        /// Mode.
        mode: String,
        /// `left` or `right`.
        side: &'static str,
    },
    /// All runs drive at one speed.
    #[error(
        "the runs of {mode} drive at {low_m_s:.3} to {high_m_s:.3} m/s: the effect of speed needs \
         speeds of which the highest is at least {SPEEDS_MIN} times the lowest"
    )]
    Speeds {
        /// Mode.
        mode: String,
        /// Lowest found, m/s.
        low_m_s: f64,
        /// Highest found, m/s.
        high_m_s: f64,
    },
    /// Too few different curvatures to fit a polynomial.
    #[error("runs of {mode} have {found} different curvatures, at least {needed} are needed")]
    Curvatures {
        /// Mode.
        mode: String,
        /// Different curvatures found.
        found: usize,
        /// Different curvatures needed.
        needed: usize,
    },
    /// The runs lack what a model needs.
    #[error("the runs of {mode} hold no {missing}")]
    Missing {
        /// Mode.
        mode: String,
        /// What is missing.
        missing: &'static str,
    },
    /// A fit has no solution.
    #[error("the {what} of {mode} cannot be fitted: the runs are too much alike")]
    Singular {
        /// Mode.
        mode: String,
        /// Which fit.
        what: &'static str,
    },
    /// Too little nominal driving to calibrate an alarm.
    #[error("{found_s:.0} s of nominal driving to calibrate the alarm, {needed_s:.0} s are needed")]
    Exposure {
        /// Found, s.
        found_s: f64,
        /// Needed, s.
        needed_s: f64,
    },
}

/// Runs of a mode that a fit needs at least.
const RUNS_MIN: usize = 3;
/// Ratio of the highest speed to the lowest that the effect of speed needs at least.
const SPEEDS_MIN: f64 = 1.2;

/// Learns a model from the runs that are not in `held_out`, and tells its error on those that are.
///
/// # Errors
/// [`LearnError`] naming what is missing.
pub fn learn(
    runs: &[Run],
    labels: &[Label],
    held_out: &[u32],
    robot: &Description,
    options: &Options,
) -> Result<(Model, Report), LearnError> {
    let left_out: BTreeSet<u32> = held_out.iter().copied().collect();
    let learned: Vec<&Run> = runs
        .iter()
        .filter(|run| !left_out.contains(&run.id))
        .collect();
    let mut model = blank(robot, options);
    model.provenance = Provenance {
        data_hash: data_hash(&learned, f64::INFINITY, &[]),
        runs_learned: learned.iter().map(|run| run.id).collect(),
        runs_held_out: runs
            .iter()
            .map(|run| run.id)
            .filter(|id| left_out.contains(id))
            .collect(),
        ..Provenance::default()
    };
    check_columns(&learned, labels, robot)?;
    let mut segments = Segments::collect(&learned, labels, robot, &model)?;
    check_runs(&segments, robot)?;
    sensors::fit(&mut model, &segments, robot)?;
    // The noise found decides nothing about the observations, only about their variance.
    segments.drop_unmoved();
    let nominal = motion::fit(&model, &segments.nominal, "ND", options)?;
    model.nominal.motion = nominal;
    model.nominal.rates = wheels::fit(robot, &segments.nominal, "ND")?;
    let mirror = segments::mirror(robot);
    for wheel in 0..robot.wheels.len() {
        // The pieces are pooled, so the wheel opposite has the same model in the mirror.
        let opposite = mirror.as_ref().map_or(wheel, |mirror| mirror[wheel]);
        if let (Some(known), Some(mirror)) = (model.stuck.get(opposite), &mirror) {
            let name = &robot.wheels[wheel].name;
            model.stuck.push(mirrored::stuck(known, name, mirror));
            continue;
        }
        let mode = format!("{}_STUCK", robot.wheels[wheel].name);
        let pooled = segments.stuck_pooled(wheel, robot);
        model.stuck.push(StuckModel {
            wheel: robot.wheels[wheel].name.clone(),
            motion: motion::fit(&model, &pooled, &mode, options)?,
            rates: wheels::fit(robot, &pooled, &mode)?,
        });
    }
    calibrate::fit(&mut model, &learned, labels, robot)?;
    let tested: Vec<&Run> = runs
        .iter()
        .filter(|run| left_out.contains(&run.id))
        .collect();
    let report = report::report(&model, &tested, labels, robot)?;
    Ok((model.sealed(), report))
}

/// Refuses runs whose nominal part cannot mean what its columns say.
fn check_columns(runs: &[&Run], labels: &[Label], robot: &Description) -> Result<(), LearnError> {
    let labels = segments::by_run(labels);
    for run in runs {
        let label = labels.get(&run.id).ok_or(LearnError::Label(run.id))?;
        let until_s = label.onset_s.unwrap_or(f64::INFINITY);
        if let Some(doubt) = RunCheck::new(run, robot, until_s).doubt {
            return Err(LearnError::Doubtful(doubt));
        }
    }
    Ok(())
}

fn check_runs(segments: &Segments, robot: &Description) -> Result<(), LearnError> {
    let nominal = segments.nominal_runs;
    let mut found = vec![("ND".to_owned(), nominal)];
    for (wheel, stuck) in robot.wheels.iter().zip(&segments.stuck) {
        found.push((format!("{}_STUCK", wheel.name), stuck.len()));
    }
    match found.into_iter().find(|(_, found)| *found < RUNS_MIN) {
        Some((mode, found)) => Err(LearnError::Runs {
            mode,
            found,
            needed: RUNS_MIN,
        }),
        None => Ok(()),
    }
}

/// A model with the robot's description in place of everything learned.
fn blank(robot: &Description, options: &Options) -> Model {
    let motion = MotionModel {
        offset_sd: [0.0; 3],
        deviation_sd: [0.0; 3],
        deviation_length_m: 0.2,
        correlation: 0.0,
        white_sd: [0.0; 3],
        yaw: Curve {
            curvature: [0.0, 1.0, 0.0, 0.0, 0.0],
            inverse_speed: 0.0,
        },
        forward: Curve {
            curvature: [1.0, 0.0, 0.0, 0.0, 0.0],
            inverse_speed: 0.0,
        },
        lateral: Curve::default(),
    };
    let rates = vec![
        RateModel {
            ratio: 1.0,
            droop_rad_s: [0.0; 3],
            rate_sd_rad_s: 0.02
        };
        robot.wheels.len()
    ];
    let noise = &robot.noise;
    Model {
        version: VERSION,
        hash: String::new(),
        robot: robot.name.clone(),
        wheels: robot
            .wheels
            .iter()
            .map(|wheel| wheel.name.clone())
            .collect(),
        interval_s: options.interval_s,
        provenance: Provenance::default(),
        noise: Noise {
            reference_rate_hz: noise.reference_rate_hz,
            position_m: noise.position_m,
            yaw_rad: noise.yaw_rad,
            wheel_rate_rad_s: noise.wheel_rate_rad_s,
            steer_rad: noise.steer_rad,
        },
        command: CommandModel {
            lag_s: robot.body.lag_s,
            lag_uncertainty: robot.body.lag_uncertainty,
            curvature_max_1_m: robot.limits.curvature_1_m,
            speed_range_m_s: [0.0, robot.limits.speed_m_s],
            standing_m_s: robot.body.standing_m_s,
        },
        encoder: EncoderModel {
            repeat_rate: 1e-3,
            resolution_rad_s: 1e-3,
            broken_mean_rad_s: 0.0,
            broken_sd_rad_s: 0.25 * robot.limits.wheel_rate_rad_s,
        },
        nominal: NominalModel {
            steer_sd_rad: 0.001,
            motion,
            rates,
        },
        stuck: Vec::new(),
        further: None,
        calibration: Vec::new(),
    }
}

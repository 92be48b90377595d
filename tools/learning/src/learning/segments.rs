//! Pieces of runs in which one mode holds, as observations.

use std::collections::BTreeMap;

use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_robot::learned::{Model, Observation, Observer};

use super::LearnError;

/// After an onset, and after the start of a run, the motion settles for so long, s.
pub const SETTLE_S: f64 = 0.5;

/// A piece of a run in which one mode holds.
pub type Segment = Vec<Observation>;

/// All pieces to learn from.
#[derive(Debug, Clone, PartialEq)]
pub struct Segments {
    /// Nominal motion and nominal encoders: nominal runs, and faulty runs before their onset.
    pub nominal: Vec<Segment>,
    /// Runs without a fault from beginning to end.
    pub nominal_runs: usize,
    /// By wheel: this wheel stuck.
    pub stuck: Vec<Vec<Segment>>,
    /// Pieces with a noisy encoder, with the wheel.
    pub noisy: Vec<(usize, Segment)>,
}

/// Observations of one run.
#[must_use]
pub fn observations(run: &Run, robot: &Description, model: &Model) -> Segment {
    let mut observer = Observer::new(model, robot);
    let mut out = Segment::new();
    for frame in &run.frames {
        if observer.push(frame).complete {
            out.push(*observer.observation());
        }
    }
    out
}

/// The labels by run.
pub fn by_run(labels: &[Label]) -> BTreeMap<u32, &Label> {
    labels.iter().map(|label| (label.run, label)).collect()
}

impl Segments {
    /// Cuts the runs at their onsets.
    ///
    /// # Errors
    /// [`LearnError::Label`] for a run without a label.
    pub fn collect(
        runs: &[&Run],
        labels: &[Label],
        robot: &Description,
        model: &Model,
    ) -> Result<Self, LearnError> {
        let labels = by_run(labels);
        let mut out = Self {
            nominal: Vec::new(),
            nominal_runs: 0,
            stuck: vec![Vec::new(); robot.wheels.len()],
            noisy: Vec::new(),
        };
        for run in runs {
            let label = labels.get(&run.id).ok_or(LearnError::Label(run.id))?;
            let all = observations(run, robot, model);
            let between = |from: f64, to: f64| -> Segment {
                let at = |observation: &&Observation| {
                    let first = observation.t_first_ns as f64 * 1e-9;
                    first >= from && observation.t_ns as f64 * 1e-9 <= to
                };
                all.iter().filter(at).copied().collect()
            };
            let onset = label.onset_s.unwrap_or(f64::INFINITY);
            out.nominal.push(between(SETTLE_S, onset));
            out.nominal_runs += usize::from(label.is_nominal());
            let Some(wheel) = label.wheel.filter(|_| !label.is_nominal()) else {
                continue;
            };
            let after = between(onset + SETTLE_S, f64::INFINITY);
            match label.kind.as_str() {
                "stuck" => out.stuck[wheel].push(after),
                "noise" => out.noisy.push((wheel, after)),
                _ => {}
            }
        }
        Ok(out)
    }

    /// Drops what a fit cannot use: pieces in which the robot stands or that are too short.
    pub fn drop_unmoved(&mut self) {
        let keep = |segment: &Segment| segment.iter().filter(|o| o.moving).count() >= 10;
        self.nominal.retain(keep);
        for stuck in &mut self.stuck {
            stuck.retain(keep);
        }
    }

    /// Pieces with `wheel` stuck, and mirrored those with the wheel opposite stuck, if any.
    #[must_use]
    pub fn stuck_pooled(&self, wheel: usize, robot: &Description) -> Vec<Segment> {
        let mut pooled = self.stuck[wheel].clone();
        let Some(mirror) = mirror(robot) else {
            return pooled;
        };
        if mirror[wheel] != wheel {
            let opposite = self.stuck[mirror[wheel]].iter();
            pooled.extend(opposite.map(|segment| mirrored(segment, &mirror)));
        }
        pooled
    }
}

/// For every wheel the one on the other side; None if the robot is not symmetric.
#[must_use]
pub fn mirror(robot: &Description) -> Option<Vec<usize>> {
    robot
        .wheels
        .iter()
        .map(|wheel| {
            robot.wheels.iter().position(|other| {
                let apart = (other.x - wheel.x).abs().max((other.y + wheel.y).abs());
                apart < 1e-6 && other.steered == wheel.steered
            })
        })
        .collect()
}

/// The same piece seen in a mirror: left and right exchanged.
fn mirrored(segment: &Segment, mirror: &[usize]) -> Segment {
    segment
        .iter()
        .map(|observation| {
            let mut out = *observation;
            out.curvature = -out.curvature;
            out.command[0] = -out.command[0];
            out.pose[1] = -out.pose[1];
            out.pose[2] = -out.pose[2];
            for (i, &opposite) in mirror.iter().enumerate() {
                out.wheels[i] = observation.wheels[opposite];
                out.steer[i] = observation.steer[opposite];
                out.steer[i].mean = -out.steer[i].mean;
            }
            out
        })
        .collect()
}

//! Is a model's prediction of what missions bring near enough to what they brought?

use super::record::Record;
use crate::belief::Tracker;
use crate::model::Pomdp;
use crate::simulation::Summary;

/// A prediction may be off by this share of what was measured.
pub const ERROR_MAX: f64 = 0.2;

/// A model that is not to be deployed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "not to be deployed: the model predicts a mean reward of {predicted:.6} where {measured:.6} \
     was measured, off by {percent:.1} %; allowed are {allowed:.0} %",
    percent = 100.0 * .error, allowed = 100.0 * ERROR_MAX
)]
pub struct Refusal {
    /// What the model predicts, discounted reward of a mission.
    pub predicted: f64,
    /// What was measured.
    pub measured: f64,
    /// |predicted - measured| / |measured|.
    pub error: f64,
}

/// |predicted - measured| / |measured|, if it is at most [`ERROR_MAX`].
///
/// # Errors
/// [`Refusal`], also if one of the numbers is not finite.
pub fn within(predicted: f64, measured: f64) -> Result<f64, Refusal> {
    let difference = (predicted - measured).abs();
    let error = if difference == 0.0 {
        0.0
    } else {
        difference / measured.abs()
    };
    if error <= ERROR_MAX {
        Ok(error)
    } else {
        Err(Refusal {
            predicted,
            measured,
            error,
        })
    }
}

/// What a model expects of recorded missions, and what they brought: discounted rewards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// Predicted, step by step, from what was observed before.
    pub predicted: Summary,
    /// Measured.
    pub measured: Summary,
    /// Missions with rewards.
    pub missions: usize,
}

/// Follows recorded missions with the model's belief: before every step the model predicts
/// sum_s b(s) R(s,a) of the action that was taken. If the model is right, the mean over many
/// missions is that of the rewards, whoever acted and by whatever rule. `None` without rewards.
#[must_use]
pub fn follow(model: &Pomdp, records: &[Record]) -> Option<Followed> {
    let mut tracker = Tracker::new(model);
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    for record in records {
        let Some(reward) = record.discounted(model.discount()) else {
            continue;
        };
        measured.push(reward);
        tracker.reset();
        let (mut sum, mut weight) = (0.0, 1.0);
        for (&action, &observation) in record.actions.iter().zip(&record.observations) {
            let action = action as usize;
            let belief = tracker.belief().iter().enumerate();
            let expected: f64 = belief.map(|(s, b)| b * model.reward(s, action)).sum();
            sum += weight * expected;
            weight *= model.discount();
            tracker.update(model, action, observation as usize);
        }
        predicted.push(sum);
    }
    (!measured.is_empty()).then(|| Followed {
        missions: measured.len(),
        predicted: Summary::of(&mut predicted),
        measured: Summary::of(&mut measured),
    })
}

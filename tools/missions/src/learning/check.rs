//! Is a model's prediction of what missions bring near enough to what they brought?

use super::record::Record;
use crate::simulation::{PairedDifference, Summary};
use vigil_pomdp::Pomdp;
use vigil_pomdp::Tracker;

/// A prediction may be off by this share of what was measured.
pub const ERROR_MAX: f64 = 0.2;

/// A model that is not to be deployed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "not to be deployed: the model predicts a mean reward of {predicted:.6} where {measured:.6} \
     was measured, off by {percent:.1} %; allowed are {allowed:.0} % and the {half_width:.6} by \
     which chance may set them apart (95 %)",
    percent = 100.0 * .error, allowed = 100.0 * ERROR_MAX
)]
pub struct Refusal {
    /// What the model predicts, discounted reward of a mission.
    pub predicted: f64,
    /// What was measured.
    pub measured: f64,
    /// |predicted - measured| / |measured|.
    pub error: f64,
    /// The 95 % interval of predicted - measured is that difference +- this.
    pub half_width: f64,
}

/// A prediction that nothing speaks against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// |predicted - measured| / |measured|.
    pub error: f64,
    /// True if chance alone may set the two apart by more than [`ERROR_MAX`]: there are too few
    /// missions to tell a good model from one that is to be refused.
    pub is_weak: bool,
}

/// Refuses a prediction whose error exceeds [`ERROR_MAX`] of the measured reward plus `half_width`,
/// half the 95 % interval of their difference.
///
/// # Errors
/// [`Refusal`], also if one of the numbers is not finite.
pub fn within(predicted: f64, measured: f64, half_width: f64) -> Result<Agreement, Refusal> {
    let difference = (predicted - measured).abs();
    let error = if difference == 0.0 {
        0.0
    } else {
        difference / measured.abs()
    };
    let allowed = ERROR_MAX * measured.abs();
    if difference <= allowed + half_width && half_width.is_finite() {
        Ok(Agreement {
            error,
            is_weak: half_width > allowed,
        })
    } else {
        Err(Refusal {
            predicted,
            measured,
            error,
            half_width,
        })
    }
}

/// What a model expects of recorded missions, and what they brought: discounted rewards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RewardCheck {
    /// Predicted, step by step, from what was observed before.
    pub predicted: Summary,
    /// Measured.
    pub measured: Summary,
    /// The 95 % interval of the means' difference is that +- this: in pairs, mission by mission.
    pub half_width: f64,
    /// Missions with rewards.
    pub missions: usize,
}

impl RewardCheck {
    /// [`within`].
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn check(&self) -> Result<Agreement, Refusal> {
        within(self.predicted.mean, self.measured.mean, self.half_width)
    }
}

/// Follows recorded missions with the model's belief: before every step the model predicts
/// sum_s b(s) R(s,a) of the action that was taken. If the model is right, the mean over many
/// missions is that of the rewards, whoever acted and by whatever rule. `None` without rewards.
#[must_use]
pub fn follow(model: &Pomdp, records: &[Record]) -> Option<RewardCheck> {
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
    (!measured.is_empty()).then(|| RewardCheck {
        missions: measured.len(),
        half_width: PairedDifference::new(&predicted, &measured).half_width,
        predicted: Summary::new(&mut predicted),
        measured: Summary::new(&mut measured),
    })
}

//! Evidence from recorded missions whose true states are known.
//!
//! Counted are only steps in which evidence may come: the true state after them is a new one, and
//! the robot moves.
//!
//! - `sees` of an action: the share of its steps whose evidence speaks for the truth.
//! - `evidence.confused`: steps that speak for something else, over those that speak for the truth.
//! - `evidence.settles_1_s`: the share of steps from a new state that end in the settled one.
//!
//! How often faults arise, pass and join is not counted: missions for this are drawn with trouble
//! in them. Prices are the user's.

use vigil_pomdp::Pomdp;

use super::parameters::{NEW, Parameters};
use crate::counting::{Count, Fit, FittedChances};
use crate::learning::Record;

/// A step of a robot that moves, to a known state.
struct Step<'a> {
    before: Option<&'a str>,
    after: &'a str,
    action: &'a str,
    observed: &'a str,
}

impl Step<'_> {
    /// True while evidence of what is true may come.
    fn is_new(&self) -> bool {
        self.after.ends_with(NEW)
    }

    /// True if the evidence speaks for the truth.
    fn is_right(&self) -> bool {
        self.observed == self.after
    }

    /// True if it speaks for something else.
    fn is_wrong(&self) -> bool {
        self.observed.ends_with(NEW) && !self.is_right()
    }

    /// True if what was new has stayed, new or settled.
    fn has_stayed(&self) -> bool {
        let before = self.before.and_then(|before| before.strip_suffix(NEW));
        before == Some(self.after.strip_suffix(NEW).unwrap_or(self.after))
    }
}

/// Fits checked parameters to records of the model that they make; what they say counts as `weight`
/// visits.
#[must_use]
pub fn fit(
    parameters: &Parameters,
    model: &Pomdp,
    records: &[Record],
    weight: f64,
) -> Fit<Parameters> {
    let steps: Vec<Step<'_>> = records
        .iter()
        .flat_map(|record| steps(parameters, model, record))
        .collect();
    let mut fitted = parameters.clone();
    let mut chances = FittedChances::new(weight);
    for action in &mut fitted.action {
        let is_visit = |step: &Step<'_>| step.action == action.name && step.is_new();
        let count = Count::among(&steps, is_visit, Step::is_right);
        chances.set(format!("{}: sees", action.name), &mut action.sees, count);
    }
    let (right, wrong) = (
        Count::among(&steps, Step::is_new, Step::is_right).k,
        Count::among(&steps, Step::is_new, Step::is_wrong).k,
    );
    let evidence = &mut fitted.evidence;
    let confused = Count {
        k: wrong.min(right),
        n: right,
    };
    chances.set("confused".to_owned(), &mut evidence.confused, confused);
    let settled = Count::among(&steps, Step::has_stayed, |step| !step.is_new());
    let mut settles = evidence.settles_1_s * parameters.epoch_s;
    chances.set("settles, a step".to_owned(), &mut settles, settled);
    evidence.settles_1_s = settles / parameters.epoch_s;
    bound_what_is_seen(&mut fitted);
    Fit {
        chances: chances.finish(),
        steps: steps.len(),
        parameters: fitted,
    }
}

/// What speaks for the truth and for something else may sum to more than 1, as each is counted
/// apart: then it always speaks.
fn bound_what_is_seen(parameters: &mut Parameters) {
    let most = 1.0 / (1.0 + parameters.evidence.confused);
    for action in &mut parameters.action {
        action.sees = action.sees.min(most);
    }
}

/// The steps of a record to known states in which the robot moves.
fn steps<'a>(parameters: &Parameters, model: &'a Pomdp, record: &Record) -> Vec<Step<'a>> {
    let name = |label: Option<u32>| model.states().get(label? as usize).map(String::as_str);
    let moves = |name: &str| {
        let mut actions = parameters.action.iter();
        actions.any(|action| action.name == name && action.speed_scale > 0.0)
    };
    let labels = record.labels.iter().zip(record.labels.iter().skip(1));
    let taken = record.actions.iter().zip(&record.observations);
    let step = |((before, after), (action, observation)): ((&Option<u32>, &Option<u32>), _)| {
        let (action, observation): (&u32, &u32) = (action, observation);
        let action = model.actions().get(*action as usize)?;
        moves(action).then_some(Step {
            before: name(*before),
            after: name(*after)?,
            action,
            observed: model.observations().get(*observation as usize)?,
        })
    };
    labels.zip(taken).filter_map(step).collect()
}

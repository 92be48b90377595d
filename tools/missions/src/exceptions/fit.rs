//! Parameters from recorded missions whose states are known.
//!
//! Each number is a chance, and is counted.
//!
//! - *Transitions*: kind by kind, as the kinds are independent. What arises and passes by itself is
//!   counted under the actions that follow the path for a whole step; what an action mends is what
//!   goes beyond that.
//! - *Symptoms*: where one exception is there alone, or none, under the actions that show them all
//!   (`shows = 1`) and do not remedy it.
//! - *Outcomes*: the same, under the actions that report them.
//! - *Shows*: of each action that shows a share, the symptoms seen over those to expect.

use std::collections::BTreeMap;

use vigil_pomdp::Pomdp;

use super::parameters::{Action, Exception, Parameters, Signs};
use crate::counting::{Count, Fit, FittedChances};
use crate::learning::Record;

/// A step between two known states.
struct Step<'a> {
    before: Vec<&'a Exception>,
    after: Vec<&'a Exception>,
    action: &'a Action,
    /// Symptoms and outcome.
    observed: Vec<&'a str>,
}

impl Step<'_> {
    fn before(&self, kind: &str) -> Option<&str> {
        of_kind(&self.before, kind)
    }

    fn after(&self, kind: &str) -> Option<&str> {
        of_kind(&self.after, kind)
    }

    /// True for a step of following the path as long as any.
    fn is_whole(&self) -> bool {
        self.action.follows && self.action.lasts == 1.0
    }

    fn sees(&self, name: &str) -> bool {
        self.observed.contains(&name)
    }

    /// True if `exception` alone is there, or nothing for `None`, and shows itself.
    fn shows_alone(&self, exception: Option<&str>) -> bool {
        let alone: Vec<&str> = self.after.iter().map(|e| e.name.as_str()).collect();
        let is_remedied = |name: &&str| self.action.remedies.iter().any(|of| of == name);
        alone == Vec::from_iter(exception) && !alone.iter().any(is_remedied)
    }
}

fn of_kind<'a>(set: &[&'a Exception], kind: &str) -> Option<&'a str> {
    let of_kind = set.iter().find(|e| e.kind == kind);
    of_kind.map(|e| e.name.as_str())
}

/// The fit as it grows.
struct Fitter<'a> {
    steps: &'a [Step<'a>],
    chances: FittedChances,
}

impl Fitter<'_> {
    fn signs(&mut self, signs: &mut Signs, exception: Option<&str>) {
        let key = |of: &str, name: &str| format!("{}: {of} {name}", exception.unwrap_or("nominal"));
        let steps = self.steps;
        for (name, p) in &mut signs.symptoms {
            let is_visit =
                |step: &Step<'_>| step.shows_alone(exception) && step.action.shows == 1.0;
            let count = Count::among(steps, is_visit, |step| step.sees(name));
            self.chances.set(key("symptom", name), p, count);
        }
        for (name, p) in &mut signs.outcomes {
            let is_visit =
                |step: &Step<'_>| step.shows_alone(exception) && step.action.reports.contains(name);
            let count = Count::among(steps, is_visit, |step| step.sees(name));
            self.chances.set(key("outcome", name), p, count);
        }
    }

    fn arises(&mut self, exception: &mut Exception) {
        let (name, kind) = (exception.name.as_str(), exception.kind.as_str());
        let is_visit = |step: &Step<'_>| step.before(kind).is_none() && step.is_whole();
        let count = Count::among(self.steps, is_visit, |step| step.after(kind) == Some(name));
        let key = format!("{name}: arises");
        self.chances.set(key, &mut exception.arises, count);
    }

    fn passes(&mut self, exception: &mut Exception) {
        let (name, kind) = (exception.name.as_str(), exception.kind.as_str());
        let (mended, turns) = (&exception.mended, &exception.turns);
        let is_visit = |step: &Step<'_>| {
            let action = &step.action.name;
            let is_plain = !mended.contains_key(action) && !turns.contains_key(action);
            step.before(kind) == Some(name) && step.is_whole() && is_plain
        };
        let count = Count::among(self.steps, is_visit, |step| step.after(kind).is_none());
        let key = format!("{name}: passes");
        self.chances.set(key, &mut exception.passes, count);
    }

    /// What is gone has passed or was mended: 1 - (1 - mended) (1 - passes).
    fn mended(&mut self, exception: &mut Exception) {
        let (name, kind) = (exception.name.as_str(), exception.kind.as_str());
        for (action, mended) in &mut exception.mended {
            let lasts = self.lasts(action);
            let passes = 1.0 - (1.0 - exception.passes).powf(lasts);
            let is_visit =
                |step: &Step<'_>| step.before(kind) == Some(name) && step.action.name == *action;
            let gone = Count::among(self.steps, is_visit, |step| step.after(kind).is_none());
            // Of those that did not pass by themselves.
            let n = gone.n * (1.0 - passes);
            let k = (gone.k - gone.n * passes).clamp(0.0, n);
            let key = format!("{name}: mended by {action}");
            self.chances.set(key, mended, Count { k, n });
        }
    }

    fn lasts(&self, action: &str) -> f64 {
        let mut steps = self.steps.iter();
        steps
            .find_map(|s| (s.action.name == action).then_some(s.action.lasts))
            .unwrap_or(1.0)
    }

    fn turns(&mut self, exception: &mut Exception) {
        let (name, kind) = (exception.name.as_str(), exception.kind.as_str());
        for (action, turns) in &mut exception.turns {
            for (other, p) in turns {
                let is_visit = |step: &Step<'_>| {
                    let stays = step.before(kind) == Some(name) && step.after(kind).is_some();
                    stays && step.action.name == *action
                };
                let is_so = |step: &Step<'_>| step.after(kind) == Some(other.as_str());
                let count = Count::among(self.steps, is_visit, is_so);
                let key = format!("{name}: turned into {other} by {action}");
                self.chances.set(key, p, count);
            }
        }
    }

    /// Symptoms that were seen under an action over those to expect were all shown; `expected`
    /// gives each exception's chance of each symptom.
    fn shows(&mut self, action: &mut Action, expected: &BTreeMap<&str, &Signs>, nominal: &Signs) {
        if action.shows == 1.0 {
            return;
        }
        let (mut seen, mut to_expect) = (0.0, 0.0);
        for step in self.steps.iter().filter(|s| s.action.name == action.name) {
            let signs = match step.after.as_slice() {
                [] => nominal,
                [one] if step.shows_alone(Some(&one.name)) => match expected.get(one.name.as_str())
                {
                    Some(signs) => signs,
                    None => continue,
                },
                _ => continue,
            };
            for (name, p) in &signs.symptoms {
                to_expect += p;
                seen += f64::from(u8::from(step.sees(name)));
            }
        }
        let count = Count {
            k: seen.min(to_expect),
            n: to_expect,
        };
        let key = format!("{}: shows", action.name);
        self.chances.set(key, &mut action.shows, count);
    }
}

/// Fits checked parameters to records of the model that they make; `weight` is K.
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
    let mut fitter = Fitter {
        steps: &steps,
        chances: FittedChances::new(weight),
    };
    fitter.signs(&mut fitted.nominal, None);
    for exception in &mut fitted.exceptions {
        let name = exception.name.clone();
        fitter.arises(exception);
        fitter.passes(exception);
        fitter.mended(exception);
        fitter.turns(exception);
        fitter.signs(&mut exception.signs, Some(&name));
    }
    let exceptions = fitted.exceptions.iter();
    let expected = exceptions.map(|e| (e.name.as_str(), &e.signs)).collect();
    for action in &mut fitted.actions {
        fitter.shows(action, &expected, &fitted.nominal);
    }
    Fit {
        chances: fitter.chances.finish(),
        steps: steps.len(),
        parameters: fitted,
    }
}

/// The steps of a record between known states.
fn steps<'a>(parameters: &'a Parameters, model: &'a Pomdp, record: &Record) -> Vec<Step<'a>> {
    let set = |label: Option<u32>| -> Option<Vec<&'a Exception>> {
        let name = model.states().get(label? as usize)?;
        let find = |part: &str| parameters.exceptions.iter().find(|e| e.name == part);
        Some(name.split('-').filter_map(find).collect())
    };
    let labels = record.labels.iter().zip(record.labels.iter().skip(1));
    let taken = record.actions.iter().zip(&record.observations);
    let step = |((before, after), (action, observation)): ((&Option<u32>, &Option<u32>), _)| {
        let (action, observation): (&u32, &u32) = (action, observation);
        let observed = model.observations().get(*observation as usize)?;
        let name = model.actions().get(*action as usize)?;
        Some(Step {
            before: set(*before)?,
            after: set(*after)?,
            action: parameters.actions.iter().find(|a| a.name == *name)?,
            observed: observed.split('_').collect(),
        })
    };
    labels.zip(taken).filter_map(step).collect()
}

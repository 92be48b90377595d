//! The parameter file of a model of exceptions.

use std::collections::BTreeMap;
use std::ops::Bound;

use serde::{Deserialize, Serialize};

use crate::parameter_number::{self, NumberError, out_of_range};

/// What the sum of chances may be off: many chances are added up.
const SUM_ROUNDING: f64 = 1e-9;

/// Longest action, in steps.
const LASTS_MAX: f64 = 100.0;

/// Everything that the model is made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// What the file is for: `exceptions`.
    pub model: String,
    /// Discount per decision step, 0 to below 1.
    pub discount: f64,
    /// So many exceptions at once, 1 or more; what would arise besides does not.
    pub at_once_max: usize,
    /// How long a task takes a robot of which nothing is wrong, in steps, 1 or more: then the next
    /// begins as the first did, with a robot that was mended. Without it a task has no end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task_steps: Option<f64>,
    /// Symptoms; those of one list exclude each other.
    pub symptoms: Vec<Vec<String>>,
    /// What a robot shows of which nothing is wrong.
    pub nominal: Signs,
    /// What may be done.
    #[serde(rename = "action")]
    pub actions: Vec<Action>,
    /// What may be wrong.
    #[serde(rename = "exception")]
    pub exceptions: Vec<Exception>,
}

/// What is seen, each with its chance per step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Signs {
    /// Symptoms, whatever is done.
    pub symptoms: BTreeMap<String, f64>,
    /// Outcomes, of the actions that report them.
    pub outcomes: BTreeMap<String, f64>,
}

/// An action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Action {
    /// Its name.
    pub name: String,
    /// Share of the speed at which it moves the robot, 0 to 1.
    #[serde(default)]
    pub speed_scale: f64,
    /// How long it lasts, in steps, above 0: so much longer things have time to arise and to pass.
    #[serde(default = "all")]
    pub lasts: f64,
    /// Share of its symptoms that an exception shows while the action lasts, 0 to 1. A robot that
    /// stands for a second shows little of a wrong heading.
    #[serde(default = "all")]
    pub shows: f64,
    /// What it costs, from 0.
    #[serde(default)]
    pub price: f64,
    /// It follows the path: it earns its speed while nothing is wrong.
    #[serde(default)]
    pub follows: bool,
    /// Exceptions whose effect it takes away while it lasts.
    #[serde(default)]
    pub remedies: Vec<String>,
    /// What it costs besides where none of these is there, from 0.
    #[serde(default)]
    pub needless_price: f64,
    /// Outcomes that it may report, one at a time.
    #[serde(default)]
    pub reports: Vec<String>,
    /// It ends the task: the next begins.
    #[serde(default)]
    pub ends: bool,
}

const fn all() -> f64 {
    1.0
}

/// An exception. Those of one kind exclude each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exception {
    /// Its name. Of hardware, a name that the fault tree gives, or `UNKNOWN` and the like.
    pub name: String,
    /// What it is an exception of: the way, the place, the hardware.
    pub kind: String,
    /// Chance per step that it arises, 0 to 1.
    #[serde(default)]
    pub arises: f64,
    /// Chance per step that it passes by itself, 0 to 1.
    #[serde(default)]
    pub passes: f64,
    /// Chance that an action mends it, 0 to 1, by the action's name.
    #[serde(default)]
    pub mended: BTreeMap<String, f64>,
    /// Into which others of its kind an action turns what it has not mended, with their chances.
    #[serde(default)]
    pub turns: BTreeMap<String, BTreeMap<String, f64>>,
    /// What following the path earns instead, in units of what a nominal robot makes in one step.
    #[serde(default)]
    pub follow: Option<f64>,
    /// What moving costs at full speed, from 0, in those units.
    #[serde(default)]
    pub price: f64,
    /// The same under an action that remedies it.
    #[serde(default)]
    pub remedied_price: f64,
    /// What is seen.
    #[serde(flatten)]
    pub signs: Signs,
}

/// A parameter that means nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// A number is out of range, or chances add up to more than 1.
    #[error(transparent)]
    Number(#[from] NumberError),
    /// A name that nothing has.
    #[error("{key}: there is no '{found}'; allowed are {allowed}")]
    Unknown {
        /// Key in the file.
        key: String,
        /// Name that was given.
        found: String,
        /// Names that there are.
        allowed: String,
    },
    /// A list without entries, or without the action that follows the path.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// The model that follows is none.
    #[error("{0}")]
    Process(#[from] vigil_pomdp::ProcessError),
}

impl Parameters {
    /// Checks names, ranges and sums.
    ///
    /// # Errors
    /// The first [`ParameterError`].
    pub fn check(&self) -> Result<(), ParameterError> {
        range("discount", self.discount, 0.0..1.0, "0 to below 1")?;
        if self.at_once_max == 0 {
            return Err(ParameterError::Missing("at_once_max of 1 or more"));
        }
        if let Some(steps) = self.task_steps {
            range("task_steps", steps, 1.0..f64::INFINITY, "any number from 1")?;
        }
        if !self.actions.iter().any(|action| action.follows) {
            return Err(ParameterError::Missing("an action that follows the path"));
        }
        if self.exceptions.is_empty() {
            return Err(ParameterError::Missing("[[exception]]"));
        }
        for action in &self.actions {
            self.check_action(action)?;
        }
        self.check_signs("nominal", &self.nominal)?;
        for exception in &self.exceptions {
            self.check_exception(exception)?;
        }
        for kind in self.kinds() {
            let of_kind = self.exceptions.iter().filter(|e| e.kind == kind);
            at_most_one(
                &format!("arises of {kind}"),
                of_kind.map(|e| e.arises).sum(),
            )?;
        }
        Ok(())
    }

    /// The kinds of exceptions, in the order of the file.
    #[must_use]
    pub fn kinds(&self) -> Vec<&str> {
        let mut kinds: Vec<&str> = Vec::new();
        for exception in &self.exceptions {
            if !kinds.contains(&exception.kind.as_str()) {
                kinds.push(&exception.kind);
            }
        }
        kinds
    }

    fn check_action(&self, action: &Action) -> Result<(), ParameterError> {
        let key = |of: &str| format!("action {}: {of}", action.name);
        range(&key("speed_scale"), action.speed_scale, 0.0..=1.0, "0 to 1")?;
        let lasts = action.lasts;
        let above = (Bound::Excluded(0.0), Bound::Included(LASTS_MAX));
        range(&key("lasts"), lasts, above, "above 0, at most 100")?;
        range(&key("shows"), action.shows, 0.0..=1.0, "0 to 1")?;
        range(
            &key("price"),
            action.price,
            0.0..f64::INFINITY,
            "any number from 0",
        )?;
        let price = action.needless_price;
        range(
            &key("needless_price"),
            price,
            0.0..f64::INFINITY,
            "any number from 0",
        )?;
        let names: Vec<&str> = self.exceptions.iter().map(|e| e.name.as_str()).collect();
        let remedies = action.remedies.iter();
        remedies
            .into_iter()
            .try_for_each(|name| known(&key("remedies"), name, &names))
    }

    fn check_exception(&self, exception: &Exception) -> Result<(), ParameterError> {
        let key = |of: &str| format!("exception {}: {of}", exception.name);
        let probability = |of: &str, p| range(&key(of), p, 0.0..=1.0, "0 to 1");
        probability("arises", exception.arises)?;
        probability("passes", exception.passes)?;
        if let Some(found) = exception.follow.filter(|found| !found.is_finite()) {
            return Err(out_of_range(&key("follow"), found, "any number").into());
        }
        for (of, price) in [
            ("price", exception.price),
            ("remedied_price", exception.remedied_price),
        ] {
            range(&key(of), price, 0.0..f64::INFINITY, "any number from 0")?;
        }
        let actions: Vec<&str> = self.actions.iter().map(|a| a.name.as_str()).collect();
        for (action, p) in &exception.mended {
            known(&key("mended"), action, &actions)?;
            probability("mended", *p)?;
        }
        let same = self.exceptions.iter().filter(|e| e.kind == exception.kind);
        let others: Vec<&str> = same.map(|e| e.name.as_str()).collect();
        for (action, turns) in &exception.turns {
            known(&key("turns"), action, &actions)?;
            for (other, p) in turns {
                known(&key("turns"), other, &others)?;
                probability("turns", *p)?;
            }
            at_most_one(&key("turns"), turns.values().sum())?;
        }
        self.check_signs(&format!("exception {}", exception.name), &exception.signs)
    }

    fn check_signs(&self, of: &str, signs: &Signs) -> Result<(), ParameterError> {
        let symptoms: Vec<&str> = self.symptoms.iter().flatten().map(String::as_str).collect();
        let reported = self.actions.iter().flat_map(|action| &action.reports);
        let outcomes: Vec<&str> = reported.map(String::as_str).collect();
        for (key, table, names) in [
            ("symptoms", &signs.symptoms, &symptoms),
            ("outcomes", &signs.outcomes, &outcomes),
        ] {
            let key = format!("{of}: {key}");
            for (name, p) in table {
                known(&key, name, names)?;
                range(&key, *p, 0.0..=1.0, "0 to 1")?;
            }
        }
        let sum = |names: &[String], table: &BTreeMap<String, f64>| -> f64 {
            names.iter().filter_map(|name| table.get(name)).sum()
        };
        for names in &self.symptoms {
            at_most_one(&format!("{of}: symptoms"), sum(names, &signs.symptoms))?;
        }
        for action in &self.actions {
            let reports = sum(&action.reports, &signs.outcomes);
            at_most_one(&format!("{of}: outcomes of {}", action.name), reports)?;
        }
        Ok(())
    }
}

fn range(
    key: &str,
    found: f64,
    range: impl std::ops::RangeBounds<f64>,
    allowed: &'static str,
) -> Result<(), ParameterError> {
    match range.contains(&found) {
        true => Ok(()),
        false => Err(out_of_range(key, found, allowed).into()),
    }
}

fn known(key: &str, found: &str, names: &[&str]) -> Result<(), ParameterError> {
    match names.contains(&found) {
        true => Ok(()),
        false => Err(ParameterError::Unknown {
            key: key.to_owned(),
            found: found.to_owned(),
            allowed: names.join(", "),
        }),
    }
}

fn at_most_one(key: &str, sum: f64) -> Result<(), ParameterError> {
    Ok(parameter_number::at_most_one(key, sum, SUM_ROUNDING)?)
}

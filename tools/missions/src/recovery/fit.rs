//! Evidence from recorded missions whose true states are known.
//!
//! Counted are steps in which the robot moves and an alarm stands. They are cut into rows: one
//! begins with an alarm, or with a change of what is wrong. In a row evidence may come until it
//! settles, which nobody sees.
//!
//! - What is new settles in a step with chance q, but not in the step in which it changes. If it
//!   has not, the step says something with a chance of its action.
//! - Of what is said a share, the same for all actions, speaks for something else.
//!
//! These chances are found by expectation maximisation (Dempster, Laird and Rubin 1977). How many
//! of the steps after the last evidence were still new is expected from the chances. Then they are
//! counted anew, until both agree.
//!
//! - A row ends where nothing has been said for [`QUIET_S`]: evidence that comes later is news, and
//!   opens another one.
//! - How often faults arise, pass and join is not counted: missions for this are drawn with trouble
//!   in them. Prices are the user's.

use vigil_decision::state_names::NEW;
use vigil_pomdp::Pomdp;

use super::parameters::Parameters;
use crate::counting::{Count, Fit, FittedChances};
use crate::learning::Record;

/// So long without evidence, and what comes later is news. Chosen: several times as long as
/// evidence takes to settle; longer, and one late word makes a long row of steps new.
const QUIET_S: f64 = 1.0;
/// Rounds of counting, at most: a tenth of these is usual.
const ROUNDS_MAX: usize = 500;
/// Chances that change by less are found.
const CONVERGED: f64 = 1e-9;
/// No step settles more often: a step may leave a state once, and other rates need room.
const SETTLES_MAX: f64 = 0.9;

/// What the evidence of a step speaks for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Word {
    None,
    Truth,
    Other,
}

/// A step: its action, as an index of the parameters', and its evidence.
#[derive(Debug, Clone, Copy)]
struct Step {
    action: usize,
    word: Word,
    /// False in the step in which what is wrong changes.
    may_settle: bool,
}

/// Steps in a row, from something new on.
#[derive(Debug, Clone, Default)]
struct Row {
    /// Up to the last evidence, all of it new.
    told: Vec<Step>,
    /// Without evidence since.
    quiet: Vec<Step>,
}

impl Row {
    fn push(&mut self, step: Step) {
        self.quiet.push(step);
        if step.word != Word::None {
            self.told.append(&mut self.quiet);
        }
    }

    fn is_over(&self, quiet_max: usize) -> bool {
        self.quiet.len() >= quiet_max
    }
}

/// Chances as they are found.
#[derive(Debug, Clone, PartialEq)]
struct Chances {
    /// For each action, that a step says something.
    says: Vec<f64>,
    /// That it speaks for something else if it does.
    other: f64,
    /// That what is new settles in a step.
    settles: f64,
}

impl Chances {
    fn new(parameters: &Parameters) -> Self {
        let confused = parameters.evidence.confused;
        let says = |sees: f64| (sees * (1.0 + confused)).min(1.0);
        let settles = parameters.evidence.settles_1_s * parameters.epoch_s;
        Self {
            says: parameters.action.iter().map(|it| says(it.sees)).collect(),
            other: confused / (1.0 + confused),
            settles: settles.min(SETTLES_MAX),
        }
    }

    /// Writes what was visited into parameters.
    fn write(&self, counts: &Counts, parameters: &mut Parameters) {
        let evidence = &mut parameters.evidence;
        if counts.other.n > 0.0 {
            // A parameter file allows a ratio of 1.
            evidence.confused = (self.other / (1.0 - self.other)).min(1.0);
        }
        if counts.settles.n > 0.0 {
            evidence.settles_1_s = self.settles / parameters.epoch_s;
        }
        let actions = parameters.action.iter_mut().zip(&self.says);
        for ((action, says), count) in actions.zip(&counts.says) {
            if count.n > 0.0 {
                action.sees = says / (1.0 + evidence.confused);
            }
            // What was never visited may leave too little room for what is confused.
            action.sees = action.sees.min(1.0 / (1.0 + evidence.confused));
        }
    }

    fn largest_change(&self, other: &Self) -> f64 {
        let all = |of: &Self| {
            let says = of.says.clone().into_iter();
            says.chain([of.other, of.settles])
        };
        let changes = all(self).zip(all(other));
        changes.fold(0.0, |most, (one, other)| most.max((one - other).abs()))
    }
}

/// How often it was so, as expected.
#[derive(Debug, Clone, Default)]
struct Counts {
    says: Vec<Count>,
    /// Of all evidence.
    other: Count,
    settles: Count,
}

impl Counts {
    fn expected(rows: &[Row], chances: &Chances) -> Self {
        let mut counts = Self {
            says: vec![Count::default(); chances.says.len()],
            ..Self::default()
        };
        for row in rows {
            for step in &row.told {
                counts.add_new(*step, 1.0);
            }
            counts.add_quiet(row, chances);
        }
        counts
    }

    /// A step that was still new, by its probability.
    fn add_new(&mut self, step: Step, p: f64) {
        if step.may_settle {
            self.settles.n += p;
        }
        let says = &mut self.says[step.action];
        says.n += p;
        if step.word != Word::None {
            says.k += p;
            self.other.n += p;
        }
        if step.word == Word::Other {
            self.other.k += p;
        }
    }

    /// After the last evidence it settled in one of the steps, or in none.
    fn add_quiet(&mut self, row: &Row, chances: &Chances) {
        let mut still_new = 1.0;
        let mut settled = Vec::with_capacity(row.quiet.len());
        for step in &row.quiet {
            let settles = if step.may_settle {
                chances.settles
            } else {
                0.0
            };
            settled.push(still_new * settles);
            still_new *= (1.0 - settles) * (1.0 - chances.says[step.action]);
        }
        let sum = still_new + settled.iter().sum::<f64>();
        // Held impossible by the chances: nothing is expected of it.
        if sum <= 0.0 {
            return;
        }
        let mut new = 1.0;
        for (step, settled) in row.quiet.iter().zip(settled) {
            let p = settled / sum;
            new -= p;
            self.settles.k += p;
            self.settles.n += p;
            self.add_new(*step, new.max(0.0));
        }
    }

    /// The chances that these counts make, with those by hand worth `weight` visits.
    fn chances(&self, by_hand: &Chances, weight: f64) -> Chances {
        let says = by_hand.says.iter().zip(&self.says);
        Chances {
            says: says.map(|(p, count)| count.mean(*p, weight)).collect(),
            other: self.other.mean(by_hand.other, weight),
            settles: self.settles.mean(by_hand.settles, weight).min(SETTLES_MAX),
        }
    }
}

/// Fits checked parameters to records of the model that they make; what they say counts as `weight`
/// visits. States of which evidence comes and settled ones are the same in a record: which it was
/// is inferred.
#[must_use]
pub fn fit(
    parameters: &Parameters,
    model: &Pomdp,
    records: &[Record],
    weight: f64,
) -> Fit<Parameters> {
    let quiet_max = ((QUIET_S / parameters.epoch_s).ceil() as usize).max(1);
    let rows: Vec<Row> = records
        .iter()
        .flat_map(|record| rows(parameters, model, record, quiet_max))
        .collect();
    let by_hand = Chances::new(parameters);
    let mut found = by_hand.clone();
    let mut counts = Counts::expected(&rows, &found);
    for _ in 0..ROUNDS_MAX {
        let before = std::mem::replace(&mut found, counts.chances(&by_hand, weight));
        counts = Counts::expected(&rows, &found);
        if found.largest_change(&before) < CONVERGED {
            break;
        }
    }
    let mut chances = FittedChances::new(weight);
    let says = parameters.action.iter().zip(&by_hand.says);
    for ((action, says), count) in says.zip(&counts.says) {
        chances.fit_chance(format!("{}: says something", action.name), *says, *count);
    }
    let (other, settles) = (by_hand.other, by_hand.settles);
    chances.fit_chance("speaks for something else".to_owned(), other, counts.other);
    chances.fit_chance("settles in a step".to_owned(), settles, counts.settles);
    let mut fitted = parameters.clone();
    found.write(&counts, &mut fitted);
    Fit {
        chances: chances.finish(),
        steps: rows
            .iter()
            .map(|row| row.told.len() + row.quiet.len())
            .sum(),
        parameters: fitted,
    }
}

/// The rows of a record. A standing robot shows nothing, and what is wrong stays as it is.
fn rows(parameters: &Parameters, model: &Pomdp, record: &Record, quiet_max: usize) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut row = Row::default();
    let condition_of = |label: &Option<u32>| {
        let name = model.states().get((*label)? as usize)?;
        let name = name.strip_suffix(NEW).unwrap_or(name);
        // The end of a task is never new.
        let is_ever_new = model.states().contains(&format!("{name}{NEW}"));
        is_ever_new.then_some(name)
    };
    let mut condition = record.labels.first().and_then(condition_of);
    let taken = record.actions.iter().zip(&record.observations);
    for ((action, observation), label) in taken.zip(record.labels.iter().skip(1)) {
        let name = condition_of(label);
        let has_changed = name != condition;
        if has_changed {
            rows.push(std::mem::take(&mut row));
        }
        // Of an alarm that rises it is known that something may be new, and not since when.
        let may_settle = !has_changed || condition.is_none();
        condition = name;
        let (Some(name), Some(action)) = (name, moving(parameters, model, *action)) else {
            continue;
        };
        let said = model.observations().get(*observation as usize);
        let step = Step {
            action,
            may_settle,
            word: match said.and_then(|said| said.strip_suffix(NEW)) {
                None => Word::None,
                Some(said) if said == name => Word::Truth,
                Some(_) => Word::Other,
            },
        };
        match (row.is_over(quiet_max), step.word) {
            (false, _) => row.push(step),
            // What is quiet by now has no more to tell.
            (true, Word::None) => {}
            (true, _) => rows.push(std::mem::take(&mut row)),
        }
    }
    rows.push(row);
    rows.retain(|row| !row.told.is_empty() || !row.quiet.is_empty());
    rows
}

/// Which action of the parameters' it is, if the robot moves.
fn moving(parameters: &Parameters, model: &Pomdp, action: u32) -> Option<usize> {
    let name = model.actions().get(action as usize)?;
    let mut actions = parameters.action.iter();
    actions.position(|action| action.name == *name && action.speed_scale > 0.0)
}

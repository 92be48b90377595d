//! Evidence from recorded missions whose true states are known.
//!
//! Counted are steps in which the robot moves and what is wrong stays the same: in a row of them
//! evidence may come until it settles, which nobody sees. What is new settles in a step with
//! chance q; if it does not, evidence speaks for the truth with the action's chance `sees`, and
//! for something else with `sees` times `confused`. These chances are found by expectation
//! maximisation (Dempster, Laird and Rubin 1977): how many of the steps after the last evidence
//! were still new is expected from the chances, and they are counted anew, until both agree.
//!
//! - A row ends where nothing has been said for [`QUIET_S`]. Evidence that comes later opens
//!   another one: for the supervisor, too, it makes new what had settled.
//! - How often faults arise, pass and join is not counted: missions for this are drawn with trouble
//!   in them. Prices are the user's.

use vigil_pomdp::Pomdp;

use super::parameters::{NEW, Parameters};
use crate::counting::{Count, Fit, FittedChances};
use crate::learning::Record;

/// So long without evidence, and what comes later is news. Chosen: several times as long as
/// evidence takes to settle; longer, and one late word makes a long row of steps new.
const QUIET_S: f64 = 1.0;
/// Rounds of counting, at most: a tenth of these is usual.
const ROUNDS_MAX: usize = 500;
/// Chances that change by less are found.
const CONVERGED: f64 = 1e-9;
/// A step may end in no more than this with another state, so that other rates have room.
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
    sees: Vec<f64>,
    confused: f64,
    settles: f64,
}

/// How often it was so, as expected.
#[derive(Debug, Clone, Default)]
struct Counts {
    sees: Vec<Count>,
    /// Of all evidence, what speaks for something else.
    other: Count,
    settles: Count,
}

impl Counts {
    fn expected(rows: &[Row], chances: &Chances) -> Self {
        let mut counts = Self {
            sees: vec![Count::default(); chances.sees.len()],
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
        self.settles.n += p;
        let sees = &mut self.sees[step.action];
        sees.n += p;
        match step.word {
            Word::None => {}
            Word::Truth => {
                sees.k += p;
                self.other.n += p;
            }
            Word::Other => {
                self.other.k += p;
                self.other.n += p;
            }
        }
    }

    /// After the last evidence it settled in one of the steps, or in none.
    fn add_quiet(&mut self, row: &Row, chances: &Chances) {
        let says = |step: &Step| (chances.sees[step.action] * (1.0 + chances.confused)).min(1.0);
        let mut still_new = 1.0;
        let mut settled = Vec::with_capacity(row.quiet.len());
        for step in &row.quiet {
            settled.push(still_new * chances.settles);
            still_new *= (1.0 - chances.settles) * (1.0 - says(step));
        }
        let sum = still_new + settled.iter().sum::<f64>();
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
        let mean = |p: f64, count: Count| match count.n + weight {
            sum if sum > 0.0 && p > 0.0 => (count.k + weight * p) / sum,
            _ => p,
        };
        let pairs = by_hand.sees.iter().zip(&self.sees);
        Chances {
            sees: pairs.map(|(p, count)| mean(*p, *count)).collect(),
            confused: ratio(mean(share(by_hand.confused), self.other)),
            settles: mean(by_hand.settles, self.settles).min(SETTLES_MAX),
        }
    }
}

/// Of all evidence the share that speaks for something else, from its ratio to the rest.
fn share(confused: f64) -> f64 {
    confused / (1.0 + confused)
}

/// The ratio, of which a parameter file allows 1.
fn ratio(share: f64) -> f64 {
    (share / (1.0 - share)).min(1.0)
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
    let by_hand = Chances {
        sees: parameters.action.iter().map(|it| it.sees).collect(),
        confused: parameters.evidence.confused,
        settles: (parameters.evidence.settles_1_s * parameters.epoch_s).min(SETTLES_MAX),
    };
    let mut found = by_hand.clone();
    let mut counts = Counts::expected(&rows, &found);
    for _ in 0..ROUNDS_MAX {
        let before = std::mem::replace(&mut found, counts.chances(&by_hand, weight));
        counts = Counts::expected(&rows, &found);
        if largest_change(&before, &found) < CONVERGED {
            break;
        }
    }
    let mut fitted = parameters.clone();
    let mut chances = FittedChances::new(weight);
    for (action, count) in fitted.action.iter_mut().zip(&counts.sees) {
        chances.set(format!("{}: sees", action.name), &mut action.sees, *count);
    }
    let mut other = share(by_hand.confused);
    let key = "evidence: confused, of all that speaks";
    chances.set(key.to_owned(), &mut other, counts.other);
    let mut settles = by_hand.settles;
    let key = "evidence: settles in a step";
    chances.set(key.to_owned(), &mut settles, counts.settles);
    fitted.evidence.confused = ratio(other);
    fitted.evidence.settles_1_s = settles.min(SETTLES_MAX) / parameters.epoch_s;
    // Each is counted apart: together they may say more than always.
    let sees_max = 1.0 / (1.0 + fitted.evidence.confused);
    for action in &mut fitted.action {
        action.sees = action.sees.min(sees_max);
    }
    Fit {
        chances: chances.finish(),
        steps: rows
            .iter()
            .map(|row| row.told.len() + row.quiet.len())
            .sum(),
        parameters: fitted,
    }
}

fn largest_change(before: &Chances, after: &Chances) -> f64 {
    let numbers = |of: &Chances| {
        let sees = of.sees.clone().into_iter();
        sees.chain([of.confused, of.settles])
    };
    let changes = numbers(before).zip(numbers(after));
    changes.fold(0.0, |most, (one, other)| most.max((one - other).abs()))
}

/// The rows of a record. A standing robot shows nothing, and what is wrong stays as it is.
fn rows(parameters: &Parameters, model: &Pomdp, record: &Record, quiet_max: usize) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut row = Row::default();
    let mut condition = None;
    let taken = record.actions.iter().zip(&record.observations);
    for ((action, observation), label) in taken.zip(record.labels.iter().skip(1)) {
        let state = label.and_then(|state| model.states().get(state as usize));
        let name = state.map(|name| name.strip_suffix(NEW).unwrap_or(name));
        // The end of a task is never new.
        let name = name.filter(|name| model.states().contains(&format!("{name}{NEW}")));
        if name != condition {
            rows.push(std::mem::take(&mut row));
            condition = name;
        }
        let (Some(name), Some(action)) = (name, moving(parameters, model, *action)) else {
            continue;
        };
        let said = model.observations().get(*observation as usize);
        let step = Step {
            action,
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

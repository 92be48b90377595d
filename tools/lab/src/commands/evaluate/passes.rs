//! Detector and identifier over the runs, once for each set of channels and filter.

use std::cell::Cell;

use vigil_diagnosis::identify::IdentifierFilter;
use vigil_evaluation::scoring::{self, Case, Contest, Entrant, Score, Taxonomy};
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;

use super::Args;
use crate::commands::offline::OfflineModels;
use vigil_terminal::CommandError;
use vigil_terminal::output::Progress;

/// What was found with one set of channels.
pub struct SensorSetResult {
    /// Its name, as `--sensors` has it.
    pub name: String,
    /// The score of the chosen filter.
    pub score: Score,
    /// The runs behind it; none unless a report is wanted.
    pub cases: Vec<Case>,
    /// Filters beside each other, if they were asked for.
    pub contest: Option<Contest>,
}

/// Everything that stays the same over the passes.
pub struct Passes<'a> {
    args: &'a Args,
    prepared: &'a OfflineModels,
    runs: &'a [(Run, Label)],
    done: Cell<usize>,
}

/// What one pass over all runs gave.
struct Pass {
    cases: Vec<Case>,
    alarm_log_odds: f64,
}

impl<'a> Passes<'a> {
    /// Over these runs.
    pub fn new(args: &'a Args, prepared: &'a OfflineModels, runs: &'a [(Run, Label)]) -> Self {
        Self {
            args,
            prepared,
            runs,
            done: Cell::new(0),
        }
    }

    /// Runs the chosen filter and the `entrants` with each set of channels.
    ///
    /// # Errors
    /// A model that does not fit.
    pub fn run(
        &self,
        sets: &[&str],
        entrants: &[IdentifierFilter],
    ) -> Result<Vec<SensorSetResult>, CommandError> {
        let chosen = self.args.filter.identifier;
        let others = entrants.iter().filter(|filter| **filter != chosen).count();
        let total = sets.len() * (1 + others) * self.runs.len();
        let progress = Progress::new("runs", total);
        let found = sets.iter().map(|set| self.set(set, entrants, &progress));
        found.collect()
    }

    fn set(
        &self,
        set: &str,
        entrants: &[IdentifierFilter],
        progress: &Progress,
    ) -> Result<SensorSetResult, CommandError> {
        let taxonomy = &self.prepared.taxonomy;
        let chosen = self.args.filter.identifier;
        let pass = self.pass(set, chosen, progress)?;
        let score = scoring::score(&pass.cases, taxonomy, pass.alarm_log_odds);
        let entrants = entrants.iter().map(|filter| match *filter == chosen {
            true => Ok(entrant(*filter, &pass, taxonomy)),
            false => Ok(entrant(
                *filter,
                &self.pass(set, *filter, progress)?,
                taxonomy,
            )),
        });
        let entrants: Vec<Entrant> = entrants.collect::<Result<_, CommandError>>()?;
        Ok(SensorSetResult {
            name: set.to_owned(),
            score,
            contest: (!entrants.is_empty()).then(|| scoring::contest(&entrants)),
            cases: match self.args.report {
                Some(_) => pass.cases,
                None => Vec::new(),
            },
        })
    }

    fn pass(
        &self,
        set: &str,
        filter: IdentifierFilter,
        progress: &Progress,
    ) -> Result<Pass, CommandError> {
        let initial = self.args.filter.initial(self.prepared, set, filter)?;
        let cases = self.runs.iter().map(|(run, label)| {
            progress.show(self.done.get());
            self.done.set(self.done.get() + 1);
            Ok(Case {
                label: label.clone(),
                verdicts: initial.verdicts(run)?,
            })
        });
        Ok(Pass {
            cases: cases.collect::<Result<_, CommandError>>()?,
            alarm_log_odds: initial.alarm_log_odds(),
        })
    }
}

fn entrant(filter: IdentifierFilter, pass: &Pass, taxonomy: &Taxonomy) -> Entrant {
    Entrant::new(&filter.to_string(), &pass.cases, taxonomy)
}

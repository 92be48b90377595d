//! The runs of a log with all values, as far as a suggestion needs them.

use std::path::Path;

use super::places::{Places, places};
use crate::ImportError;
use crate::survey::{SurveyTable, Values, survey};

/// Runs that are looked at: enough for every direction of motion, few enough to be quick.
const RUNS_MAX: usize = 24;
/// Names of a column that tells runs apart.
const RUN_COLUMNS: [&str; 5] = ["run", "run_id", "trial", "experiment", "episode"];

/// What was read.
pub(super) struct Read {
    /// Where the runs are.
    pub places: Places,
    /// Tables of each run, the same in all.
    pub runs: Vec<Vec<SurveyTable>>,
    /// Column that tells the runs of a file apart.
    pub run_column: Option<String>,
    /// What was left out.
    pub notes: Vec<String>,
}

/// Reads a log.
///
/// # Errors
/// What cannot be read.
pub(super) fn read(path: &Path) -> Result<Read, ImportError> {
    let places = places(path)?;
    let mut notes = Vec::new();
    if places.others > 0 {
        notes.push(format!(
            "{} other files fit no run and were left out",
            places.others
        ));
    }
    let step = places.found.len().div_ceil(RUNS_MAX).max(1);
    let mut runs: Vec<Vec<SurveyTable>> = Vec::new();
    for files in places.found.iter().step_by(step) {
        let mut tables = Vec::new();
        for file in files {
            tables.extend(survey(file)?.tables);
        }
        if let Some(first) = runs.first() {
            tables = like(first, tables);
        }
        runs.push(tables);
    }
    if step > 1 {
        notes.push(format!(
            "{} of {} runs were looked at",
            runs.len(),
            places.found.len()
        ));
    }
    let mut run_column = None;
    if let ([tables], false) = (runs.as_slice(), places.is_bag)
        && let [table] = tables.as_slice()
        && let Some((column, parts)) = parts(table)
    {
        runs = parts
            .into_iter()
            .take(RUNS_MAX)
            .map(|table| vec![table])
            .collect();
        run_column = Some(column);
    }
    Ok(Read {
        places,
        runs,
        run_column,
        notes,
    })
}

/// The tables of a run in the order of the first: topics by name, files as they come.
fn like(first: &[SurveyTable], mut tables: Vec<SurveyTable>) -> Vec<SurveyTable> {
    if first.iter().any(|table| table.layout.is_some()) {
        return tables;
    }
    let mut out = Vec::with_capacity(first.len());
    for wanted in first {
        let at = tables.iter().position(|table| table.name == wanted.name);
        out.push(match at {
            Some(at) => tables.swap_remove(at),
            None => SurveyTable {
                rows: 0,
                columns: Vec::new(),
                ..wanted.clone()
            },
        });
    }
    out
}

/// A table cut where a column that counts runs changes.
fn parts(table: &SurveyTable) -> Option<(String, Vec<SurveyTable>)> {
    let is_run = |column: &&Values| RUN_COLUMNS.contains(&column.name.to_lowercase().as_str());
    let column = table.columns.iter().find(is_run)?;
    let mut starts = vec![0];
    let changes = column.values.windows(2).enumerate();
    starts.extend(
        changes
            .filter(|(_, pair)| pair[0] != pair[1])
            .map(|(i, _)| i + 1),
    );
    let ends = starts.iter().skip(1).copied().chain([table.rows]);
    let cut = |(start, end): (&usize, usize)| {
        let columns = table.columns.iter().map(|column| Values {
            name: column.name.clone(),
            values: column.values.get(*start..end).unwrap_or(&[]).to_vec(),
        });
        SurveyTable {
            rows: end - start,
            columns: columns.collect(),
            ..table.clone()
        }
    };
    let parts: Vec<SurveyTable> = starts.iter().zip(ends).map(cut).collect();
    (parts.len() > 1).then(|| (column.name.clone(), parts))
}

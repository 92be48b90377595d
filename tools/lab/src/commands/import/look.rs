//! `vigil import --look`: topics or files of a log, with their columns.

use std::path::Path;

use serde::Serialize;
use vigil_import::{self as import, SurveyTable, Values};
use vigil_terminal::{CommandError, Outcome, output};

#[derive(Debug, Serialize)]
struct Document {
    schema_version: u32,
    log: String,
    tables: Vec<Table>,
}

#[derive(Debug, Serialize)]
struct Table {
    name: String,
    #[serde(rename = "type")]
    kind: String,
    rows: usize,
    rate_hz: Option<f64>,
    problem: Option<String>,
    columns: Vec<Column>,
}

#[derive(Debug, Serialize)]
struct Column {
    name: String,
    values: usize,
    min: Option<f64>,
    max: Option<f64>,
}

/// Prints what there is in a log.
///
/// # Errors
/// A log that cannot be read.
pub fn run(path: &Path, is_json: bool) -> Result<Outcome, CommandError> {
    let survey = import::survey(path).map_err(CommandError::usage)?;
    if let Some(cut) = &survey.cut {
        eprintln!("warning: {}", super::cut(cut));
    }
    let document = Document {
        schema_version: 1,
        log: path.display().to_string(),
        tables: survey.tables.iter().map(table).collect(),
    };
    let printed = match is_json {
        true => output::json(&document),
        false => output::line(&text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

fn table(table: &SurveyTable) -> Table {
    Table {
        name: table.name.clone(),
        kind: table.kind.clone(),
        rows: table.rows,
        rate_hz: table.rate_hz(),
        problem: table.problem.clone(),
        columns: table.columns.iter().map(column).collect(),
    }
}

fn column(column: &Values) -> Column {
    let finite = || {
        column
            .values
            .iter()
            .copied()
            .filter(|value| value.is_finite())
    };
    Column {
        name: column.name.clone(),
        values: finite().count(),
        min: finite().reduce(f64::min),
        max: finite().reduce(f64::max),
    }
}

fn text(document: &Document) -> String {
    let mut lines = vec![document.log.clone()];
    for table in &document.tables {
        let kind = match table.kind.as_str() {
            "" => String::new(),
            kind => format!(" ({kind})"),
        };
        let rate = table
            .rate_hz
            .map(|hz| format!(", {hz:.1} Hz"))
            .unwrap_or_default();
        lines.push(format!("{}{kind}: {} rows{rate}", table.name, table.rows));
        if let Some(problem) = &table.problem {
            lines.push(format!("    not read: {problem}"));
        }
        for column in &table.columns {
            let Column {
                name,
                values,
                min,
                max,
            } = column;
            let lacking = match table.rows - values {
                0 => String::new(),
                empty => format!(", empty in {empty}"),
            };
            let range = match (min, max) {
                (Some(min), Some(max)) if min < max => format!("{min} to {max}"),
                (Some(min), _) => format!("{min} throughout"),
                (None, _) => "no value".to_owned(),
            };
            lines.push(format!("    {name}: {range}{lacking}"));
        }
    }
    lines.join("\n")
}

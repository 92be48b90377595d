//! `vigil import --look`: topics or files of a log, with their columns.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_import::{self as import, SurveyTable, Values};
use vigil_terminal::{CommandError, Outcome, output};

/// What `import --look` prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the log.
    log: String,
    /// Its topics or files, by name.
    tables: Vec<Table>,
}

/// A topic or file.
#[derive(Debug, Serialize, JsonSchema)]
struct Table {
    /// Topic, or path of the file.
    name: String,
    /// Type of the messages; empty for a file.
    #[serde(rename = "type")]
    kind: String,
    /// Messages or rows.
    rows: usize,
    /// Their rate, Hz; null if no clock tells it.
    rate_hz: Option<f64>,
    /// Why it cannot be read; null if it can.
    problem: Option<String>,
    /// Columns that hold a number somewhere.
    columns: Vec<Column>,
}

/// A column, or a number within a message.
#[derive(Debug, Serialize, JsonSchema)]
struct Column {
    /// Name, or path within the message.
    name: String,
    /// Rows that hold a number.
    values: usize,
    /// Smallest; null if there is none.
    min: Option<f64>,
    /// Largest; null if there is none.
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

//! Where the rows of a run are, and the columns of its tables.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use vigil_recording::table::{Layout, Table};

use super::ImportError;
use super::description::{LogDescription, Source};
use super::find::FoundRun;
use super::ros::{MissingColumn, TopicColumns};

/// Columns of a CSV file; of the rows with the value of a column that `part` names, if it does. An
/// empty cell, or `nan`, is not a number: nothing was measured.
pub(super) fn table_columns(
    path: &Path,
    source: &Source,
    columns: &[String],
    part: Option<&[String; 2]>,
) -> Result<TopicColumns, ImportError> {
    let mut table = open(path, source)?;
    if let Some(missing) = columns.iter().find(|name| table.position(name).is_none()) {
        let there = table.columns().join(", ");
        let message = format!("there is no column '{missing}'; there are {there}");
        return Err(vigil_recording::table::wrong_row(path, 0, message).into());
    }
    let at = table.require(columns)?;
    let part = match part {
        Some([column, value]) => Some((table.require(std::slice::from_ref(column))?, value)),
        None => None,
    };
    let mut values = vec![Vec::new(); at.len()];
    let (mut row, mut rows, mut lacking) = (0, Vec::new(), None::<MissingColumn>);
    while table.advance()? {
        row += 1;
        let is_other = |(at, value): &(Vec<usize>, &String)| {
            at.first()
                .is_some_and(|&at| table.text(at) != value.as_str())
        };
        if part.as_ref().is_some_and(is_other) {
            continue;
        }
        rows.push(row);
        let mut empty = None;
        for ((values, &at), column) in values.iter_mut().zip(&at).zip(columns) {
            let text = table.text(at);
            let is_empty = text.is_empty() || text.eq_ignore_ascii_case("nan");
            values.push(if is_empty {
                f64::NAN
            } else {
                table.number(at)?
            });
            empty = empty.or_else(|| is_empty.then_some(column));
        }
        if let Some(column) = empty {
            let first = || MissingColumn {
                path: path.to_owned(),
                topic: None,
                column: column.clone(),
                rows: 0,
                of: 0,
            };
            lacking.get_or_insert_with(first).rows += 1;
        }
    }
    if let Some(lacking) = &mut lacking {
        lacking.of = rows.len();
    }
    Ok(TopicColumns {
        values,
        rows,
        lacking,
        is_unstamped: false,
        cut: None,
    })
}

fn open(path: &Path, source: &Source) -> Result<Table, ImportError> {
    let layout = Layout {
        delimiter: source.delimiter as u8,
        skip_rows: source.skip_rows,
    };
    Ok(Table::open_as(path, layout)?)
}

/// Where the rows of a run are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct RunPlace {
    /// Its file or folder.
    pub path: PathBuf,
    /// What the `*` of its pattern stands for.
    star: String,
    /// Column and value by which its rows are told from those of other runs.
    pub part: Option<[String; 2]>,
}

impl RunPlace {
    /// A source's file: in the run's folder, or beside the run's file.
    pub fn file(&self, source: &Source) -> PathBuf {
        let Some(file) = &source.file else {
            return self.path.clone();
        };
        let file = file.replace('*', &self.star);
        match self.path.parent().filter(|_| self.path.is_file()) {
            Some(folder) => folder.join(file),
            None => self.path.join(file),
        }
    }

    /// The runs in a file or folder, in the order in which they begin in its first source.
    pub fn all(log: &LogDescription, found: FoundRun) -> Result<Vec<Self>, ImportError> {
        let FoundRun { path, star } = found;
        let part = None;
        let whole = Self { path, star, part };
        let (Some(column), Some(source)) = (&log.run_column, log.source.first()) else {
            return Ok(vec![whole]);
        };
        let mut table = open(&whole.file(source), source)?;
        let at = table.require(std::slice::from_ref(column))?;
        let (mut values, mut seen) = (Vec::new(), BTreeSet::new());
        while table.advance()? {
            let value = at.first().map_or("", |&at| table.text(at));
            if seen.insert(value.to_owned()) {
                values.push(value.to_owned());
            }
        }
        let part = |value| Self {
            part: Some([column.clone(), value]),
            ..whole.clone()
        };
        Ok(values.into_iter().map(part).collect())
    }

    /// Its name below `folder`.
    pub fn name(&self, folder: &Path) -> String {
        let path = self
            .path
            .strip_prefix(folder)
            .unwrap_or(&self.path)
            .display();
        match &self.part {
            Some([column, value]) => format!("{path} {column} {value}"),
            None => path.to_string(),
        }
    }
}

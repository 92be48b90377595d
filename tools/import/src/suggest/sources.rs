//! The sources of a suggested description: files or topics, with their times.

use super::Evidence;
use super::clock::TimeColumn;
use super::draft::{Draft, DraftSource, quoted};
use super::names::words;
use super::places::Places;
use crate::survey::SurveyTable;

/// Names of the time of arrival, in recordings and in their CSV form.
const ARRIVAL: [&str; 2] = ["log_time", "%time"];

/// A source for each table that a channel comes from.
pub(super) fn sources(evidence: &Evidence, draft: &Draft, places: &Places) -> Vec<DraftSource> {
    let is_used = |at: &usize| draft.channels.iter().any(|channel| channel.table == *at);
    let mut out: Vec<DraftSource> = Vec::new();
    for table in (0..evidence.tables.len()).filter(is_used) {
        let mut name = name(evidence.table(table));
        // The number of the first run says nothing of the others.
        if places.runs.iter().any(|run| run.contains('*')) {
            let end = |c: char| c.is_ascii_digit() || c == '_';
            name = Some(name.trim_end_matches(end))
                .filter(|n| !n.is_empty())
                .unwrap_or("log")
                .into();
        }
        let is_taken = out.iter().any(|source| source.name == name);
        out.push(DraftSource {
            table,
            name: if is_taken {
                format!("{name}_{table}")
            } else {
                name
            },
            lines: Vec::new(),
        });
    }
    let times: Vec<Option<TimeColumn>> = out
        .iter()
        .map(|source| TimeColumn::find(evidence.tables.get(source.table)?))
        .collect();
    let names: Vec<String> = out.iter().map(|source| source.name.clone()).collect();
    let has = |table: usize, column: &str| {
        let table = evidence.tables.get(table);
        table.is_some_and(|table| table.columns.iter().any(|c| c.name == column))
    };
    let tables: Vec<usize> = out.iter().map(|source| source.table).collect();
    for (source, time) in out.iter_mut().zip(&times) {
        let Some(table) = evidence.tables.get(source.table) else {
            continue;
        };
        let file = places.files.get(source.table).cloned().flatten();
        source.lines = layout_lines(table, file);
        let Some(time) = time else { continue };
        let (column, unit) = (quoted(&time.name), time.unit);
        source
            .lines
            .push(format!("time = {{ column = {column}, unit = \"{unit}\" }}"));
        if !ARRIVAL.contains(&time.name.as_str()) {
            continue;
        }
        // Other sources have stamps of their own: one that has both times joins the clocks.
        let others = tables.iter().zip(&names).zip(&times);
        let both = others.filter(|((table, _), other)| {
            let other = other
                .as_ref()
                .map_or(time.name.as_str(), |other| other.name.as_str());
            other != time.name && has(**table, &time.name)
        });
        if let Some(((_, other), _)) = both.into_iter().next() {
            source
                .lines
                .push(format!("time_as = [{}, {column}]", quoted(other)));
        }
    }
    out
}

/// Where a table is, and how it is laid out.
fn layout_lines(table: &SurveyTable, file: Option<String>) -> Vec<String> {
    let Some((delimiter, skip_rows)) = table.layout else {
        return vec![format!("topic = {}", quoted(&table.name))];
    };
    let file = file.map(|file| format!("file = {}", quoted(&file)));
    let delimiter = Some(delimiter).filter(|delimiter| *delimiter != ',');
    let delimiter = delimiter.map(|one| format!("delimiter = {}", quoted(&one.to_string())));
    let skipped = (skip_rows > 0).then(|| format!("skip_rows = {skip_rows}"));
    [file, delimiter, skipped].into_iter().flatten().collect()
}

/// A short name from a topic or file.
fn name(of: &str) -> String {
    let ends = [".gz", ".csv", ".tsv", ".txt"];
    let stem = ends.iter().fold(of, |name, end| name.trim_end_matches(end));
    let name = words(stem).join("_");
    if name.is_empty() {
        "log".to_owned()
    } else {
        name
    }
}

//! Results: what each measurement has shown, one small file for people and programs.

mod page;
mod shorten;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crc32fast::Hasher;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use vigil_terminal::schema::CommandSchema;

pub use page::page;
use shorten::shortened;

/// Version of the files' form.
pub const SCHEMA_VERSION: u32 = 1;
/// Largest file of a result, bytes.
const BYTES_MAX: usize = 20_000;
/// Bytes of a line in the file beside the line itself.
const BYTES_AROUND_A_LINE: usize = 4;
/// Room for the remark that a summary was shortened, bytes.
const BYTES_OF_A_REMARK: usize = 120;

/// What a question prints with `--json`, and what its file holds.
pub const SCHEMA: CommandSchema = CommandSchema::new::<Run>("result.schema");

/// One measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Version of the file's form.
    pub schema_version: u32,
    /// Name of the question.
    pub question: String,
    /// What was typed; empty if it is not known.
    pub command: String,
    /// Which commit was measured, if that is known.
    pub commit: Option<String>,
    /// Day in UTC: `2026-11-22`.
    pub date: String,
    /// Facts about the machine.
    pub machine: Value,
    /// The lines that were shown, tables included.
    pub summary: Vec<String>,
    /// What is not in this file, and where it lies.
    pub remarks: Vec<String>,
    /// Data for programs, by the names of their raw files.
    pub figures: Map<String, Value>,
    /// What lies with the raw data.
    pub raw: Vec<Raw>,
}

/// A raw file, or a folder of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Raw {
    /// Its name; that of a folder ends with `/`.
    pub name: String,
    /// How many files it is.
    pub files: usize,
    /// Size of all of them, bytes.
    pub bytes: usize,
    /// CRC-32 of their contents, one after the other in the order of their names.
    pub crc32: String,
}

impl Raw {
    /// What lies in `folder`, by name.
    ///
    /// # Errors
    /// The file system's.
    pub fn list(folder: &Path) -> io::Result<Vec<Self>> {
        let one = |path: PathBuf| {
            let mark = if path.is_dir() { "/" } else { "" };
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let (mut hasher, mut files, mut bytes) = (Hasher::new(), 0, 0);
            for file in files_under(&path)? {
                let content = fs::read(file)?;
                hasher.update(&content);
                files += 1;
                bytes += content.len();
            }
            Ok(Self {
                name: format!("{name}{mark}"),
                files,
                bytes,
                crc32: format!("{:08x}", hasher.finalize()),
            })
        };
        entries(folder)?.into_iter().map(one).collect()
    }
}

/// What lies in a folder, in order.
fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut paths = entries.collect::<io::Result<Vec<PathBuf>>>()?;
    paths.sort();
    Ok(paths)
}

/// The file itself, or all files under a folder, in order.
fn files_under(path: &Path) -> io::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    for entry in entries(path)? {
        files.extend(files_under(&entry)?);
    }
    Ok(files)
}

impl Run {
    /// The file: a line of the summary, a figure and a raw file are a line each.
    #[must_use]
    pub fn text(&self) -> String {
        let listed = |lines: &[String]| block(["[", "]"], lines.iter().map(|line| json!(line)));
        let figures = self.figures.iter();
        let figures = figures.map(|(name, value)| format!("{}: {value}", json!(name)));
        let parts = [
            ("schema_version", self.schema_version.to_string()),
            ("question", json!(self.question).to_string()),
            ("command", json!(self.command).to_string()),
            ("commit", json!(self.commit).to_string()),
            ("date", json!(self.date).to_string()),
            ("machine", self.machine.to_string()),
            ("summary", listed(&self.summary)),
            ("remarks", listed(&self.remarks)),
            ("figures", block(["{", "}"], figures)),
            (
                "raw",
                block(["[", "]"], self.raw.iter().map(|of| json!(of))),
            ),
        ];
        let parts = parts.map(|(key, value)| format!("\"{key}\": {value}"));
        format!("{{\n{}\n}}\n", parts.join(",\n"))
    }

    /// Leaves out what makes the file too large: figures, the largest first, and only if that is
    /// not enough rows of long tables.
    pub fn shrink(&mut self) {
        let (before, mut dropped) = (self.remarks.len(), Vec::new());
        while self.text().len() > BYTES_MAX {
            let size = |name: &&String| self.figures[name.as_str()].to_string().len();
            let Some(name) = self.figures.keys().max_by_key(size).cloned() else {
                break;
            };
            self.figures.remove(&name);
            dropped.push(name);
            let names = dropped.join(", ");
            self.remarks.truncate(before);
            self.remarks.push(format!(
                "too large for this file, with the raw data: {names}"
            ));
        }
        let whole = std::mem::take(&mut self.summary);
        let around = self.text().len() + BYTES_OF_A_REMARK;
        let bytes = |line: &String| json!(line).to_string().len() + BYTES_AROUND_A_LINE;
        let fits = |lines: &[String]| around + lines.iter().map(bytes).sum::<usize>() <= BYTES_MAX;
        self.summary = shortened(&whole, fits);
        if self.summary != whole {
            let (kept, all) = (self.summary.len(), whole.len());
            self.remarks.push(format!(
                "{kept} lines of a summary of {all}, which is with the raw data: summary.md"
            ));
        }
    }
}

/// Items in brackets, one a line.
fn block([open, close]: [&str; 2], items: impl Iterator<Item = impl ToString>) -> String {
    let items: Vec<String> = items.map(|item| item.to_string()).collect();
    if items.is_empty() {
        return format!("{open}{close}");
    }
    format!("{open}\n  {}\n{close}", items.join(",\n  "))
}

/// A result that is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultFile {
    /// Its file, from the folder of all: `2026-11-22-vm/latency.json`.
    pub path: String,
    /// What it says.
    pub run: Run,
}

impl ResultFile {
    /// All results in `folder`, in order of their paths.
    ///
    /// # Errors
    /// The file system's, and a file that is no result.
    pub fn all(folder: &Path) -> io::Result<Vec<Self>> {
        let mut kept = Vec::new();
        for path in files_under(folder)? {
            let of = |text: String| format!("{}: {text}", path.display());
            let run: Run = serde_json::from_str(&fs::read_to_string(&path)?)
                .map_err(|error| io::Error::other(of(error.to_string())))?;
            let name = path.strip_prefix(folder).unwrap_or(&path);
            let path = name.to_string_lossy().into_owned();
            kept.push(Self { path, run });
        }
        Ok(kept)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use vigil_terminal::schema::outdated;

    use super::*;

    /// A result of a question, nothing in it.
    pub(crate) fn empty(question: &str) -> Run {
        Run {
            schema_version: SCHEMA_VERSION,
            question: question.into(),
            command: format!("scripts/bench {question}"),
            commit: Some("ab12".into()),
            date: "2026-11-22".into(),
            machine: json!({ "cores": 2, "uncommitted_changes": false }),
            summary: Vec::new(),
            remarks: Vec::new(),
            figures: Map::new(),
            raw: Vec::new(),
        }
    }

    #[test]
    fn the_schema_beside_the_results_is_up_to_date() {
        let folder = crate::root().join("bench");
        let hint = "write it anew: scripts/bench page";
        assert_eq!(outdated(&[SCHEMA], &folder), [""; 0], "{hint}");
        assert_eq!(SCHEMA.unexplained_keys(), [""; 0]);
    }

    #[test]
    fn a_file_says_what_the_result_holds() {
        let mut run = empty("latency");
        assert_eq!(serde_json::from_str::<Run>(&run.text()).unwrap(), run);
        run.summary = vec!["| \"a\" | b |".into(), String::new()];
        run.figures.insert("a.json".into(), json!([1.5, 2]));
        run.figures.insert("b.json".into(), json!({ "n": 3 }));
        run.raw = vec![Raw {
            name: "cell/".into(),
            files: 2,
            bytes: 7,
            crc32: "0123abcd".into(),
        }];
        run.remarks = vec!["a remark".into()];
        assert_eq!(serde_json::from_str::<Run>(&run.text()).unwrap(), run);
        let before = run.clone();
        run.shrink();
        assert_eq!(run, before, "small as it is");
    }

    #[test]
    fn of_too_much_the_largest_figures_go_and_the_summary_stays() {
        let mut run = empty("latency");
        run.summary = (0..100).map(|k| format!("line {k}")).collect();
        run.figures
            .insert("large.json".into(), json!("x".repeat(BYTES_MAX)));
        run.figures.insert("small.json".into(), json!({ "n": 3 }));
        let summary = run.summary.clone();
        run.shrink();
        assert_eq!(run.figures.keys().collect::<Vec<_>>(), ["small.json"]);
        assert_eq!(run.summary, summary);
        let remark = "too large for this file, with the raw data: large.json";
        assert_eq!(run.remarks, [remark]);
        assert!(run.text().len() <= BYTES_MAX);
    }

    #[test]
    fn a_summary_that_is_too_long_keeps_the_first_rows_of_its_tables() {
        let mut run = empty("field");
        let rows = (0..1000).map(|k| format!("| {k} | {} |", "x".repeat(40)));
        run.summary = ["| a | b |".to_owned(), "|---|---|".to_owned()]
            .into_iter()
            .chain(rows)
            .chain(["".to_owned(), "The end.".to_owned()])
            .collect();
        run.shrink();
        let bytes = run.text().len();
        assert!((BYTES_MAX - 200..=BYTES_MAX).contains(&bytes), "{bytes}");
        assert_eq!(run.summary.last().unwrap(), "The end.");
        assert!(run.remarks[0].contains("of a summary of 1004, which is with the raw data"));
    }

    #[test]
    fn raw_data_are_told_by_size_and_content() {
        let folder = std::env::temp_dir().join(format!("vigil-raw-{}", std::process::id()));
        fs::create_dir_all(folder.join("cell")).unwrap();
        fs::write(folder.join("b.csv"), "123456789").unwrap();
        fs::write(folder.join("cell/x"), "12345").unwrap();
        fs::write(folder.join("cell/y"), "6789").unwrap();
        let found = Raw::list(&folder).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let raw = |name: &str, files| Raw {
            name: name.into(),
            files,
            bytes: 9,
            crc32: "cbf43926".into(),
        };
        assert_eq!(found, [raw("b.csv", 1), raw("cell/", 2)]);
    }
}

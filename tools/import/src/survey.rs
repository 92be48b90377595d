//! What there is in a log, before anything is known about it: topics or files, their columns and
//! all values.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use vigil_recording::table::{Layout, Table, wrong_row};

use super::ImportError;
use super::bag::{self, BagMessage, CutBag};
use super::message::{Reader, Schema};

/// Messages of a topic whose names are collected: more than the programs that may share one.
const NAMED_MESSAGES: usize = 100;
/// Beginning of a table by which its layout is judged, bytes.
const HEAD_BYTES: u64 = 1 << 16;
/// Rows there, beyond which no header is looked for.
const HEADER_ROWS_MAX: usize = 20;
/// Folders within folders in which files are looked for.
const DEPTH_MAX: usize = 6;
/// Separators that are tried.
const DELIMITERS: [char; 4] = [',', ';', '\t', ' '];

/// A column with its values; not a number where it has none.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// Its name, as a description of the log names it.
    pub name: String,
    /// Row by row.
    pub values: Vec<f64>,
}

/// A topic, or a file of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyTable {
    /// Topic, or path of the file.
    pub name: String,
    /// Type of the messages; empty for a table.
    pub kind: String,
    /// The file's separator and rows above the header; none of a topic.
    pub layout: Option<(char, usize)>,
    /// Messages or rows.
    pub rows: usize,
    /// Columns that hold a number somewhere; a topic's first is `log_time`, ns.
    pub columns: Vec<Values>,
    /// Why it cannot be read, if it cannot.
    pub problem: Option<String>,
}

/// All that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Topics or files, by name.
    pub tables: Vec<SurveyTable>,
    /// Where a recording is cut off, if one is.
    pub cut: Option<CutBag>,
}

/// True if the name is that of a recording of ROS 2.
pub(super) fn is_bag(path: &Path) -> bool {
    let name = path.to_string_lossy();
    let name = name.strip_suffix(".zstd").unwrap_or(&name);
    name.ends_with(".mcap") || name.ends_with(".db3")
}

/// True if the name is that of a table.
pub(super) fn is_table(path: &Path) -> bool {
    let name = path.to_string_lossy().to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    [".csv", ".tsv", ".txt"]
        .iter()
        .any(|ending| name.ends_with(ending))
}

/// Surveys one recording (a file, or rosbag2's folder), or tables: one file, or all below a folder.
///
/// # Errors
/// What cannot be read.
pub fn survey(path: &Path) -> Result<Survey, ImportError> {
    let files = children(path)?;
    if is_bag(path) || files.iter().any(|file| is_bag(file)) {
        return topics(path);
    }
    let tables = if path.is_dir() {
        let of_folders = tables_below(path)?.into_iter();
        of_folders
            .flat_map(|(folder, names)| names.into_iter().map(move |name| folder.join(name)))
            .collect()
    } else {
        vec![path.to_owned()]
    };
    if tables.is_empty() {
        return Err(no_log(path));
    }
    let tables = tables
        .iter()
        .map(|file| table(file))
        .collect::<Result<_, _>>()?;
    Ok(Survey { tables, cut: None })
}

/// A folder in which there is nothing to read.
pub(super) fn no_log(folder: &Path) -> ImportError {
    let message = "no .mcap, .db3, .csv, .tsv or .txt file is in this folder".to_owned();
    wrong_row(folder, 0, message).into()
}

/// Names of the tables of a folder and of those within it, by folder.
pub(super) fn tables_below(folder: &Path) -> Result<BTreeMap<PathBuf, Vec<String>>, ImportError> {
    let mut found = BTreeMap::new();
    collect_tables(folder, 0, &mut found)?;
    Ok(found)
}

fn collect_tables(
    folder: &Path,
    depth: usize,
    out: &mut BTreeMap<PathBuf, Vec<String>>,
) -> Result<(), ImportError> {
    for path in children(folder)? {
        if path.is_dir() && depth < DEPTH_MAX {
            collect_tables(&path, depth + 1, out)?;
        } else if path.is_file() && is_table(&path) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let names = out.entry(folder.to_owned()).or_default();
            names.push(name.into_owned());
        }
    }
    Ok(())
}

/// What is in a folder, by name; nothing in a file.
pub(super) fn children(path: &Path) -> Result<Vec<PathBuf>, ImportError> {
    if !path.is_dir() {
        return Ok(Vec::new());
    }
    let io = |error| ImportError::Io {
        path: path.to_owned(),
        error,
    };
    let entries = std::fs::read_dir(path).map_err(io)?;
    let paths = entries.map(|entry| Ok(entry.map_err(io)?.path()));
    let mut paths = paths.collect::<Result<Vec<_>, ImportError>>()?;
    paths.sort();
    Ok(paths)
}

/// A topic while its recording is read.
struct Topic {
    kind: String,
    schema: Result<Schema, String>,
    names: Vec<String>,
    known: BTreeSet<String>,
    reader: Option<Reader>,
    rows: usize,
    values: Vec<Vec<f64>>,
}

impl Topic {
    fn new(message: &BagMessage<'_>) -> Self {
        Self {
            kind: message.kind.to_owned(),
            schema: Schema::parse(message.kind, message.definition),
            names: Vec::new(),
            known: BTreeSet::new(),
            reader: None,
            rows: 0,
            values: Vec::new(),
        }
    }

    fn learn_names(&mut self, message: &BagMessage<'_>) {
        self.rows += 1;
        if self.rows > NAMED_MESSAGES {
            return;
        }
        if let Ok(schema) = &self.schema {
            for name in Reader::new(schema.clone(), &[]).0.names(message.data) {
                if self.known.insert(name.clone()) {
                    self.names.push(name);
                }
            }
        }
    }

    fn take(&mut self, message: &BagMessage<'_>) {
        let Ok(schema) = &self.schema else { return };
        let names = &self.names;
        let reader = self
            .reader
            .get_or_insert_with(|| Reader::new(schema.clone(), names).0);
        let found = match reader.read(message.data) {
            Ok(found) => found,
            Err(error) => {
                self.schema = Err(error);
                return;
            }
        };
        self.values.resize_with(1 + names.len(), Vec::new);
        let found = found.into_iter().map(|value| value.unwrap_or(f64::NAN));
        let all = std::iter::once(message.log_time_ns as f64).chain(found);
        for (values, value) in self.values.iter_mut().zip(all) {
            values.push(value);
        }
    }

    fn table(self, name: String) -> SurveyTable {
        let names = std::iter::once("log_time".to_owned()).chain(self.names);
        let columns = names
            .zip(self.values)
            .map(|(name, values)| Values { name, values });
        SurveyTable {
            name,
            kind: self.kind,
            layout: None,
            rows: self.rows,
            columns: columns.collect(),
            problem: self.schema.err(),
        }
    }
}

fn topics(path: &Path) -> Result<Survey, ImportError> {
    let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
    bag::visit(path, &mut |message| {
        let known = topics.entry(message.topic.to_owned());
        known
            .or_insert_with(|| Topic::new(message))
            .learn_names(message);
        Ok(())
    })?;
    let cut = bag::visit(path, &mut |message| {
        if let Some(topic) = topics.get_mut(message.topic) {
            topic.take(message);
        }
        Ok(())
    })?;
    let tables = topics.into_iter().map(|(name, topic)| topic.table(name));
    Ok(Survey {
        tables: tables.collect(),
        cut,
    })
}

/// A table with the columns that hold a number somewhere.
fn table(path: &Path) -> Result<SurveyTable, ImportError> {
    let (delimiter, skip_rows) = layout(path)?;
    let layout = Layout {
        delimiter: delimiter as u8,
        skip_rows,
    };
    let mut table = Table::open_as(path, layout)?;
    let names = table.columns().to_vec();
    let (mut rows, mut values) = (0, vec![Vec::new(); names.len()]);
    while table.advance()? {
        rows += 1;
        for (at, values) in values.iter_mut().enumerate() {
            let value = table.text(at).parse().unwrap_or(f64::NAN);
            values.push(if f64::is_finite(value) {
                value
            } else {
                f64::NAN
            });
        }
    }
    let columns = names
        .into_iter()
        .zip(values)
        .map(|(name, values)| Values { name, values });
    let is_there = |column: &Values| {
        !column.name.is_empty() && column.values.iter().any(|value| value.is_finite())
    };
    Ok(SurveyTable {
        name: path.display().to_string(),
        kind: String::new(),
        layout: Some((delimiter, skip_rows)),
        rows,
        columns: columns.filter(is_there).collect(),
        problem: None,
    })
}

/// Separator, and rows above the one that names the columns: the last one before the first whose
/// fields are mostly numbers.
fn layout(path: &Path) -> Result<(char, usize), ImportError> {
    let io = |error| ImportError::Io {
        path: path.to_owned(),
        error,
    };
    let mut plain = BufReader::new(File::open(path).map_err(io)?);
    let is_compressed = plain.fill_buf().map_err(io)?.starts_with(&[0x1f, 0x8b]);
    let mut head = Vec::new();
    if is_compressed {
        let mut unpacked = MultiGzDecoder::new(plain).take(HEAD_BYTES);
        unpacked.read_to_end(&mut head).map_err(io)?;
    } else {
        plain.take(HEAD_BYTES).read_to_end(&mut head).map_err(io)?;
    }
    let head = String::from_utf8_lossy(&head);
    let lines: Vec<&str> = head.lines().take(HEADER_ROWS_MAX).collect();
    let is_number = |field: &str| field.trim().trim_matches('"').parse::<f64>().is_ok();
    let numbers = |line: &str, by| line.split(by).filter(|field| is_number(field)).count();
    let in_all = |by: &char| lines.iter().map(|line| numbers(line, *by)).sum::<usize>();
    let delimiter = DELIMITERS
        .into_iter()
        .rev()
        .max_by_key(in_all)
        .unwrap_or(',');
    let mostly = |line: &&str| {
        let fields = line
            .split(delimiter)
            .filter(|field| !field.trim().is_empty());
        2 * numbers(line, delimiter) >= fields.count().max(1)
    };
    match lines.iter().position(mostly) {
        Some(first) if first > 0 => Ok((delimiter, first - 1)),
        found => {
            let what = found.map_or(
                "there are no rows of numbers",
                |_| "there is no row that names the columns above the numbers",
            );
            Err(wrong_row(path, 0, format!("{what}: a table needs both")).into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separator_and_header_of_a_table_are_found() {
        let folder = tempfile::TempDir::new().unwrap();
        let at = folder.path().join("a.csv");
        for (text, wanted) in [
            ("t,x\n0,1\n", Some((',', 0))),
            (
                "time of day;speed;\ns;m/s;\nt;v;\n0;1,5;\n1;;\n",
                Some((';', 2)),
            ),
            ("t\tx\n0\t1\n", Some(('\t', 0))),
            ("t x\n0 1\n", Some((' ', 0))),
            ("0,1\n1,2\n", None),
            ("t,x\n", None),
            ("", None),
        ] {
            std::fs::write(&at, text).unwrap();
            assert_eq!(layout(&at).ok(), wanted, "{text}");
        }
    }
}

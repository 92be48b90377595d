//! Topics of a ROS 2 recording: fields of their messages as columns.
//!
//! A column is a path of fields, as the type's definition names them: `twist.twist.linear.x`,
//! `data[2]`, `velocity[left_wheel]` (by the names in the list of strings beside it),
//! `transforms[base_link].transform.x` (the element with a string of this value). Fields may be
//! left out where one way fits: `linear.x`. Beside them there are
//!
//! | column | of | is |
//! |---|---|---|
//! | `roll`, `pitch`, `yaw` | a quaternion | its angles, rad |
//! | `curvature` | a twist | yaw rate over forward speed, 1/m, 0 at rest |
//! | `x`, `y`, `z` | a pose or transform | those of its position |
//! | a time, such as `stamp` | all with a header | when measured, ns; without a header `log_time` |
//! | `log_time` | all | when recorded, ns |

use std::path::{Path, PathBuf};

use vigil_recording::table::wrong_row;

use super::ImportError;
use super::bag::{self, BagMessage, CutBag};
use super::message::{Reader, Schema};

/// Messages of a topic, or rows of a file, that lack a column: they give the others. Two programs
/// may share a topic, each with joints of its own; a first message may hold nothing yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MissingColumn {
    /// The file.
    pub path: PathBuf,
    /// Its topic; none of a table.
    pub topic: Option<String>,
    /// The first column that is not there, or not finite, in the first such message.
    pub column: String,
    /// Such messages or rows.
    pub rows: usize,
    /// All of the topic or file.
    pub of: usize,
}

/// What the messages of a topic hold.
pub(super) struct TopicColumns {
    /// Column by column; not a number where a message lacks it.
    pub values: Vec<Vec<f64>>,
    /// Which message, or row of a file, each is; from 1.
    pub rows: Vec<usize>,
    /// Messages that lack a column.
    pub lacking: Option<MissingColumn>,
    /// True if `stamp` was asked of messages without a header: the recorder's time took its place.
    pub is_unstamped: bool,
    /// Where the file is cut off, if it is.
    pub cut: Option<CutBag>,
}

/// Columns of one topic, as its messages come.
struct Collector<'a> {
    columns: &'a [String],
    /// The type of the last message, its reader, and why columns are not there.
    reader: Option<(String, Reader, Vec<Option<String>>)>,
    values: Vec<Vec<f64>>,
    /// Messages that lack a column, and the first of these.
    lacking: Option<(usize, String)>,
    /// Names of what a message has that lacks a column.
    known: Vec<String>,
    /// Why the first column is not in the type, if it is not.
    reason: Option<String>,
    is_unstamped: bool,
}

impl Collector<'_> {
    fn take(&mut self, message: &BagMessage<'_>) -> Result<(), String> {
        let kind = message.kind;
        if self.reader.as_ref().is_none_or(|(known, ..)| known != kind) {
            let schema = Schema::parse(kind, message.definition);
            let schema = schema.map_err(|e| format!("messages of '{kind}': {e}"))?;
            let (reader, why) = Reader::new(schema, self.columns);
            self.reader = Some((kind.to_owned(), reader, why));
        }
        let Some((_, reader, why)) = &mut self.reader else {
            return Ok(());
        };
        let mut found = reader
            .read(message.data)
            .map_err(|e| format!("{kind}: {e}"))?;
        let columns = self.columns.iter().zip(why.iter());
        for ((column, why), value) in columns.zip(&mut found) {
            let is_stampless = column == "stamp" && why.is_some();
            self.is_unstamped |= is_stampless;
            if column == "log_time" || is_stampless {
                *value = Some(message.log_time_ns as f64);
            }
        }
        let is_there = |value: &Option<f64>| value.is_some_and(f64::is_finite);
        if let Some(first) = found.iter().position(|value| !is_there(value)) {
            if self.lacking.is_none() {
                self.known = reader.names(message.data);
                self.reason = why.get(first).cloned().flatten();
            }
            let column = self.columns.get(first).cloned().unwrap_or_default();
            self.lacking.get_or_insert((0, column)).0 += 1;
        }
        for (all, value) in self.values.iter_mut().zip(&found) {
            all.push(value.filter(|value| value.is_finite()).unwrap_or(f64::NAN));
        }
        Ok(())
    }

    /// Why there is nothing, with what there is.
    fn nothing(&self, topic: &str, others: &[String]) -> String {
        let Some((_, column)) = &self.lacking else {
            return format!("no message on {topic}; there are {}", others.join(", "));
        };
        let mut known = self.known.clone();
        known.push("log_time".into());
        let reason = self
            .reason
            .as_ref()
            .map_or(String::new(), |reason| format!(" ({reason})"));
        let known = known.join(", ");
        format!("there is no finite '{column}' on {topic}{reason}; its messages have {known}")
    }
}

/// The values of `columns` in every message of `topic`.
///
/// # Errors
/// With the file, the message (from 1) and what is known, if the file or a message cannot be read,
/// or a column is in no message.
pub(super) fn columns(
    path: &Path,
    topic: &str,
    columns: &[String],
) -> Result<TopicColumns, ImportError> {
    let wrong = |row: u64, message: String| ImportError::from(wrong_row(path, row, message));
    let mut collector = Collector {
        columns,
        reader: None,
        values: vec![Vec::new(); columns.len()],
        lacking: None,
        known: Vec::new(),
        reason: None,
        is_unstamped: false,
    };
    let (mut row, mut others) = (0, Vec::<String>::new());
    let cut = bag::visit(path, &mut |message: &BagMessage<'_>| {
        if message.topic != topic {
            if !others.iter().any(|other| other == message.topic) {
                others.push(message.topic.to_owned());
            }
            return Ok(());
        }
        row += 1;
        let taken = collector.take(message);
        taken.map_err(|e| wrong(row, format!("{topic}: {e}")))
    })?;
    let is_empty = |values: &Vec<f64>| !values.iter().any(|value| value.is_finite());
    if let Some(empty) = collector.values.iter().position(is_empty) {
        if let (Some((_, column)), Some(own)) = (&mut collector.lacking, columns.get(empty)) {
            column.clone_from(own);
            let why = collector.reader.as_ref().map(|(_, _, why)| why);
            collector.reason = why.and_then(|why| why.get(empty).cloned().flatten());
        }
        return Err(wrong(row, collector.nothing(topic, &others)));
    }
    let lacking = collector.lacking.map(|(messages, column)| MissingColumn {
        path: path.to_owned(),
        topic: Some(topic.to_owned()),
        column,
        rows: messages,
        of: row as usize,
    });
    Ok(TopicColumns {
        rows: (1..=row as usize).collect(),
        values: collector.values,
        lacking,
        is_unstamped: collector.is_unstamped,
        cut,
    })
}

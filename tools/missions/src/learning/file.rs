//! Recorded missions: JSON lines, one mission a line after a first line that says what they are.
//!
//! ```text
//! {"format":"vigil-missions","version":1,"policy":"escalation-1"}
//! {"actions":["FP","MA"],"observations":["EPM","none"],"rewards":[1.0,-1.5],
//!  "states":["NOM","RT",null]}
//! ```
//! (Each mission is on a line of its own.) Names are the model's, indices in quotation marks will
//! do. `observations[t]` follows `actions[t]`. `rewards` may be missing where they were not
//! measured; `states`, one more than actions, where no state is known, and single ones be null.
//! `policy` says by which rule the missions were flown; it may be missing: nothing depends on it.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use vigil_pomdp::Pomdp;

use super::record::Record;

/// What the first line says.
const FORMAT: &str = "vigil-missions";
const VERSION: u32 = 1;
/// Longest line, bytes.
const LINE_BYTES_MAX: u64 = 64 << 20;

/// The first line.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    /// Always `vigil-missions`.
    format: String,
    /// Always 1.
    version: u32,
    /// Rule by which the missions were flown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    policy: Option<String>,
}

/// A mission.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    /// Names of the actions.
    actions: Vec<String>,
    /// Name of the observation after each action.
    observations: Vec<String>,
    /// Reward of each step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    rewards: Vec<f64>,
    /// States where they are known, beginning with the one before the first action.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    states: Vec<Option<String>>,
}

/// Missions of a file.
#[derive(Debug, Clone)]
pub struct MissionFile {
    /// Rule by which they were flown, if it is told.
    pub policy: Option<String>,
    /// The missions.
    pub records: Vec<Record>,
}

/// A file that is refused: where, what was found and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{path}:{line}: {problem}")]
pub struct MissionFileError {
    /// The file.
    pub path: String,
    /// Line, from 1; 0 for the file itself.
    pub line: usize,
    /// What is wrong.
    pub problem: String,
}

/// Reads a file of missions of `model`.
///
/// # Errors
/// File and line, what was found and what is allowed.
pub fn read(path: &Path, model: &Pomdp) -> Result<MissionFile, MissionFileError> {
    let wrong = |line: usize, problem: &dyn std::fmt::Display| MissionFileError {
        path: path.display().to_string(),
        line,
        problem: problem.to_string(),
    };
    let file = File::open(path).map_err(|e| wrong(0, &e))?;
    let mut reader = BufReader::new(file);
    let (mut text, mut number) = (String::new(), 0);
    let mut policy = None;
    let mut records = Vec::new();
    loop {
        text.clear();
        number += 1;
        let mut limited = reader.by_ref().take(LINE_BYTES_MAX);
        let bytes = limited
            .read_line(&mut text)
            .map_err(|e| wrong(number, &e))?;
        if bytes as u64 == LINE_BYTES_MAX {
            let problem = format!("a line of {LINE_BYTES_MAX} bytes or more");
            return Err(wrong(number, &problem));
        }
        if number == 1 {
            let head: Head = serde_json::from_str(&text).map_err(|e| wrong(1, &e))?;
            if head.format != FORMAT || head.version != VERSION {
                let (format, version) = (head.format, head.version);
                let allowed = format!("allowed is {FORMAT} {VERSION}");
                return Err(wrong(1, &format!("format {format} {version}, {allowed}")));
            }
            policy = head.policy;
        } else if bytes == 0 {
            return Ok(MissionFile { policy, records });
        } else if !text.trim().is_empty() {
            let line: Line = serde_json::from_str(&text).map_err(|e| wrong(number, &e))?;
            records.push(record(model, &line).map_err(|e| wrong(number, &e))?);
        }
    }
}

/// The index of a name, or of an index; `what` it names is told with the names that are allowed.
///
/// # Errors
/// What was found and what is allowed.
pub fn index_of(names: &[String], word: &str, what: &str) -> Result<usize, String> {
    let by_name = names.iter().position(|name| name == word);
    let index = by_name.or_else(|| word.parse().ok().filter(|i| *i < names.len()));
    index.ok_or_else(|| {
        const SHOWN: usize = 12;
        let more = if names.len() > SHOWN { " ..." } else { "" };
        let some = names[..names.len().min(SHOWN)].join(" ");
        format!(
            "'{word}' is no {what}, allowed are {some}{more}, or 0 to {}",
            names.len() - 1
        )
    })
}

fn record(model: &Pomdp, line: &Line) -> Result<Record, String> {
    let list = |names: &[String], words: &[String], what| -> Result<Vec<u32>, String> {
        let find = |word: &String| index_of(names, word, what).map(|index| index as u32);
        words.iter().map(find).collect()
    };
    let state = |word: &Option<String>| match word {
        Some(word) => index_of(model.states(), word, "state").map(|index| Some(index as u32)),
        None => Ok(None),
    };
    let record = Record {
        actions: list(model.actions(), &line.actions, "action")?,
        observations: list(model.observations(), &line.observations, "observation")?,
        rewards: line.rewards.clone(),
        labels: line.states.iter().map(state).collect::<Result<_, _>>()?,
    };
    record.check(model).map_err(|error| error.to_string())?;
    Ok(record)
}

/// Writes the first line.
///
/// # Errors
/// The system's.
pub fn write_head(out: &mut dyn Write, policy: String) -> std::io::Result<()> {
    let head = Head {
        format: FORMAT.to_owned(),
        version: VERSION,
        policy: Some(policy),
    };
    writeln!(out, "{}", serde_json::to_string(&head)?)
}

/// Writes one mission of `model`.
///
/// # Errors
/// The system's.
pub fn write(out: &mut dyn Write, model: &Pomdp, record: &Record) -> std::io::Result<()> {
    let list = |names: &[String], of: &[u32]| -> Vec<String> {
        let name = |index: &u32| names.get(*index as usize).cloned();
        of.iter().filter_map(name).collect()
    };
    let state = |label: &Option<u32>| label.and_then(|s| model.states().get(s as usize).cloned());
    let line = Line {
        actions: list(model.actions(), &record.actions),
        observations: list(model.observations(), &record.observations),
        rewards: record.rewards.clone(),
        states: record.labels.iter().map(state).collect(),
    };
    writeln!(out, "{}", serde_json::to_string(&line)?)
}

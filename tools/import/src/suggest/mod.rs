//! A first description of a log and of its robot, from the log alone: names of topics and columns
//! say what may be what, the data say in which unit and with which sign.

mod clock;
mod differential;
mod draft;
mod names;
mod omni;
mod places;
mod pose;
mod read;
mod signals;
mod sources;
mod wheels;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clock::TimeColumn;
use draft::{Draft, DraftChannel, Frame};
use names::{Guess, guess};
use read::Read;
use signals::Signals;

use super::ImportError;
use super::survey::SurveyTable;

/// Channels beside the standard ones that are suggested at most: a frame holds 48 in all.
const FURTHER_MAX: usize = 32;
/// Columns without a meaning that are named at most.
const UNKNOWN_MAX: usize = 12;
/// Rates of frames that are suggested, Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1.0..=100.0;
/// Period from which a further channel is held between its samples, s: half of the pause that an
/// import allows.
const SLOW_S: f64 = 0.5;

/// Two descriptions to be corrected by hand.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestion {
    /// The log's folder.
    pub folder: PathBuf,
    /// The description of the log.
    pub log: String,
    /// The description of the robot.
    pub robot: String,
    /// What is uncertain, and what was left out.
    pub unsure: Vec<String>,
    /// Rate of the frames, Hz.
    pub rate_hz: f64,
}

/// A column whose name says what it may be.
#[derive(Debug, Clone, PartialEq)]
struct NamedColumn {
    table: usize,
    column: String,
    guess: Guess,
}

/// What is known of a log while its draft is made.
struct Evidence {
    /// Tables of the first run.
    tables: Vec<SurveyTable>,
    found: Vec<NamedColumn>,
    signals: Signals,
}

impl Evidence {
    fn guessed(&self, guess: impl Fn(Guess) -> bool) -> impl Iterator<Item = &NamedColumn> {
        self.found.iter().filter(move |found| guess(found.guess))
    }

    /// Name of a table as a user knows it.
    fn table(&self, at: usize) -> &str {
        let name = self.tables.get(at).map_or("", |table| table.name.as_str());
        let is_topic = self
            .tables
            .get(at)
            .is_some_and(|table| table.layout.is_none());
        match is_topic {
            true => name,
            false => name.rsplit('/').next().unwrap_or(name),
        }
    }

    /// The table with most of these guesses; of equals that with more rows.
    fn best_table(&self, guesses: &[Guess]) -> Option<usize> {
        let count = |at: usize| {
            let is_own = |found: &&NamedColumn| found.table == at && guesses.contains(&found.guess);
            self.found.iter().filter(is_own).count()
        };
        let tables = (0..self.tables.len()).filter(|&at| count(at) > 0);
        tables.max_by_key(|&at| (count(at), self.tables.get(at).map_or(0, |t| t.rows)))
    }

    /// The column of a table that is guessed to be this.
    fn column(&self, table: usize, guess: Guess) -> Option<&str> {
        let mut own = self.guessed(move |other| other == guess);
        let own = own.find(|found| found.table == table);
        own.map(|found| found.column.as_str())
    }
}

/// Suggests descriptions of the log at `path`; `robot_file` is what the log's will refer to.
///
/// # Errors
/// A log that cannot be read, or in which no column looks like a channel.
pub fn suggest(path: &Path, name: &str, robot_file: &str) -> Result<Suggestion, ImportError> {
    let Read {
        places,
        runs,
        run_column,
        notes,
    } = read::read(path)?;
    let tables = runs.first().cloned().unwrap_or_default();
    let found = found(&tables, &runs);
    let mut used: Vec<usize> = found.iter().map(|found| found.table).collect();
    used.dedup();
    let evidence = Evidence {
        signals: Signals::new(runs, &used),
        tables,
        found,
    };
    let mut draft = Draft {
        radius_m: 0.1,
        unsure: notes,
        ..Draft::default()
    };
    if !omni::draft(&evidence, &mut draft) && !differential::draft(&evidence, &mut draft) {
        no_kinematics(&evidence, &mut draft);
    }
    pose::draft(&evidence, &mut draft);
    further(&evidence, &mut draft);
    unknown(&evidence, &mut draft);
    if draft.channels.is_empty() {
        return Err(ImportError::description(
            path.display().to_string(),
            "no column is named like a channel: see `vigil import --look`",
        ));
    }
    let sources = sources::sources(&evidence, &draft, &places);
    let frame = Frame {
        name,
        robot_file,
        rate_hz: rate_hz(&evidence, &draft),
        run_column: run_column.as_deref(),
        sources: &sources,
        places: &places,
    };
    Ok(Suggestion {
        rate_hz: frame.rate_hz,
        log: draft.log_text(&frame),
        robot: draft.robot_text(&frame),
        unsure: draft.unsure,
        folder: places.folder,
    })
}

/// Says which columns of the files in use nothing was made of. A topic's parts are too many.
fn unknown(evidence: &Evidence, draft: &mut Draft) {
    let used: BTreeSet<usize> = draft.channels.iter().map(|channel| channel.table).collect();
    for table in used {
        let survey = evidence.tables.get(table);
        let Some(survey) = survey.filter(|survey| survey.layout.is_some()) else {
            continue;
        };
        let time = TimeColumn::find(survey).map(|time| time.name);
        let is_left = |name: &&str| {
            let is_guessed =
                |found: &NamedColumn| (found.table, found.column.as_str()) == (table, *name);
            !evidence.found.iter().any(is_guessed) && time.as_deref() != Some(*name)
        };
        let columns = survey.columns.iter();
        let left: Vec<&str> = columns
            .filter(|column| varies(&column.values))
            .map(|column| column.name.as_str())
            .filter(is_left)
            .collect();
        if left.is_empty() {
            continue;
        }
        let more = left.len().saturating_sub(UNKNOWN_MAX);
        let mut names = left[..left.len() - more].join(", ");
        if more > 0 {
            names += &format!(" and {more} more");
        }
        let table = evidence.table(table);
        draft
            .unsure
            .push(format!("of {table} nothing was made of {names}"));
    }
}

/// True if the finite values are not all the same.
fn varies<'a>(values: impl IntoIterator<Item = &'a f64>) -> bool {
    let mut values = values.into_iter().filter(|value| value.is_finite());
    let first = values.next();
    first.is_some_and(|first| values.any(|value| value != first))
}

/// Columns that may be channels: of tables with a time, with values in every run, that vary.
fn found(tables: &[SurveyTable], runs: &[Vec<SurveyTable>]) -> Vec<NamedColumn> {
    let mut out = Vec::new();
    for (at, table) in tables.iter().enumerate() {
        if TimeColumn::find(table).is_none() {
            continue;
        }
        for column in &table.columns {
            let Some(guess) = guess(&table.name, &table.kind, &column.name) else {
                continue;
            };
            let of_runs = runs.iter().filter_map(|run| {
                let columns = &run.get(at)?.columns;
                columns.iter().find(|other| other.name == column.name)
            });
            let of_runs: Vec<&[f64]> = of_runs.map(|c| c.values.as_slice()).collect();
            let is_there = |values: &&[f64]| values.iter().any(|v| v.is_finite());
            let varies = varies(of_runs.iter().copied().flatten());
            if varies && of_runs.len() == runs.len() && of_runs.iter().all(is_there) {
                out.push(NamedColumn {
                    table: at,
                    column: column.name.clone(),
                    guess,
                });
            }
        }
    }
    out
}

/// A robot of which only channels are known.
fn no_kinematics(evidence: &Evidence, draft: &mut Draft) {
    draft.kinematics = "none";
    draft.unsure.push(
        "no wheels and no command were recognised: the robot is taken as one without kinematics"
            .into(),
    );
    if let Some(gyro) = evidence.guessed(|guess| guess == Guess::Gyro).next() {
        draft.measured.yaw_rate = true;
        draft
            .channels
            .push(DraftChannel::new("yaw_rate", gyro.table, &gyro.column));
    }
}

/// Channels beside the standard ones.
fn further(evidence: &Evidence, draft: &mut Draft) {
    let mut left_out = 0;
    for found in &evidence.found {
        let Guess::Further(role, unit) = found.guess else {
            continue;
        };
        let words = names::words(&found.column);
        let words: Vec<String> = words.into_iter().filter(|word| word != "field").collect();
        let mut name = words.join("_");
        if draft.channels.iter().any(|channel| channel.name == name) {
            let table = names::words(evidence.table(found.table)).join("_");
            name = format!("{table}_{name}");
        }
        let count = draft
            .channels
            .iter()
            .filter(|c| c.further.is_some())
            .count();
        if count >= FURTHER_MAX || draft.channels.iter().any(|channel| channel.name == name) {
            left_out += 1;
            continue;
        }
        let table = evidence.tables.get(found.table);
        let period_s = table.and_then(|table| TimeColumn::find(table)?.period_s());
        let mut channel = DraftChannel::new(name, found.table, &found.column);
        if period_s.is_some_and(|period_s| period_s > SLOW_S) {
            channel = channel.with("method", "\"hold\"");
        }
        channel.further = Some((role, unit));
        draft.channels.push(channel);
    }
    if left_out > 0 {
        draft
            .unsure
            .push(format!("{left_out} further channels were left out"));
    }
}

/// Rate of the frames: that of the slowest standard channel, Hz; without one, of the fastest other.
fn rate_hz(evidence: &Evidence, draft: &Draft) -> f64 {
    let rates = |is_wanted: &dyn Fn(&DraftChannel) -> bool| {
        let channels = draft.channels.iter().filter(|channel| is_wanted(channel));
        let rates = channels.filter_map(|c| evidence.tables.get(c.table)?.rate_hz());
        rates.collect::<Vec<f64>>()
    };
    let is_command =
        |channel: &DraftChannel| draft.command.iter().any(|(name, ..)| *name == channel.name);
    let standard = rates(&|channel| channel.further.is_none() && !is_command(channel));
    let slowest = standard.into_iter().reduce(f64::min);
    let fastest = || {
        rates(&|channel| channel.further.is_some())
            .into_iter()
            .reduce(f64::max)
    };
    let rate_hz = slowest.or_else(fastest).unwrap_or(10.0);
    let rate_hz = rate_hz.clamp(*RATES_HZ.start(), *RATES_HZ.end());
    // A round rate a little below: each frame then has a fresh sample.
    match rate_hz {
        rate if rate >= 5.0 => (rate + 0.1).floor(),
        rate => (rate * 10.0).floor() / 10.0,
    }
}

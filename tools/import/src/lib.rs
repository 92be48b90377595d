#![doc = include_str!("../README.md")]

mod agreement;
mod bag;
mod check;
mod delay;
mod description;
mod find;
mod message;
mod place;
mod resample;
mod ros;
mod series;
mod suggest;
mod survey;

use std::path::{Path, PathBuf};

pub use agreement::{Agreement, agreements};
pub use bag::CutBag;
pub use description::{ChannelSource, Clock, Delay, LogDescription, Method, Source, Unit};
use place::RunPlace;
use resample::Grid;
pub use ros::MissingColumn;
pub use series::Disorder;
use series::Series;
pub use suggest::{Suggestion, suggest};
pub use survey::{Survey, SurveyTable, Values, survey};
use vigil_blocks::SensorFrame;
use vigil_robot::Description;

use vigil_recording::FrameWriter;
use vigil_recording::frames::{Field, GAP_MAX_S, Run, fields};
use vigil_recording::table::TableError;

/// Why a log was refused.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// A file is malformed: file, row, column and reason.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The description does not fit the robot or itself.
    #[error("{key}: {message}")]
    Description {
        /// Key of the description.
        key: String,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// No run was found.
    #[error("{folder}: nothing there matches {patterns}")]
    NoRuns {
        /// Where was looked.
        folder: PathBuf,
        /// For what.
        patterns: String,
    },
    /// A folder cannot be listed, a file not written.
    #[error("{path}: {error}")]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// A run's channels share no time.
    #[error("{path}: its channels have less than {needed_s} s in common")]
    Apart {
        /// The run.
        path: PathBuf,
        /// What is needed, s.
        needed_s: f64,
    },
}

impl ImportError {
    fn description(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Description {
            key: key.into(),
            message: message.into(),
        }
    }
}

impl ImportedLog {
    /// Writes the frames as CSV, compressed if the name ends in `.gz`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ImportError> {
        let mut file = FrameWriter::create(path, &self.columns)?;
        for run in &self.runs {
            for row in &run.rows {
                let values = row
                    .iter()
                    .skip(1)
                    .map(|value| Some(*value).filter(|value| value.is_finite()));
                file.row(run.id, row.first().copied().unwrap_or(0.0), values)?;
            }
        }
        Ok(file.finish()?)
    }

    /// The runs as frames, as [`vigil_recording::frames::read`] would read them from the written
    /// file, but for its rounding and its checks.
    #[must_use]
    pub fn frames(&self, robot: &Description) -> Vec<Run> {
        let mut fields = fields(robot);
        fields.retain(|(name, _)| self.columns.contains(name));
        let robot_hash = vigil_robot::channel::hash(robot);
        let run = |run: &ImportedRun| Run {
            id: run.id,
            frames: run
                .rows
                .iter()
                .enumerate()
                .map(|(seq, row)| frame(&fields, [u64::from(run.id) + 1, robot_hash], seq, row))
                .collect(),
        };
        self.runs.iter().map(run).collect()
    }
}

fn frame(fields: &[(String, Field)], identity: [u64; 2], seq: usize, row: &[f64]) -> SensorFrame {
    let [run_id, robot_hash] = identity;
    let mut frame = SensorFrame {
        run_id,
        robot_hash,
        ..SensorFrame::default()
    };
    frame.header.seq = seq as u64;
    let t_s = row.first().copied().unwrap_or(0.0);
    frame.header.t_capture_ns = (t_s * 1e9).round() as u64;
    for ((_, field), value) in fields.iter().zip(row.iter().skip(1)) {
        if value.is_finite() {
            field.put(*value, &mut frame);
        }
    }
    frame
}

/// One imported run. What follows a pause in which nothing was measured, longer than frames of a
/// run may be apart, is a run of its own.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ImportedRun {
    /// Its id, from 0 in the order found.
    pub id: u32,
    /// File or folder that it came from, relative to the log's folder, and since when.
    pub name: String,
    /// Frames: time since the first, s, then the values in the order of [`ImportedLog::columns`];
    /// NaN where a channel was not measured. A frame of which nothing was measured is left out.
    pub rows: Vec<Vec<f64>>,
    /// Clocks that do not rise in its files.
    pub disorder: Vec<Disorder>,
    /// Messages or rows that lack a column.
    pub lacking: Vec<MissingColumn>,
    /// Topics without stamps: the recorder's time took their place.
    pub unstamped: Vec<String>,
    /// Files that are cut off: what comes before the cut was used.
    pub cut: Vec<CutBag>,
    /// Channels that are differentiated, with the rows of which nothing was made as their stamp
    /// repeats or precedes the one before: repeated packets.
    pub repeated: Vec<(String, usize)>,
}

/// An imported log.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedLog {
    /// Names of the columns after `run` and `t`.
    pub columns: Vec<String>,
    /// Runs.
    pub runs: Vec<ImportedRun>,
    /// Channels whose delay was estimated, and the delay, s.
    pub delays_s: Vec<(String, f64)>,
}

/// Adds a run, cut where its rows are further apart than those of a run may be. The times of what
/// follows begin with it; ids go on.
fn add(runs: &mut Vec<ImportedRun>, mut run: ImportedRun) {
    let name = run.name.clone();
    let (mut from_s, mut last_s) = (0.0, 0.0);
    for mut row in std::mem::take(&mut run.rows) {
        let Some(t_s) = row.first_mut() else { continue };
        if *t_s - last_s > GAP_MAX_S && !run.rows.is_empty() {
            from_s = *t_s;
            let next = ImportedRun {
                name: format!("{name}, {from_s:.2} s on"),
                ..ImportedRun::default()
            };
            push(runs, std::mem::replace(&mut run, next));
        }
        last_s = *t_s;
        *t_s = ((*t_s - from_s) * 1e6).round() * 1e-6;
        run.rows.push(row);
    }
    push(runs, run);
}

fn push(runs: &mut Vec<ImportedRun>, run: ImportedRun) {
    let id = runs.len() as u32;
    runs.push(ImportedRun { id, ..run });
}

/// Files of a run that are cut off, each once: several sources may read one file.
fn cut_files(tables: &[series::SourceTable]) -> Vec<CutBag> {
    let mut files: Vec<CutBag> = tables.iter().filter_map(|t| t.cut.clone()).collect();
    files.dedup();
    files
}

/// Reads every run below `folder` that the description names.
///
/// # Errors
/// [`ImportError`] naming what was found and what is allowed.
pub fn import(
    log: &LogDescription,
    robot: &Description,
    folder: &Path,
) -> Result<ImportedLog, ImportError> {
    // A column that frames may lack is there if the log describes it.
    let is_wanted = |(name, field): &(String, Field)| {
        !field.is_optional() || log.channel.iter().any(|channel| channel.name == *name)
    };
    let columns = fields(robot).into_iter().filter(is_wanted);
    let columns: Vec<String> = columns.map(|(name, _)| name).collect();
    log.check(&columns)?;
    let mut found = Vec::new();
    for place in find::runs(folder, &log.runs)? {
        found.extend(RunPlace::all(log, place)?);
    }
    let (mut runs, mut delays) = (Vec::new(), Vec::new());
    for (id, place) in found.iter().enumerate() {
        let mut series = Vec::with_capacity(columns.len());
        let tables = series::tables(log, place)?;
        for column in &columns {
            let channel = log
                .channel
                .iter()
                .find(|channel| channel.name == *column)
                .ok_or_else(|| {
                    ImportError::description("channel", format!("{column} is missing"))
                })?;
            series.push(Series::new(channel, &tables)?);
        }
        if id == 0 {
            delays = delay::estimate(log, &columns, &series)?;
        }
        for (channel, series) in log.in_order(&columns).zip(&mut series) {
            let estimated = delays.iter().find(|(name, _)| *name == channel.name);
            series.shift_earlier(
                channel
                    .delay_s
                    .given_s(estimated.map(|(_, delay_s)| *delay_s)),
            );
        }
        let grid = Grid::new(log, &columns, &series, &place.path)?;
        let repeated = columns.iter().zip(&series);
        let repeated = repeated.filter(|(_, series)| series.repeated > 0);
        let run = ImportedRun {
            cut: cut_files(&tables),
            unstamped: tables.iter().filter_map(|t| t.unstamped.clone()).collect(),
            lacking: tables.iter().filter_map(|t| t.lacking.clone()).collect(),
            disorder: tables
                .into_iter()
                .flat_map(|table| table.disorder)
                .collect(),
            repeated: repeated
                .map(|(column, series)| (column.clone(), series.repeated))
                .collect(),
            id: 0,
            name: place.name(folder),
            rows: grid.rows(log, robot, &columns, &series)?,
        };
        add(&mut runs, run);
    }
    Ok(ImportedLog {
        columns,
        runs,
        delays_s: delays,
    })
}

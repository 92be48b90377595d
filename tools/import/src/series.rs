//! One channel of one run, as measured: times and values in SI.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use vigil_inference::angle::wrap;
use vigil_recording::table::{Layout, Table};

use super::ImportError;
use super::bag::CutBag;
use super::description::{ChannelSource, Clock, LogDescription, Source};
use super::ros::{self, MissingColumn, TopicColumns};

/// Columns of one source that are needed, with their rows.
pub(super) struct SourceTable {
    name: String,
    path: PathBuf,
    columns: Vec<String>,
    values: Vec<Vec<f64>>,
    /// When each row was measured, s, on the common clock.
    time_s: Vec<f64>,
    /// The device's clock, s.
    device_s: Vec<f64>,
    /// What was out of order.
    pub disorder: Vec<Disorder>,
    /// Messages of which nothing was made.
    pub lacking: Option<MissingColumn>,
    /// Its topic, if the recorder's time took the place of stamps.
    pub unstamped: Option<String>,
    /// Where its file is cut off, if it is.
    pub cut: Option<CutBag>,
}

/// Rows of a file whose clock does not rise: they are put in order of time and counted.
#[derive(Debug, Clone, PartialEq)]
pub struct Disorder {
    /// The file.
    pub path: PathBuf,
    /// Column of the clock.
    pub column: String,
    /// Rows that are earlier than the one before.
    pub rows: usize,
    /// The first of them; from 1, the header not counted.
    pub first_row: usize,
    /// By how much the worst of them goes back, s.
    pub back_s: f64,
}

/// Rows earlier than the one before by more than this are refused, s.
const BACK_S_MAX: f64 = 1.0;

impl SourceTable {
    fn column(&self, name: &str) -> Option<&Vec<f64>> {
        let at = self.columns.iter().position(|column| column == name)?;
        self.values.get(at)
    }

    fn wrong(&self, row: usize, message: String) -> ImportError {
        vigil_recording::table::wrong_row(&self.path, row as u64 + 1, message).into()
    }
}

/// Reads what the channels need from every source of a run.
pub(super) fn tables(log: &LogDescription, run: &Path) -> Result<Vec<SourceTable>, ImportError> {
    let mut tables = Vec::with_capacity(log.source.len());
    for source in &log.source {
        tables.push(read(log, source, run)?);
    }
    for (i, source) in log.source.iter().enumerate() {
        let Some([other, column]) = &source.time_as else {
            continue;
        };
        let shift_s = tables
            .iter()
            .find(|table| table.name == *other)
            .and_then(|table| {
                let factor = source.time.unit.factor();
                let theirs = table.column(column)?.iter().map(|value| value * factor);
                let mut apart: Vec<f64> = table
                    .time_s
                    .iter()
                    .zip(theirs)
                    .map(|(a, b)| a - b)
                    .collect();
                apart.sort_by(f64::total_cmp);
                apart.get(apart.len() / 2).copied()
            })
            .unwrap_or(0.0);
        if let Some(table) = tables.get_mut(i) {
            table
                .time_s
                .iter_mut()
                .for_each(|time_s| *time_s += shift_s);
        }
    }
    Ok(tables)
}

fn read(log: &LogDescription, source: &Source, run: &Path) -> Result<SourceTable, ImportError> {
    let path = source
        .file
        .as_ref()
        .map_or(run.to_path_buf(), |file| run.join(file));
    let mut columns: Vec<String> = vec![source.time.column.clone()];
    let mut add = |name: &String| {
        if !columns.contains(name) {
            columns.push(name.clone());
        }
    };
    source
        .device_clock
        .iter()
        .for_each(|clock| add(&clock.column));
    let channels = log.channel.iter().filter(|c| c.source == source.name);
    channels.for_each(|channel| add(&channel.column));
    let others = log.source.iter().filter_map(|other| other.time_as.as_ref());
    others
        .filter(|[name, _]| *name == source.name)
        .for_each(|[_, column]| add(column));
    let TopicColumns {
        values,
        lacking,
        is_unstamped,
        cut,
    } = match &source.topic {
        Some(topic) => ros::columns(&path, topic, &columns)?,
        None => TopicColumns {
            values: table_columns(&path, source, &columns)?,
            lacking: None,
            is_unstamped: false,
            cut: None,
        },
    };
    let mut out = SourceTable {
        name: source.name.clone(),
        path,
        columns,
        values,
        time_s: Vec::new(),
        device_s: Vec::new(),
        disorder: Vec::new(),
        lacking,
        unstamped: source.topic.clone().filter(|_| is_unstamped),
        cut,
    };
    let (time_s, disorder) = clock(&out, &source.time)?;
    out.disorder.extend(disorder);
    out.device_s = match &source.device_clock {
        None => time_s.clone(),
        Some(device) => {
            let (device_s, disorder) = clock(&out, device)?;
            out.disorder.extend(disorder);
            device_s
        }
    };
    out.time_s = time_s;
    if source.device_clock.is_some() {
        out.time_s = steady(&out.device_s, &out.time_s);
    }
    Ok(out)
}

/// Columns of a CSV file.
fn table_columns(
    path: &Path,
    source: &Source,
    columns: &[String],
) -> Result<Vec<Vec<f64>>, ImportError> {
    let layout = Layout {
        delimiter: source.delimiter as u8,
        skip_rows: source.skip_rows,
    };
    let mut table = Table::open_as(path, layout)?;
    let at = table.require(columns)?;
    let mut values = vec![Vec::new(); at.len()];
    while table.advance()? {
        for (values, &at) in values.iter_mut().zip(&at) {
            values.push(table.number(at)?);
        }
    }
    Ok(values)
}

/// Times of a clock column, s, unwrapped, and what is out of order among them.
fn clock(table: &SourceTable, clock: &Clock) -> Result<(Vec<f64>, Option<Disorder>), ImportError> {
    let values = table.column(&clock.column).map_or(&[][..], Vec::as_slice);
    let unwrapped = match clock.modulus {
        Some(modulus) => unwrap(values, modulus),
        None => values.to_vec(),
    };
    let times: Vec<f64> = unwrapped
        .iter()
        .map(|value| value * clock.unit.factor())
        .collect();
    let back_s = times.windows(2).map(|pair| pair[0] - pair[1]);
    let back: Vec<(usize, f64)> = back_s
        .enumerate()
        .filter(|(_, back_s)| *back_s > 0.0)
        .collect();
    if let Some((row, back_s)) = back.iter().find(|(_, back_s)| *back_s > BACK_S_MAX) {
        let name = &clock.column;
        let message = format!("{name} goes back by {back_s:.3} s: time must rise within a run");
        return Err(table.wrong(row + 1, message));
    }
    let disorder = back.first().map(|(first, _)| Disorder {
        path: table.path.clone(),
        column: clock.column.clone(),
        rows: back.len(),
        // The pair's second row, counted from 1.
        first_row: first + 2,
        back_s: back.iter().map(|(_, back_s)| *back_s).fold(0.0, f64::max),
    });
    Ok((times, disorder))
}

/// The device's clock brought to the other by a line, whose offset and rate are constants of the
/// run: the device keeps time better than the computer that stamps what arrives.
fn steady(device_s: &[f64], time_s: &[f64]) -> Vec<f64> {
    let n = device_s.len().max(1) as f64;
    let middle = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (md, mt) = (middle(device_s), middle(time_s));
    let (mut dd, mut dt) = (1e-12, 0.0);
    for (device, time) in device_s.iter().zip(time_s) {
        dd += (device - md) * (device - md);
        dt += (device - md) * (time - mt);
    }
    device_s
        .iter()
        .map(|device| mt + (device - md) * dt / dd)
        .collect()
}

/// A counter without its jumps by `modulus`.
fn unwrap(values: &[f64], modulus: f64) -> Vec<f64> {
    let (mut turns, mut last) = (0.0, values.first().copied().unwrap_or(0.0));
    let step = |&value: &f64| {
        turns -= ((value - last) / modulus).round();
        last = value;
        value + turns * modulus
    };
    values.iter().map(step).collect()
}

/// Samples of one channel in order of time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Series {
    /// Times, s, on the common clock, rising.
    pub time_s: Vec<f64>,
    /// Values in SI.
    pub value: Vec<f64>,
    /// Rows of the file that they come from; from 1, the header not counted.
    row: Vec<usize>,
    /// The file.
    path: PathBuf,
    /// Rows of which nothing was made: their stamp repeats or precedes the one before.
    pub repeated: usize,
}

impl Series {
    /// The channel's samples.
    pub fn new(channel: &ChannelSource, tables: &[SourceTable]) -> Result<Self, ImportError> {
        let missing = || ImportError::description(&channel.name, "its source is missing");
        let mut sources = tables.iter().filter(|table| table.name == channel.source);
        let table = sources.next().ok_or_else(missing)?;
        let raw = table.column(&channel.column).ok_or_else(missing)?;
        let mut values = match channel.modulus {
            Some(modulus) => unwrap(raw, modulus),
            None => raw.clone(),
        };
        let factor = channel.unit.factor();
        values.iter_mut().for_each(|value| *value *= factor);
        if channel.angle {
            values = unwrap(&values, 2.0 * PI);
        }
        let finish = |value: f64| value * channel.scale + channel.offset;
        let mut out = Self {
            time_s: Vec::with_capacity(values.len()),
            value: Vec::with_capacity(values.len()),
            row: Vec::with_capacity(values.len()),
            path: table.path.clone(),
            repeated: 0,
        };
        let mut last: Option<(f64, f64)> = None;
        for (row, (&time_s, value)) in table.time_s.iter().zip(values).enumerate() {
            let device_s = table.device_s.get(row).copied().unwrap_or(time_s);
            let result = match (channel.differentiate, last) {
                (false, _) => Some(value),
                // A repeated stamp is a repeated packet.
                (true, Some((then_s, _))) if device_s <= then_s => None,
                (true, Some((then_s, before))) => Some((value - before) / (device_s - then_s)),
                (true, None) => None,
            };
            out.repeated += usize::from(result.is_none() && last.is_some());
            // What comes late has no part in the next difference.
            if last.is_none_or(|(then_s, _)| device_s >= then_s) {
                last = Some((device_s, value));
            }
            let Some(result) = result else { continue };
            out.insert(time_s, finish(result), row + 1);
        }
        Ok(out)
    }

    /// Adds a sample; stamps may be a little out of order.
    fn insert(&mut self, time_s: f64, value: f64, row: usize) {
        let at = self.time_s.partition_point(|&other| other <= time_s);
        self.time_s.insert(at, time_s);
        self.value.insert(at, value);
        self.row.insert(at, row);
    }

    /// An error about the sample with this index, where it stands in its file.
    pub fn wrong(&self, at: usize, message: String) -> ImportError {
        let row = self.row.get(at).copied().unwrap_or(0);
        vigil_recording::table::wrong_row(&self.path, row as u64, message).into()
    }

    /// Moves all samples to earlier times, s.
    pub fn shift_earlier(&mut self, by_s: f64) {
        self.time_s.iter_mut().for_each(|time_s| *time_s -= by_s);
    }

    /// The last sample not after `t_s`, by its index.
    pub fn last_at(&self, t_s: f64) -> Option<usize> {
        self.time_s
            .partition_point(|&time_s| time_s <= t_s)
            .checked_sub(1)
    }

    /// The value on the line between the samples around `t_s`.
    pub fn between(&self, t_s: f64) -> Option<f64> {
        let before = self.last_at(t_s)?;
        let (t0, v0) = (*self.time_s.get(before)?, *self.value.get(before)?);
        if t0 == t_s {
            return Some(v0);
        }
        let (t1, v1) = (*self.time_s.get(before + 1)?, *self.value.get(before + 1)?);
        Some(v0 + (v1 - v0) * (t_s - t0) / (t1 - t0))
    }
}

/// An angle in ±pi.
pub(super) fn wrapped(value: f64) -> f64 {
    wrap(value)
}

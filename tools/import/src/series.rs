//! One channel of one run, as measured: times and values in SI.

use std::f64::consts::PI;
use std::path::PathBuf;

use vigil_inference::angle::wrap;

use super::ImportError;
use super::bag::CutBag;
use super::description::{ChannelSource, Clock, LogDescription, Source};
use super::place::{RunPlace, table_columns};
use super::ros::{self, MissingColumn, TopicColumns};

/// Columns of one source that are needed, with their rows.
pub(super) struct SourceTable {
    name: String,
    path: PathBuf,
    columns: Vec<String>,
    values: Vec<Vec<f64>>,
    /// Which row of the file, or message of the topic, each is; from 1, the header not counted.
    rows: Vec<usize>,
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
        let row = self.rows.get(row).copied().unwrap_or(0);
        vigil_recording::table::wrong_row(&self.path, row as u64, message).into()
    }

    /// A channel's rows, where all its columns have a value, and the sum of these.
    fn sum(&self, channel: &ChannelSource) -> Option<(Vec<usize>, Vec<f64>)> {
        let terms = channel
            .terms()
            .map(|(name, factor)| Some((self.column(name)?, factor)));
        let terms = terms.collect::<Option<Vec<_>>>()?;
        let whole = |row: &usize| {
            let mut values = terms.iter().map(|(column, _)| column.get(*row));
            values.all(|value| value.is_some_and(|value| value.is_finite()))
        };
        let rows: Vec<usize> = (0..self.time_s.len()).filter(whole).collect();
        let mut sums = vec![0.0; rows.len()];
        for (column, factor) in terms {
            let values = rows.iter().filter_map(|&row| column.get(row).copied());
            let mut values: Vec<f64> = values.collect();
            if let Some(modulus) = channel.modulus {
                values = unwrap(&values, modulus);
            }
            sums.iter_mut()
                .zip(values)
                .for_each(|(sum, value)| *sum += factor * value);
        }
        Some((rows, sums))
    }
}

/// Reads what the channels need from every source of a run.
pub(super) fn tables(
    log: &LogDescription,
    run: &RunPlace,
) -> Result<Vec<SourceTable>, ImportError> {
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
                let apart = table.time_s.iter().zip(theirs).map(|(a, b)| a - b);
                median(apart.filter(|apart| apart.is_finite()).collect())
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

fn read(log: &LogDescription, source: &Source, run: &RunPlace) -> Result<SourceTable, ImportError> {
    let path = run.file(source);
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
    channels.for_each(|channel| channel.terms().for_each(|(column, _)| add(column)));
    let others = log.source.iter().filter_map(|other| other.time_as.as_ref());
    others
        .filter(|[name, _]| *name == source.name)
        .for_each(|[_, column]| add(column));
    let TopicColumns {
        mut values,
        mut rows,
        lacking,
        is_unstamped,
        cut,
    } = match &source.topic {
        Some(topic) => ros::columns(&path, topic, &columns)?,
        None => table_columns(&path, source, &columns, run.part.as_ref())?,
    };
    let clocks = if source.device_clock.is_some() { 2 } else { 1 };
    drop_timeless(&mut values, &mut rows, clocks);
    let mut out = SourceTable {
        name: source.name.clone(),
        path,
        columns,
        values,
        rows,
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

/// Drops the rows without a time; the first `clocks` columns are times.
fn drop_timeless(values: &mut [Vec<f64>], rows: &mut Vec<usize>, clocks: usize) {
    let (times, _) = values.split_at(clocks.min(values.len()));
    let has_time = |row| {
        let mut times = times.iter().map(|time| time.get(row));
        times.all(|time| time.is_some_and(|t: &f64| t.is_finite()))
    };
    let kept: Vec<bool> = (0..rows.len()).map(has_time).collect();
    if kept.iter().all(|kept| *kept) {
        return;
    }
    for column in values {
        let mut kept = kept.iter();
        column.retain(|_| kept.next() == Some(&true));
    }
    let mut kept = kept.iter();
    rows.retain(|_| kept.next() == Some(&true));
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
        let (rows, mut values) = table.sum(channel).ok_or_else(missing)?;
        if values.is_empty() {
            let message = format!("column {}: there is no value", channel.column_names());
            return Err(table.wrong(0, message));
        }
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
        for (row, value) in rows.into_iter().zip(values) {
            let time_s = table.time_s.get(row).copied().unwrap_or(f64::NAN);
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
            let row = table.rows.get(row).copied().unwrap_or(0);
            out.insert(time_s, finish(result), row);
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

    /// Median time between two samples, s; 0 of fewer.
    pub fn period_s(&self) -> f64 {
        let apart = self.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        median(apart.collect()).unwrap_or(0.0)
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

/// The middle value, of two the larger; none of none.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// An angle in ±pi.
pub(super) fn wrapped(value: f64) -> f64 {
    wrap(value)
}

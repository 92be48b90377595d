//! The channels of a run on one clock.

use std::path::Path;

use vigil_recording::frames::GAP_MAX_S;
use vigil_robot::Description;

use super::ImportError;
use super::description::{ChannelSource, LogDescription, Method};
use super::series::{Series, wrapped};

/// Shortest run, s.
const RUN_MIN_S: f64 = 1.0;
/// A channel is not measured between samples further apart than so many usual periods and frames.
const PAUSE_PERIODS: f64 = 2.5;
const PAUSE_FRAMES: f64 = 1.5;

/// The common clock of a run.
pub(super) struct Grid {
    start_s: f64,
    period_s: f64,
    count: usize,
}

impl Grid {
    /// From the first time at which every measured channel has a value to the last.
    pub fn new(
        log: &LogDescription,
        columns: &[String],
        series: &[Series],
        path: &Path,
    ) -> Result<Self, ImportError> {
        let (mut start_s, mut end_s) = (f64::NEG_INFINITY, f64::INFINITY);
        for (channel, series) in log.in_order(columns).zip(series) {
            if channel.method != Method::Hold {
                start_s = start_s.max(series.time_s.first().copied().unwrap_or(f64::INFINITY));
                end_s = end_s.min(series.time_s.last().copied().unwrap_or(f64::NEG_INFINITY));
            }
        }
        let length_s = end_s - start_s;
        if !(length_s.is_finite() && length_s >= RUN_MIN_S) {
            return Err(ImportError::Apart {
                path: path.to_path_buf(),
                needed_s: RUN_MIN_S,
            });
        }
        let period_s = 1.0 / log.rate_hz;
        Ok(Self {
            start_s,
            period_s,
            count: (length_s / period_s).floor() as usize + 1,
        })
    }

    /// The frames: time since the start, then every channel; NaN where one was not measured. The
    /// rover's channels always are: there the last value stands.
    pub fn rows(
        &self,
        log: &LogDescription,
        robot: &Description,
        columns: &[String],
        series: &[Series],
    ) -> Result<Vec<Vec<f64>>, ImportError> {
        let mut is_measured = vec![false; self.count];
        let mut rows: Vec<Vec<f64>> = (0..self.count)
            .map(|i| vec![(i as f64 * self.period_s * 1e6).round() * 1e-6])
            .collect();
        for (channel, series) in log.in_order(columns).zip(series) {
            self.check(robot, channel, series)?;
            let is_command = channel.method == Method::Hold;
            let period_s = series.period_s();
            for (i, row) in rows.iter_mut().enumerate() {
                let t_s = self.start_s + i as f64 * self.period_s;
                let value = self.value(channel, series, t_s);
                let value = if channel.angle { wrapped(value) } else { value };
                let pauses = !is_command && self.is_pause(series, period_s, t_s);
                is_measured[i] |= !is_command && !pauses;
                let is_lost = pauses && !robot.has_fault_models();
                row.push(if is_lost { f64::NAN } else { value });
            }
        }
        for (channel, series) in log.in_order(columns).zip(series) {
            if channel.method == Method::Hold {
                self.check_held(log, channel, (series, &is_measured))?;
            }
        }
        let mut is_measured = is_measured.into_iter();
        rows.retain(|_| is_measured.next().unwrap_or(false));
        Ok(rows)
    }

    /// True if samples that usually follow each other in `period_s` pause: the last one is long
    /// ago, and the next one far off.
    fn is_pause(&self, series: &Series, period_s: f64, t_s: f64) -> bool {
        let Some(last) = series.last_at(t_s) else {
            return false;
        };
        let at = |i: usize| series.time_s.get(i).copied();
        let (Some(from_s), Some(until_s)) = (at(last), at(last + 1)) else {
            return false;
        };
        let longest_s = (PAUSE_PERIODS * period_s).max(PAUSE_FRAMES * self.period_s);
        until_s - from_s > longest_s && t_s - from_s > period_s.max(self.period_s)
    }

    fn value(&self, channel: &ChannelSource, series: &Series, t_s: f64) -> f64 {
        let Some(last) = series.last_at(t_s) else {
            return channel.initial;
        };
        let held = series.value.get(last).copied().unwrap_or(channel.initial);
        match channel.method {
            Method::Hold => held,
            Method::Interpolate => series.between(t_s).unwrap_or(held),
            Method::Mean => {
                let since = series
                    .last_at(t_s - self.period_s)
                    .map_or(0, |before| before + 1);
                let fresh = series.value.get(since..=last).unwrap_or(&[]);
                if fresh.is_empty() {
                    held
                } else {
                    fresh.iter().sum::<f64>() / fresh.len() as f64
                }
            }
        }
    }

    /// Refuses a long pause of a channel of the rover, for which the last value would stand.
    fn check(
        &self,
        robot: &Description,
        channel: &ChannelSource,
        series: &Series,
    ) -> Result<(), ImportError> {
        let is_refused = robot.has_fault_models() && channel.method != Method::Hold;
        let pairs = series.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        let mut pauses = pairs.enumerate().filter(|_| is_refused);
        match pauses.find(|(_, gap_s)| *gap_s > GAP_MAX_S) {
            None => Ok(()),
            Some((at, gap_s)) => {
                let column = channel.column_names();
                let message = format!(
                    "column {column}: a gap of {gap_s:.3} s, allowed is {GAP_MAX_S} s: cut the run \
                     there"
                );
                Err(series.wrong(at + 1, message))
            }
        }
    }

    /// Refuses a value that is held for too long; where no frame is, no time counts.
    fn check_held(
        &self,
        log: &LogDescription,
        channel: &ChannelSource,
        (series, is_measured): (&Series, &[bool]),
    ) -> Result<(), ImportError> {
        let limit_s = log.hold_max_s;
        let (mut held, mut frames) = (None, 0_usize);
        let mut too_long = None;
        let measured = is_measured.iter().enumerate().filter(|(_, is)| **is);
        for (i, _) in measured {
            let last = series.last_at(self.start_s + i as f64 * self.period_s);
            if last != held && too_long.is_some() {
                break;
            }
            frames = if last == held { frames + 1 } else { 0 };
            held = last;
            let held_s = frames as f64 * self.period_s;
            too_long = last.filter(|_| held_s > limit_s).map(|at| (at, held_s));
        }
        let Some((at, held_s)) = too_long else {
            return Ok(());
        };
        let column = channel.column_names();
        let message = format!(
            "column {column}: its value is held for {held_s:.3} s; hold_max_s allows {limit_s} s: \
             cut the run there, or raise it if only changes are recorded"
        );
        Err(series.wrong(at, message))
    }
}

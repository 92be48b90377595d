//! The channels of a run on one clock.

use std::path::Path;

use super::ImportError;
use super::description::{ChannelSource, LogDescription, Method};
use super::series::{Series, wrapped};

/// Shortest run, s.
const RUN_MIN_S: f64 = 1.0;

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

    /// The frames: time since the start, then every channel.
    pub fn rows(
        &self,
        log: &LogDescription,
        columns: &[String],
        series: &[Series],
    ) -> Result<Vec<Vec<f64>>, ImportError> {
        let mut rows: Vec<Vec<f64>> = (0..self.count)
            .map(|i| vec![(i as f64 * self.period_s * 1e6).round() * 1e-6])
            .collect();
        for (channel, series) in log.in_order(columns).zip(series) {
            check(log, channel, series)?;
            for (i, row) in rows.iter_mut().enumerate() {
                let t_s = self.start_s + i as f64 * self.period_s;
                let value = self.value(channel, series, t_s);
                row.push(if channel.angle { wrapped(value) } else { value });
            }
        }
        Ok(rows)
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
}

/// Refuses a pause of a measured channel that is too long.
fn check(
    log: &LogDescription,
    channel: &ChannelSource,
    series: &Series,
) -> Result<(), ImportError> {
    if channel.method == Method::Hold {
        return Ok(());
    }
    let mut pairs = series.time_s.windows(2);
    let Some(at) = pairs.position(|pair| pair[1] - pair[0] > log.gap_max_s) else {
        return Ok(());
    };
    let gap_s = series.time_s[at + 1] - series.time_s[at];
    let message = format!(
        "column {}: a gap of {gap_s:.3} s; gap_max_s allows {} s",
        channel.column, log.gap_max_s
    );
    Err(series.wrong(at + 1, message))
}

//! How long it takes from the instant a cycle was due to its action.

use std::collections::VecDeque;

use hdrhistogram::Histogram;
use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::Header;

/// How far back the times reach.
const WINDOW_NS: u64 = 10_000_000_000;
/// Beyond an hour nobody waits for an action.
const LATENCY_NS_MAX: u64 = 3_600_000_000_000;

/// The actions of the last ten seconds.
#[derive(Debug, Clone, Default)]
pub struct EndToEnd {
    actions: VecDeque<Header>,
}

/// How their times are distributed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Percentiles {
    /// From the first of the actions to the last.
    pub window_s: f64,
    /// Since the last one.
    pub age_s: f64,
    /// Actions that were read.
    pub count: u64,
    /// Actions that were sent meanwhile: at high rates not every one is read.
    pub sent: u64,
    /// Actions a second.
    pub rate_hz: f64,
    /// From schedule to publication: half of them take no longer.
    pub latency_us_p50: f64,
    /// Nine in ten take no longer.
    pub latency_us_p90: f64,
    /// All but one in a hundred take no longer.
    pub latency_us_p99: f64,
    /// The longest.
    pub latency_us_max: f64,
}

impl Percentiles {
    /// True if no action comes any more: none for a second, and for three periods.
    pub fn have_ended(&self) -> bool {
        self.age_s > f64::max(1.0, 3.0 / self.rate_hz)
    }
}

impl EndToEnd {
    /// Takes the header of an action.
    pub fn push(&mut self, header: Header) {
        if self
            .actions
            .back()
            .is_some_and(|last| last.epoch != header.epoch)
        {
            self.actions.clear();
        }
        self.actions.push_back(header);
        let is_old = |first: &Header| first.t_publish_ns + WINDOW_NS < header.t_publish_ns;
        while self.actions.front().is_some_and(is_old) {
            self.actions.pop_front();
        }
    }

    /// The distribution as of `now_ns`; `None` before the second action.
    pub fn percentiles(&self, now_ns: u64) -> Option<Percentiles> {
        let (first, last) = (self.actions.front()?, self.actions.back()?);
        let window_ns = last.t_publish_ns.saturating_sub(first.t_publish_ns);
        if window_ns == 0 {
            return None;
        }
        let mut times = Histogram::<u32>::new_with_bounds(1, LATENCY_NS_MAX, 3).ok()?;
        for action in &self.actions {
            let latency_ns = action.t_publish_ns.saturating_sub(action.t_schedule_ns);
            times.saturating_record(latency_ns);
        }
        let us = |ns: u64| (ns as f64 / 100.0).round() / 10.0;
        let at = |quantile| us(times.value_at_quantile(quantile));
        let window_s = window_ns as f64 * 1e-9;
        let age_s = now_ns.saturating_sub(last.t_publish_ns) as f64 * 1e-9;
        let steps = last.seq.saturating_sub(first.seq);
        Some(Percentiles {
            window_s: (window_s * 10.0).round() / 10.0,
            age_s: (age_s * 10.0).round() / 10.0,
            count: self.actions.len() as u64,
            sent: steps + 1,
            rate_hz: (steps as f64 / window_s * 10.0).round() / 10.0,
            latency_us_p50: at(0.5),
            latency_us_p90: at(0.9),
            latency_us_p99: at(0.99),
            latency_us_max: us(times.max()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four seconds after the last action of the first test.
    const NOW_NS: u64 = 27_000_000_000;

    fn action(seq: u64, latency_ns: u64) -> Header {
        let t_schedule_ns = 1_000_000_000 + seq * 10_000_000;
        Header {
            epoch: 7,
            seq,
            t_schedule_ns,
            t_publish_ns: t_schedule_ns + latency_ns,
            ..Header::default()
        }
    }

    #[test]
    fn percentiles_are_of_the_last_ten_seconds_and_of_one_writer() {
        let mut times = EndToEnd::default();
        times.push(action(0, 900_000_000));
        assert_eq!(times.percentiles(NOW_NS), None);
        (200..=2200).for_each(|seq| times.push(action(seq, 400_000 + seq * 100)));
        let found = times.percentiles(NOW_NS).unwrap();
        // The first ones are older than ten seconds.
        assert_eq!((found.count, found.sent), (1000, 1000));
        assert_eq!((found.window_s, found.rate_hz), (10.0, 100.0));
        assert_eq!(found.age_s, 4.0);
        let p50 = found.latency_us_p50;
        assert!((p50 - 570.0).abs() < 2.0, "{p50}");
        assert!((found.latency_us_max - 620.0).abs() < 1.0, "{found:?}");
        times.push(Header {
            epoch: 8,
            ..action(2201, 1)
        });
        assert_eq!(times.percentiles(NOW_NS), None);
    }

    #[test]
    fn actions_that_were_not_read_are_counted() {
        let mut times = EndToEnd::default();
        (0..100).for_each(|seq| times.push(action(seq * 3, 1_000)));
        let found = times.percentiles(NOW_NS).unwrap();
        assert_eq!((found.count, found.sent), (100, 298));
        assert_eq!(found.rate_hz, 100.0);
    }
}

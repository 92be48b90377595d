//! Latency histograms that neither allocate nor lose what is out of range.

use hdrhistogram::{CreationError, Histogram};
use serde::{Deserialize, Serialize};

/// Largest latency that is resolved, ns; longer ones count as this long, and in `over_range`.
/// Chosen: a minute is far beyond any cycle, and the range costs a histogram hardly any memory.
pub const LATENCY_NS_MAX: u64 = 60_000_000_000;

/// Histogram of latencies in ns, three significant digits.
#[derive(Debug, Clone)]
pub struct Latency {
    histogram: Histogram<u64>,
    over_range: u64,
    max_ns: u64,
    is_off: bool,
}

/// What a person reads of a histogram, ns. All zero when nothing was recorded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Latencies recorded.
    pub n: u64,
    /// Median.
    pub p50_ns: u64,
    /// 90th percentile.
    pub p90_ns: u64,
    /// 99th percentile.
    pub p99_ns: u64,
    /// 99.9th percentile.
    pub p999_ns: u64,
    /// Largest, exact.
    pub max_ns: u64,
    /// Latencies beyond [`LATENCY_NS_MAX`].
    pub over_range: u64,
}

impl Latency {
    /// An empty histogram; the only allocation of its life.
    ///
    /// # Errors
    /// None in practice: the bounds are constants that the library accepts.
    pub fn new() -> Result<Self, CreationError> {
        let histogram = Histogram::new_with_bounds(1, LATENCY_NS_MAX, 3)?;
        Ok(Self {
            histogram,
            over_range: 0,
            max_ns: 0,
            is_off: false,
        })
    }

    /// A histogram that records nothing: to measure what recording costs.
    #[must_use]
    pub const fn switched_off(mut self) -> Self {
        self.is_off = true;
        self
    }

    /// Records one latency. Allocates nothing.
    pub fn record(&mut self, ns: u64) {
        if self.is_off {
            return;
        }
        self.max_ns = self.max_ns.max(ns);
        if ns > LATENCY_NS_MAX {
            self.over_range += 1;
        }
        self.histogram
            .saturating_record(ns.clamp(1, LATENCY_NS_MAX));
    }

    /// Latencies recorded; `None` if it records nothing.
    pub(crate) fn count(&self) -> Option<u64> {
        (!self.is_off).then(|| self.histogram.len())
    }

    /// The percentiles so far.
    #[must_use]
    pub fn percentiles(&self) -> Percentiles {
        if self.histogram.is_empty() {
            return Percentiles::default();
        }
        let n = self.histogram.len();
        assert!(
            self.over_range <= n,
            "latencies beyond the range are counted with the others: {} of {n}",
            self.over_range
        );
        let at = |quantile| self.histogram.value_at_quantile(quantile).min(self.max_ns);
        Percentiles {
            n,
            p50_ns: at(0.5),
            p90_ns: at(0.9),
            p99_ns: at(0.99),
            p999_ns: at(0.999),
            max_ns: self.max_ns,
            over_range: self.over_range,
        }
    }

    /// The whole histogram, for files.
    #[must_use]
    pub const fn histogram(&self) -> &Histogram<u64> {
        &self.histogram
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_a_known_ramp_are_right_to_three_digits() {
        let mut latency = Latency::new().unwrap();
        (1..=10_000).for_each(|us| latency.record(us * 1000));
        let p = latency.percentiles();
        assert_eq!((p.n, p.max_ns, p.over_range), (10_000, 10_000_000, 0));
        for (got, exact) in [
            (p.p50_ns, 5e6),
            (p.p90_ns, 9e6),
            (p.p99_ns, 9.9e6),
            (p.p999_ns, 9.99e6),
        ] {
            assert!(
                (got as f64 / exact - 1.0).abs() < 2e-3,
                "{got} against {exact}"
            );
        }
    }

    #[test]
    fn a_latency_out_of_range_is_kept_and_counted() {
        let mut latency = Latency::new().unwrap();
        latency.record(0);
        latency.record(u64::MAX);
        let p = latency.percentiles();
        assert_eq!((p.n, p.over_range, p.max_ns), (2, 1, u64::MAX));
    }

    #[test]
    #[should_panic(expected = "latencies beyond the range are counted with the others")]
    fn more_latencies_beyond_the_range_than_in_all_are_found() {
        let mut latency = Latency::new().unwrap();
        latency.record(1);
        latency.over_range = 2;
        let _ = latency.percentiles();
    }
}

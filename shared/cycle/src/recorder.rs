//! What a service keeps of its own cycles: histograms, and, if wanted, their stamps.

use crate::latency::Latency;
use crate::port_error::PortError;
use crate::stamps::{CycleStamps, Stamps};

/// The histograms of a service.
#[derive(Debug, Clone)]
pub struct Timing {
    /// From the publication of the input to the wake-up, ns.
    pub wake_up: Latency,
    /// From the wake-up to the publication of the output, ns.
    pub step: Latency,
    /// From the sensor's scheduled instant to the publication of the output, ns; every instant of
    /// the schedule is in it.
    pub from_schedule: Latency,
}

impl Timing {
    /// Empty histograms.
    ///
    /// # Errors
    /// None in practice; see [`Latency::new`].
    pub fn new() -> Result<Self, PortError> {
        let new = || Latency::new().map_err(|error| PortError::setup("histogram", error));
        Ok(Self {
            wake_up: new()?,
            step: new()?,
            from_schedule: new()?,
        })
    }

    /// Histograms that record nothing.
    #[must_use]
    pub fn switched_off(self) -> Self {
        Self {
            wake_up: self.wake_up.switched_off(),
            step: self.step.switched_off(),
            from_schedule: self.from_schedule.switched_off(),
        }
    }
}

/// Histograms and stamps of a service's cycles.
#[derive(Debug, Clone)]
pub struct Recorder {
    /// The histograms.
    pub timing: Timing,
    stamps: Option<Stamps>,
    cycles: u64,
}

impl Recorder {
    /// Empty histograms, no stamps.
    ///
    /// # Errors
    /// None in practice; see [`Timing::new`].
    pub fn new() -> Result<Self, PortError> {
        Ok(Self {
            timing: Timing::new()?,
            stamps: None,
            cycles: 0,
        })
    }

    /// The same recorder, which also keeps the stamps of the last `capacity` cycles.
    #[must_use]
    pub fn with_stamps(mut self, capacity: usize) -> Self {
        self.stamps = Some(Stamps::new(capacity));
        self
    }

    /// The same recorder without histograms: to measure what they cost.
    #[must_use]
    pub fn without_timing(mut self) -> Self {
        self.timing = self.timing.switched_off();
        self
    }

    /// The stamps of the last cycles, if they are kept.
    #[must_use]
    pub const fn stamps(&self) -> Option<&Stamps> {
        self.stamps.as_ref()
    }

    /// Cycles kept so far.
    pub(crate) const fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Keeps a cycle that has published; returns its time from wake-up to publication, ns.
    pub fn keep(&mut self, cycle: CycleStamps) -> u64 {
        let cycle_ns = cycle.t_publish_ns.saturating_sub(cycle.t_wake_ns);
        self.timing.step.record(cycle_ns);
        self.cycles += 1;
        let recorded = self.timing.step.count().unwrap_or(self.cycles);
        assert!(
            recorded == self.cycles,
            "the histogram counts every cycle: {recorded} of {}",
            self.cycles
        );
        if let Some(stamps) = &mut self.stamps {
            stamps.push(cycle);
        }
        cycle_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "the histogram counts every cycle: 2 of 1")]
    fn a_histogram_with_a_cycle_too_many_is_found() {
        let mut recorder = Recorder::new().unwrap();
        recorder.timing.step.record(1);
        recorder.keep(CycleStamps::default());
    }

    #[test]
    fn a_recorder_without_histograms_keeps_stamps() {
        let recorder = Recorder::new().unwrap().without_timing();
        let mut recorder = recorder.with_stamps(2);
        recorder.keep(CycleStamps::default());
        assert_eq!(recorder.timing.step.percentiles().n, 0);
        assert_eq!(recorder.stamps().unwrap().iter().count(), 1);
    }
}

//! What a service keeps of its own cycles: histograms, and, if wanted, their stamps.

use crate::port::PortError;
use crate::stage::Timing;
use crate::stamps::{CycleStamps, Stamps};

/// Histograms and stamps of a service's cycles.
#[derive(Debug, Clone)]
pub struct Recorder {
    /// The histograms.
    pub timing: Timing,
    stamps: Option<Stamps>,
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
        })
    }

    /// The same, which keeps the stamps of the last `capacity` cycles.
    #[must_use]
    pub fn with_stamps(mut self, capacity: usize) -> Self {
        self.stamps = Some(Stamps::new(capacity));
        self
    }

    /// The same without histograms: what they cost can be measured.
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

    /// Keeps a cycle that has published; returns its time from wake-up to publication, ns.
    pub fn keep(&mut self, cycle: CycleStamps) -> u64 {
        let cycle_ns = cycle.t_publish_ns.saturating_sub(cycle.t_wake_ns);
        self.timing.step.record(cycle_ns);
        if let Some(stamps) = &mut self.stamps {
            stamps.push(cycle);
        }
        cycle_ns
    }
}

//! What a service does about its own missed deadlines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a service does when a deadline passes before its block is out. It is always counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OnMiss {
    /// Nothing more: readers see silence.
    Count,
    /// Publishes the prediction at once, without the input that is missing. A source predicts
    /// nothing and only counts.
    #[default]
    Predict,
    /// As `predict`, and the service calls itself degraded until 100 cycles in a row are in time.
    Degrade,
    /// Ends the service, and with it the graph: the last action expires and the robot stops.
    Stop,
}

impl OnMiss {
    /// True if a prediction goes out in place of the missing block.
    #[must_use]
    pub const fn predicts(self) -> bool {
        matches!(self, Self::Predict | Self::Degrade)
    }
}

/// Cycles in time after which a service is no longer degraded for being late: a second at 100 Hz.
/// Fewer, and `degraded` would flicker; more, and it would outlast its cause.
pub const IN_TIME_AGAIN: u32 = 100;

/// Whether a service is to be called degraded for being late.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lateness {
    in_time: u32,
    is_late: bool,
}

impl Lateness {
    /// Takes the misses of one turn, and whether it published a cycle; true while degraded.
    pub const fn take(&mut self, on_miss: OnMiss, missed: u64, published: bool) -> bool {
        if missed > 0 {
            self.in_time = 0;
            self.is_late = matches!(on_miss, OnMiss::Degrade);
        } else if published && self.is_late {
            self.in_time += 1;
            self.is_late = self.in_time < IN_TIME_AGAIN;
        }
        assert!(
            !self.is_late || self.in_time < IN_TIME_AGAIN,
            "enough cycles in time end the lateness"
        );
        self.is_late
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_row_of_cycles_in_time_ends_lateness() {
        let mut lateness = Lateness::default();
        assert!(!lateness.take(OnMiss::Degrade, 0, true));
        assert!(lateness.take(OnMiss::Degrade, 2, false));
        for _ in 1..IN_TIME_AGAIN {
            assert!(lateness.take(OnMiss::Degrade, 0, true));
        }
        assert!(lateness.take(OnMiss::Degrade, 1, true));
        for _ in 1..IN_TIME_AGAIN {
            assert!(lateness.take(OnMiss::Degrade, 0, true));
            assert!(lateness.take(OnMiss::Degrade, 0, false));
        }
        assert!(!lateness.take(OnMiss::Degrade, 0, true));
        assert!(!lateness.take(OnMiss::Predict, 1, true));
    }

    #[test]
    #[should_panic(expected = "enough cycles in time end the lateness")]
    fn lateness_that_outlasts_its_cycles_is_found() {
        let mut lateness = Lateness {
            in_time: IN_TIME_AGAIN,
            is_late: true,
        };
        lateness.take(OnMiss::Degrade, 0, false);
    }
}

//! The filter against exact answers, an independent implementation, and hostile input.
#![allow(clippy::unwrap_used)]

mod exact;
mod hostile;
mod levels;
mod numbers;
mod rover;

use super::plain::Plain;
use super::processor::{Level, Processor};

/// Every way to compute that this machine has, and whether it rounds as fused operations do.
pub(super) fn processors() -> Vec<(Processor, bool)> {
    let available = Level::ALL.into_iter().filter_map(|level| {
        let is_fused = level != Level::Plain || super::processor::PLAIN_IS_FUSED;
        Some((Processor::at(level)?, is_fused))
    });
    available.chain([(Processor::Fused(Plain), true)]).collect()
}

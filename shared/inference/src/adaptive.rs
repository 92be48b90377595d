//! The number of particles that a belief needs: KLD-sampling.
//!
//! With k occupied cells, `n` particles keep the Kullback-Leibler distance between their histogram
//! and the belief below `error` with the probability of the quantile `z` if
//! `n = (k-1)/(2 error) · (1 - 2/(9(k-1)) + sqrt(2/(9(k-1))) z)³` (Fox, *Adapting the Sample Size
//! in Particle Filters Through KLD-Sampling*, 2003, equation 12, by the Wilson-Hilferty
//! approximation). The cells are counted on the weighted particles before resampling.

use vigil_checkpoint::CheckpointValue;

/// Counts occupied cells and gives the number of particles for the next step.
#[derive(Debug, Clone, CheckpointValue)]
pub struct Adaptive {
    error: f64,
    quantile: f64,
    count_min: usize,
    /// Open-addressing table; a slot holds the round in which it was taken, and its cell. Rounds
    /// save clearing it.
    slots: Vec<(u64, u64)>,
    round: u64,
}

impl Adaptive {
    /// For at most `count_max` particles: distance `error` (above 0), quantile `z` of the normal
    /// distribution (2.33 for 99 %), at least `count_min` particles.
    #[must_use]
    pub fn new(error: f64, quantile: f64, count_min: usize, count_max: usize) -> Self {
        Self {
            error: error.max(1e-9),
            quantile,
            count_min: count_min.max(1),
            slots: vec![(0, 0); (2 * count_max.max(1)).next_power_of_two()],
            round: 0,
        }
    }

    /// Particles that a belief with these occupied cells needs.
    pub fn count(&mut self, cells: impl Iterator<Item = u64>) -> usize {
        self.round += 1;
        let mask = self.slots.len() - 1;
        let mut occupied = 0_usize;
        for cell in cells {
            // Fibonacci hashing (2^64 over the golden ratio) spreads neighbouring cells.
            let mut at = (cell.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20) as usize & mask;
            while self.slots[at].0 == self.round && self.slots[at].1 != cell {
                at = (at + 1) & mask;
            }
            if self.slots[at].0 != self.round {
                self.slots[at] = (self.round, cell);
                occupied += 1;
            }
            // More cells than particles need the most particles anyway, and the table must not
            // fill.
            if occupied > mask / 2 + 1 {
                break;
            }
        }
        self.needed(occupied)
    }

    /// Fox's equation 12.
    fn needed(&self, occupied: usize) -> usize {
        if occupied < 2 {
            return self.count_min;
        }
        let free = (occupied - 1) as f64;
        let ninth = 2.0 / (9.0 * free);
        let cube = (1.0 - ninth + ninth.sqrt() * self.quantile).powi(3);
        ((free / (2.0 * self.error) * cube).ceil() as usize).max(self.count_min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_half_a_chi_squared_quantile_over_the_error() {
        // 99 % quantiles of chi-squared for 1, 10 and 50 degrees of freedom.
        let adaptive = Adaptive::new(0.01, 2.326_347_9, 1, 1_000_000);
        for (occupied, quantile) in [(2, 6.635), (11, 23.209), (51, 76.154)] {
            let expected = quantile / (2.0 * 0.01);
            let found = adaptive.needed(occupied) as f64;
            assert!(
                (found / expected - 1.0).abs() < 0.02,
                "{occupied}: {found} not {expected}"
            );
        }
    }

    #[test]
    fn cells_are_counted_once_each_round() {
        let mut adaptive = Adaptive::new(0.05, 2.33, 10, 64);
        let few = adaptive.count([3, 3, 3, 9, 9].into_iter());
        assert_eq!(few, adaptive.needed(2));
        assert_eq!(adaptive.count(std::iter::repeat_n(7, 40)), 10);
        let many = adaptive.count((0..64).map(|i| i * 1_000_003));
        assert_eq!(many, adaptive.needed(64));
        assert!(adaptive.count(0..10_000) >= many);
    }
}

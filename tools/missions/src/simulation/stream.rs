//! The random numbers of one episode.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::fnv1a;

/// One of many missions that are drawn alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Episode {
    /// Seed of all of them.
    pub seed: u64,
    /// Which one.
    pub number: u64,
}

/// Uniform numbers in [0, 1): one for the start, then three a step, whoever acts.
#[derive(Debug, Clone)]
pub struct Stream {
    generator: Pcg64Mcg,
}

/// The numbers of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Draw {
    /// For the next state.
    pub state: f64,
    /// For the observation.
    pub observation: f64,
    /// For an agent that acts at random.
    pub agent: f64,
}

impl Stream {
    /// The stream of an episode.
    #[must_use]
    pub fn new(episode: Episode) -> Self {
        let mixed = fnv1a::hash_u64(fnv1a::hash_u64(fnv1a::BASIS, episode.seed), episode.number);
        Self {
            generator: Pcg64Mcg::seed_from_u64(mixed),
        }
    }

    /// One number.
    pub fn number(&mut self) -> f64 {
        self.generator.random::<f64>()
    }

    /// The numbers of the next step.
    pub(super) fn draw(&mut self) -> Draw {
        Draw {
            state: self.number(),
            observation: self.number(),
            agent: self.number(),
        }
    }
}

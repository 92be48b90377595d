//! The particles' memory, and what a pass over them found.

use super::model::MODES_MAX;
use super::vector::{BUNDLE_WORDS, Block, Bundle, LANES};

/// Bundles whose sums are kept in single precision before they are added in double: few enough
/// for the rounding not to matter, and for their weights to be in the cache when they are summed.
pub(super) const CHUNK: usize = 64;

/// All buffers of a filter; none grows.
#[derive(Debug, Clone)]
pub(super) struct Cloud {
    /// The particles, weighted by the last observation.
    pub bundles: Vec<Bundle>,
    /// Room for those of the next step.
    pub next: Vec<Bundle>,
    /// Weights, then within each block their prefix sums.
    pub weights: Vec<Block<f32>>,
    /// At the first slot of each particle that goes on, its address; 0 elsewhere. One block more,
    /// for those that do not.
    pub first: Vec<Block<u32>>,
    /// Base-2 logarithms of the weights, where they outlive a step.
    pub logs: Vec<Block<f32>>,
    /// Room for those of the next step.
    pub next_logs: Vec<Block<f32>>,
}

impl Cloud {
    /// `bundles` times 16 particles at the origin; `logs` says whether weights outlive a step.
    pub(super) fn new(bundles: usize) -> Self {
        let bundle = Bundle {
            x: Block::splat(0.0),
            y: Block::splat(0.0),
            yaw: Block::splat(0.0),
            mode: Block::splat(0),
        };
        Self {
            bundles: vec![bundle; bundles],
            next: vec![bundle; bundles],
            weights: vec![Block::splat(0.0); bundles],
            first: vec![Block::splat(0); bundles + 1],
            logs: Vec::new(),
            next_logs: Vec::new(),
        }
    }

    /// Makes room for weights that outlive a step.
    pub(super) fn keep_logs(&mut self) {
        self.logs = vec![Block::splat(0.0); self.bundles.len()];
        self.next_logs = self.logs.clone();
    }

    /// All weights are equal, and nothing is selected.
    pub(super) fn forget(&mut self) {
        self.first.fill(Block::splat(0));
        self.logs.fill(Block::splat(0.0));
    }

    pub(super) const fn count(&self) -> usize {
        self.bundles.len() * LANES
    }
}

/// Addresses of the particles of bundle `index`, see [`Lanes::gather`](super::vector::Lanes).
pub(super) const fn address(index: usize) -> u32 {
    (index * BUNDLE_WORDS) as u32
}

/// Weighted sums over all particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sums {
    /// Sum of the weights.
    pub weight: f64,
    /// Of their squares.
    pub squares: f64,
    /// Of the weights of each mode.
    pub modes: [f64; MODES_MAX],
    /// Of the weights times the pose's distance from the reference: x m, y m, yaw rad.
    pub distance: [f64; 3],
}

impl Sums {
    pub(super) const ZERO: Self = Self {
        weight: 0.0,
        squares: 0.0,
        modes: [0.0; MODES_MAX],
        distance: [0.0; 3],
    };
}

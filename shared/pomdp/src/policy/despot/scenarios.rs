//! K scenarios of a belief: a state each, a weight, and a random number for every step to come.

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// The golden ratio less 1: its multiples, modulo 1, spread evenly however many there are.
const GOLDEN: f64 = 0.618_033_988_749_894_8;
/// An odd number with bits in no order (the golden ratio in 64 bits).
const MIXING: u64 = 0x9e37_79b9_7f4a_7c15;

/// The scenarios; nothing is allocated after [`Scenarios::new`].
#[derive(Debug, Clone)]
pub(super) struct Scenarios {
    seed: u64,
    rng: Pcg64Mcg,
    states: Vec<u32>,
    weights: Vec<f64>,
    /// Of the steps that are prepared: one number a scenario.
    chances: Vec<f64>,
    /// A permutation of the scenarios, for the next step.
    order: Vec<u32>,
}

impl Scenarios {
    /// So many scenarios of at most so many steps.
    pub(super) fn new(count: usize, depth: usize, seed: u64) -> Self {
        Self {
            seed,
            rng: Pcg64Mcg::seed_from_u64(seed),
            states: vec![0; count],
            weights: vec![0.0; count],
            chances: Vec::with_capacity(count * depth),
            order: vec![0; count],
        }
    }

    /// s of each scenario.
    pub(super) fn states(&self) -> &[u32] {
        &self.states
    }

    /// The weight of each scenario; they sum to 1.
    pub(super) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Draws the scenarios of a belief: what follows depends on it and on the seed alone. Entries
    /// that are no positive number count as 0; a belief of nothing else counts as uniform.
    pub(super) fn draw(&mut self, belief: &[f64]) {
        let sound = |(state, b): (usize, &f64)| {
            let is_sound = *b > 0.0 && b.is_finite();
            is_sound.then_some((state as u32, *b))
        };
        let support = || belief.iter().enumerate().filter_map(sound);
        let hash = support().fold(self.seed, |hash, (state, b)| {
            let mixed = (hash ^ b.to_bits() ^ u64::from(state)).wrapping_mul(MIXING);
            mixed.rotate_left(29)
        });
        self.rng = Pcg64Mcg::seed_from_u64(hash);
        self.chances.clear();
        let sum: f64 = support().map(|(_, b)| b).sum();
        if sum > 0.0 && sum.is_finite() {
            self.fill(support, sum);
        } else {
            let states = belief.len() as u32;
            self.fill(|| (0..states).map(|state| (state, 1.0)), f64::from(states));
        }
    }

    /// Each state of the support once, if there is room, and the rest in proportion; of a state's
    /// weight each of its scenarios has an equal part. Without room: all in proportion.
    fn fill<I: Iterator<Item = (u32, f64)>>(&mut self, support: impl Fn() -> I, sum: f64) {
        let count = self.states.len();
        let states = support().count();
        let each = usize::from(states <= count);
        let spare = (count - each * states) as f64;
        let offset: f64 = self.rng.random();
        let (mut at, mut passed) = (0, 0.0);
        for (state, b) in support() {
            // Systematic sampling: of the points offset, offset + 1, ... those up to here.
            let taken = (passed / sum * spare + offset).floor();
            passed += b;
            let due = (passed / sum * spare + offset).floor();
            let copies = (each + (due - taken).max(0.0) as usize).min(count - at);
            let weight = match each {
                1 => b / sum / copies as f64,
                _ => 1.0 / count as f64,
            };
            self.states[at..at + copies].fill(state);
            self.weights[at..at + copies].fill(weight);
            at += copies;
        }
        // What rounding has left over counts for nothing.
        self.weights[at..].fill(0.0);
    }

    /// Makes sure of the random numbers of a step; those of the steps before are there. False
    /// beyond the last step.
    pub(super) fn prepare(&mut self, step: usize) -> bool {
        let end = (step + 1) * self.states.len();
        if self.chances.len() < end && end <= self.chances.capacity() {
            self.add_step();
        }
        self.chances.len() >= end
    }

    /// The random numbers of a step, one a scenario, evenly spread over [0, 1); none of a step that
    /// is not prepared.
    pub(super) fn chances(&self, step: usize) -> &[f64] {
        let count = self.states.len();
        let chances = self.chances.get(step * count..(step + 1) * count);
        chances.unwrap_or_default()
    }

    fn add_step(&mut self) {
        // Scenarios of one state stand side by side: in the first step their numbers are spread.
        let is_first = self.chances.is_empty();
        for (place, index) in self.order.iter_mut().zip(0..) {
            *place = index;
        }
        if !is_first {
            for last in (1..self.order.len()).rev() {
                let other = (self.rng.next_u64() % (last as u64 + 1)) as usize;
                self.order.swap(last, other);
            }
        }
        let shift: f64 = self.rng.random();
        let numbers = self
            .order
            .iter()
            .map(|place| (f64::from(*place) * GOLDEN + shift).fract());
        self.chances.extend(numbers);
    }
}

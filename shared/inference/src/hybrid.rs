//! What a user's model is to the filters: discrete modes that follow a Markov chain, and a
//! continuous state that moves and is observed as the mode says.
//!
//! A model that moves by a command keeps the command of the step that comes next; every filter
//! lends its model for that (`model_mut`).

use rand_pcg::Pcg64Mcg;

use crate::gaussian::Gaussian;

/// The discrete part: `p(d_0)` and `p(d_t | d_{t-1})`.
pub trait Modes {
    /// Number of modes, at least 1. Mode 0 is the nominal one where a filter makes a difference.
    fn modes(&self) -> usize;

    /// Probability of a mode before the first transition; sums to 1. Nominal unless said
    /// otherwise.
    fn initial(&self, mode: usize) -> f64 {
        f64::from(u8::from(mode == 0))
    }

    /// Probability of `to` one step after `from`; sums to 1 over `to`.
    fn transition(&self, from: usize, to: usize) -> f64;
}

/// A hybrid system that can be simulated: all that particle filters need.
pub trait Sampled: Modes {
    /// The continuous state.
    type State: Copy;
    /// What is observed in one step.
    type Observation: ?Sized;

    /// Draws a continuous state before the first step.
    fn draw(&self, mode: usize, rng: &mut Pcg64Mcg) -> Self::State;

    /// Draws `c_t ~ p(c_t | d_t, c_{t-1})`.
    fn propagate(&self, mode: usize, state: &Self::State, rng: &mut Pcg64Mcg) -> Self::State;

    /// `ln p(z_t | d_t, c_t)`; minus infinity for what is impossible.
    fn log_likelihood(&self, mode: usize, state: &Self::State, z: &Self::Observation) -> f64;

    /// `ln p(c_t | d_t, c_{t-1})`, up to a term that is the same in every mode: for filters that
    /// compare modes on one path. 0 where the mode does not move the state.
    fn log_motion(&self, _mode: usize, _before: &Self::State, _after: &Self::State) -> f64 {
        0.0
    }

    /// A state that explains the observation by itself, for a filter that has lost its track;
    /// `None` if an observation says too little.
    fn locate(
        &self,
        _mode: usize,
        _z: &Self::Observation,
        _rng: &mut Pcg64Mcg,
    ) -> Option<Self::State> {
        None
    }

    /// The cell of a grid in which a state lies, for the adaptive number of particles; states that
    /// need not be told apart share one.
    fn cell(&self, _state: &Self::State) -> u64 {
        0
    }
}

/// A hybrid system that is linear and Gaussian given the mode, or is linearised at the mean: all
/// that banks of Kalman filters need.
pub trait Conditional<const N: usize>: Modes {
    /// What is observed in one step.
    type Observation: ?Sized;

    /// The continuous state before the first step.
    fn prior(&self, mode: usize) -> Gaussian<N>;

    /// What becomes of the state when `from` gives way to `to`, before the prediction in `to`;
    /// nothing unless said otherwise.
    fn enter(&self, _from: usize, _to: usize, _state: &mut Gaussian<N>) {}

    /// Predicts one step in `mode`.
    fn predict(&self, mode: usize, state: &mut Gaussian<N>);

    /// Conditions on an observation in `mode`; returns `ln p(z | mode, state)`. None, unchanged,
    /// for an observation that is impossible or not finite.
    fn update(&self, mode: usize, state: &mut Gaussian<N>, z: &Self::Observation) -> Option<f64>;
}

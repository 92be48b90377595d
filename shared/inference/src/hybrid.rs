//! The interface of a user's model: discrete modes that follow a Markov chain, and a continuous
//! state that moves and is observed as the mode says.
//!
//! A model that moves by a command keeps the command of the coming step; each filter lends its
//! model for that (`model_mut`).

use rand_pcg::Pcg64Mcg;

use crate::filter::SUM_TOLERANCE;
use crate::gaussian::Gaussian;

/// Largest number of modes: particles hold theirs in 16 bits.
const MODES_MAX: usize = 1 << 16;

/// Why a model was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The number of modes is out of range.
    #[error("the model has {0} modes: allowed are 1 to {MODES_MAX}")]
    Modes(usize),
    /// The probabilities of the initial modes are no distribution.
    #[error("initial probabilities add up to {0}: allowed are numbers from 0 that add up to 1")]
    Initial(f64),
    /// The probabilities of the modes after one mode are no distribution.
    #[error(
        "transitions from mode {from} add up to {sum}: allowed are numbers from 0 that add up to 1"
    )]
    Transition {
        /// Index of the mode before.
        from: usize,
        /// Sum of the row.
        sum: f64,
    },
}

/// Checks that a model's chain is one.
///
/// # Errors
/// [`ModelError`] naming the first table that is no distribution.
pub(crate) fn check(model: &impl Modes) -> Result<(), ModelError> {
    let modes = model.modes();
    if !(1..=MODES_MAX).contains(&modes) {
        return Err(ModelError::Modes(modes));
    }
    sum_to_one((0..modes).map(|mode| model.initial(mode))).map_err(ModelError::Initial)?;
    for from in 0..modes {
        let row = (0..modes).map(|to| model.transition(from, to));
        sum_to_one(row).map_err(|sum| ModelError::Transition { from, sum })?;
    }
    Ok(())
}

/// The sum, as an error, of numbers that are no probabilities or do not add up to 1.
fn sum_to_one(p: impl Iterator<Item = f64>) -> Result<(), f64> {
    let (mut sum, mut negative) = (0.0, false);
    for p in p {
        sum += p;
        negative |= p < 0.0;
    }
    let is_sound = (sum - 1.0).abs() <= SUM_TOLERANCE && !negative;
    if is_sound { Ok(()) } else { Err(sum) }
}

/// A model's probability of a transition. A chain may change after its check, with the command; a
/// number that is no probability is then impossible.
pub(crate) fn transition(model: &impl Modes, from: usize, to: usize) -> f64 {
    let p = model.transition(from, to);
    if p > 0.0 && p.is_finite() { p } else { 0.0 }
}

/// The discrete part: `p(d_0)` and `p(d_t | d_{t-1})`.
pub trait Modes {
    /// Number of modes, 1 to 65536. Mode 0 is the nominal one.
    fn modes(&self) -> usize;

    /// Probability of a mode before the first transition; sums to 1. By default the nominal mode is
    /// certain.
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

    /// `ln p(c_t | d_t, c_{t-1})`, up to a term common to all modes: for filters that compare modes
    /// on one path. 0, the default, if modes do not differ in how they move the state.
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

    /// The cell of a grid in which a state lies, for the adaptive number of particles. States that
    /// need not be distinguished share one; by default all do.
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

    /// Changes the state as `from` gives way to `to`, before the prediction in `to`. By default it
    /// stays.
    fn enter(&self, _from: usize, _to: usize, _state: &mut Gaussian<N>) {}

    /// Predicts one step in `mode`.
    fn predict(&self, mode: usize, state: &mut Gaussian<N>);

    /// Conditions on an observation in `mode`; returns `ln p(z | mode, state)`. None, unchanged,
    /// for an observation that is impossible or not finite.
    fn update(&self, mode: usize, state: &mut Gaussian<N>, z: &Self::Observation) -> Option<f64>;
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Chain {
        initial: [f64; 2],
        rows: [[f64; 2]; 2],
    }

    impl Modes for Chain {
        fn modes(&self) -> usize {
            2
        }

        fn initial(&self, mode: usize) -> f64 {
            self.initial[mode]
        }

        fn transition(&self, from: usize, to: usize) -> f64 {
            self.rows[from][to]
        }
    }

    struct Count(usize);

    impl Modes for Count {
        fn modes(&self) -> usize {
            self.0
        }

        fn transition(&self, from: usize, to: usize) -> f64 {
            f64::from(u8::from(from == to))
        }
    }

    #[test]
    fn a_chain_whose_rows_are_no_distributions_is_refused() {
        let sound = || Chain {
            initial: [0.25, 0.75],
            rows: [[0.9, 0.1], [0.0, 1.0]],
        };
        assert_eq!(check(&sound()), Ok(()));
        let altered = |initial, row| {
            let mut chain = sound();
            (chain.initial, chain.rows[1]) = (initial, row);
            check(&chain)
        };
        assert_eq!(
            altered([0.5, 0.25], [0.0, 1.0]),
            Err(ModelError::Initial(0.75))
        );
        assert_eq!(
            altered([2.0, -1.0], [0.0, 1.0]),
            Err(ModelError::Initial(1.0))
        );
        let refused = |sum| Err(ModelError::Transition { from: 1, sum });
        assert_eq!(altered([1.0, 0.0], [0.5, 0.25]), refused(0.75));
        assert_eq!(altered([1.0, 0.0], [-0.5, 1.5]), refused(1.0));
        assert!(altered([1.0, 0.0], [f64::NAN, 1.0]).is_err());
        assert_eq!(check(&Count(0)), Err(ModelError::Modes(0)));
        assert_eq!(check(&Count(65_537)), Err(ModelError::Modes(65_537)));
        assert_eq!(Count(3).initial(0), 1.0);
        assert_eq!(check(&Count(3)), Ok(()));
    }

    #[test]
    fn a_transition_that_is_no_probability_is_impossible() {
        let p = |value| {
            let rows = [[value; 2]; 2];
            let initial = [1.0, 0.0];
            transition(&Chain { initial, rows }, 0, 1)
        };
        assert_eq!([0.25, 1.0].map(p), [0.25, 1.0]);
        let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.5, 0.0];
        assert_eq!(bad.map(p), [0.0; 5]);
    }
}

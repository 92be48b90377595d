//! What the encoders do while the robot moves as it should: a small hidden Markov model with one
//! broken encoder at most.

use vigil_blocks::WHEELS;
use vigil_inference::forward::Forward;
use vigil_robot::learned::{EncoderModel, EncoderState, Observation};

use crate::modes::Leaves;

/// Ways in which an encoder breaks: zero, frozen, noise, dead (zero plus the sensor's noise).
const KINDS: [EncoderState; 4] = [
    EncoderState::Zero,
    EncoderState::Frozen,
    EncoderState::Noise,
    EncoderState::Dead,
];
/// Their prior shares.
const SHARES: [f64; KINDS.len()] = [0.32, 0.32, 0.32, 0.04];
/// States: all healthy, or one encoder broken in one way.
const STATES: usize = 1 + KINDS.len() * WHEELS;

const fn state(wheel: usize, kind: usize) -> usize {
    1 + KINDS.len() * wheel + kind
}

/// Prior shares of the states among faults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Births([f64; STATES]);

/// Log-likelihood of the readings in each state.
pub type Patterns = [f64; STATES];

impl Births {
    /// Every encoder that is a leaf breaks with probability `each`, given a fault.
    #[must_use]
    pub fn new(leaves: &Leaves, each: f64) -> Self {
        let mut births = [0.0; STATES];
        for (wheel, _) in leaves
            .encoder
            .iter()
            .enumerate()
            .filter(|(_, leaf)| leaf.is_some())
        {
            for (kind, share) in SHARES.iter().enumerate() {
                births[state(wheel, kind)] = share * each;
            }
        }
        Self(births)
    }

    /// Log-likelihood of an observation's wheel rates in each state, given that of each wheel's
    /// reading in health.
    #[must_use]
    pub fn patterns(
        &self,
        encoder: &EncoderModel,
        observation: &Observation,
        sample_sd: f64,
        healthy: &[f64],
    ) -> Patterns {
        let all: f64 = healthy.iter().sum();
        let mut patterns = [f64::NEG_INFINITY; STATES];
        patterns[0] = all;
        for (wheel, health) in healthy.iter().enumerate() {
            let reading = &observation.wheels[wheel];
            for (kind, broken) in KINDS.into_iter().enumerate() {
                if self.0[state(wheel, kind)] > 0.0 {
                    let seen = encoder.log_likelihood(broken, reading, sample_sd);
                    patterns[state(wheel, kind)] = all - health + seen;
                }
            }
        }
        patterns
    }
}

/// Belief over the encoders' states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encoders {
    belief: Forward<STATES>,
    onset: [u64; STATES],
}

impl Encoders {
    /// All encoders are healthy at `t_ns`.
    #[must_use]
    pub fn healthy(t_ns: u64) -> Self {
        Self {
            belief: Forward::at(0),
            onset: [t_ns; STATES],
        }
    }

    /// One observation: an encoder breaks with probability `birth`, recovers with `death`. Returns
    /// the log-evidence.
    pub fn step(
        &mut self,
        births: &Births,
        birth: f64,
        death: f64,
        patterns: &Patterns,
        t_ns: u64,
    ) -> f64 {
        let births = births.0.map(|share| share * birth);
        let before = *self.belief.log_p();
        for i in (1..STATES).filter(|&i| births[i] > 0.0) {
            // The onset is that of the mass that came last in quantity.
            if before[0] + births[i].ln() > before[i] {
                self.onset[i] = t_ns;
            }
        }
        self.belief.predict_star(0, &births, death);
        self.belief.update(patterns).unwrap_or(patterns[0])
    }

    /// Probability that all encoders are healthy.
    #[must_use]
    pub fn p_healthy(&self) -> f64 {
        self.belief.log_p()[0].exp()
    }

    /// Probability that this wheel's encoder is broken.
    #[must_use]
    pub fn p_broken(&self, wheel: usize) -> f64 {
        (0..KINDS.len())
            .map(|kind| self.belief.log_p()[state(wheel, kind)].exp())
            .sum()
    }

    /// Most probable onset of this wheel's broken encoder.
    #[must_use]
    pub fn onset(&self, wheel: usize) -> u64 {
        let log_p = self.belief.log_p();
        let kinds = (0..KINDS.len()).map(|kind| state(wheel, kind));
        let best = kinds.max_by(|&a, &b| log_p[a].total_cmp(&log_p[b]));
        best.map_or(0, |state| self.onset[state])
    }
}

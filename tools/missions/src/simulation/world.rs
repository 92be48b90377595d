//! The simulated world: a model in which things happen by chance.

use super::stream::{Draw, Episode, Stream};
use vigil_pomdp::Pomdp;

/// A world that follows a model.
#[derive(Debug, Clone)]
pub struct World<'m> {
    model: &'m Pomdp,
    state: usize,
    stream: Stream,
    draw: Draw,
}

/// What an action led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// The observation.
    pub observation: usize,
    /// The reward of what happened: R(s,a,s',z). Its mean is R(s,a).
    pub reward: f64,
}

impl<'m> World<'m> {
    /// An episode of a world begins, in a state drawn from the model's start belief.
    #[must_use]
    pub fn new(model: &'m Pomdp, episode: Episode) -> Self {
        let mut stream = Stream::new(episode);
        let start = model.start().iter().copied().enumerate();
        let state = drawn(start, stream.number());
        let draw = stream.draw();
        Self {
            model,
            state,
            stream,
            draw,
        }
    }

    /// The state, which no agent sees.
    #[must_use]
    pub const fn state(&self) -> usize {
        self.state
    }

    /// The number that an agent may use in this step.
    #[must_use]
    pub const fn chance(&self) -> f64 {
        self.draw.agent
    }

    /// The action is taken.
    pub fn step(&mut self, action: usize) -> Event {
        let before = self.state;
        let successors = self.model.successors(before, action).iter().copied();
        self.state = drawn(successors, self.draw.state);
        let observations = 0..self.model.observations().len();
        let likelihoods = observations.map(|z| (z, self.model.likelihood(action, z)[self.state]));
        let observation = drawn(likelihoods, self.draw.observation);
        self.draw = self.stream.draw();
        let reward = self
            .model
            .reward_of(before, action, self.state, observation);
        Event {
            observation,
            reward,
        }
    }
}

/// The outcome below whose cumulative probability `uniform` lies; the last possible one if
/// rounding leaves a rest.
fn drawn(outcomes: impl Iterator<Item = (usize, f64)>, uniform: f64) -> usize {
    let (mut sum, mut last) = (0.0, 0);
    for (outcome, p) in outcomes {
        if p > 0.0 {
            sum += p;
            last = outcome;
            if uniform < sum {
                break;
            }
        }
    }
    last
}

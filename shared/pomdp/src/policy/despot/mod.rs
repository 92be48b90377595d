//! DESPOT

mod generator;
mod scenarios;
mod tree;

use super::{Choice, Policy, choose};
use crate::alpha_vectors::AlphaVectors;
use crate::bounds::SolveError;
use crate::bounds::mdp::Solution;
use crate::model::Pomdp;
use generator::Generator;
use scenarios::Scenarios;
use tree::{Limits, Tree};

/// What a search may do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DespotOptions {
    /// K.
    pub scenarios: usize,
    /// Trials for a new belief.
    pub trials: usize,
    /// Steps.
    pub depth: usize,
    /// Cost.
    pub regularisation: f64,
    /// Seed.
    pub seed: u64,
    /// Nodes.
    pub nodes: usize,
    /// Experimental.
    pub optimism: f64,
}

impl Default for DespotOptions {
    fn default() -> Self {
        Self {
            scenarios: 100,
            trials: 200,
            depth: 90,
            regularisation: 0.0,
            seed: 1,
            nodes: 100_000,
            optimism: 0.0,
        }
    }
}

const REUSED: f64 = 1e-3;

/// Plans online.
#[derive(Debug, Clone)]
pub struct Despot {
    options: DespotOptions,
    generator: Generator,
    scenarios: Scenarios,
    tree: Tree,
    belief: Vec<f64>,
    is_planned: bool,
}

impl Despot {
    /// New.
    ///
    /// # Errors
    /// If.
    pub fn new(
        model: &Pomdp,
        solution: &Solution,
        solved: Option<&AlphaVectors>,
        options: DespotOptions,
    ) -> Result<Self, SolveError> {
        let generator = Generator::new(model, solution, solved)?;
        let limits = Limits {
            nodes: options.nodes,
            depth: options.depth,
            cost: options.regularisation * generator.span() / options.scenarios as f64,
            optimism: options.optimism,
        };
        Ok(Self {
            options,
            scenarios: Scenarios::new(options.scenarios, options.depth, options.seed),
            tree: Tree::new(&generator, options.scenarios, limits),
            belief: vec![0.0; generator.states],
            generator,
            is_planned: false,
        })
    }

    /// Goes on.
    pub fn improve_by(&mut self, trials: usize) {
        for _ in 0..trials {
            if !self.tree.grow(&self.generator, &mut self.scenarios) {
                break;
            }
        }
    }

    /// Bounds.
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        let worth = self.tree.root();
        (worth.lower, worth.upper)
    }

    fn plan(&mut self, belief: &[f64]) {
        let differences = belief.iter().zip(&self.belief).map(|(a, b)| (a - b).abs());
        if self.is_planned && 0.5 * differences.sum::<f64>() <= REUSED {
            return;
        }
        self.is_planned = true;
        self.belief.copy_from_slice(belief);
        self.scenarios.draw(belief);
        self.tree.plant(&self.generator, &self.scenarios);
        self.improve_by(self.options.trials);
    }
}

impl Policy for Despot {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        self.plan(belief);
        values.fill(f64::NEG_INFINITY);
        for (action, value) in values.iter_mut().enumerate() {
            if let Some(worth) = self.tree.action(action) {
                *value = worth.estimate;
            }
        }
        let offset = self.generator.actions;
        for (plan, action) in self.generator.plans().iter().enumerate() {
            let mut worth = 0.0;
            for (s, w) in self.scenarios.states().iter().zip(self.scenarios.weights()) {
                worth += w * self.generator.bounds(*s)[offset + plan];
            }
            let value = &mut values[*action as usize];
            *value = value.max(worth);
        }
        choose(values)
    }

    fn reset(&mut self) {
        self.is_planned = false;
    }
}

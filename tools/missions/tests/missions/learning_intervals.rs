//! Do credible intervals of learned probabilities hold what they promise?

use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, Gamma};
use rand_pcg::Pcg64Mcg;
use vigil_missions::learning::{LearnedModel, Settings, learn};
use vigil_pomdp::Pomdp;
use vigil_pomdp::model::Probabilities;

use crate::recorded::missions;

const HAND: &str = include_str!("recorded/wear.pomdp");
/// Visits that the prior counts as.
const STRENGTHS: [f64; 3] = [5.0, 20.0, 80.0];

/// How many true probabilities lie in their intervals, below and above them.
fn coverage(truth: &Pomdp, learned: &LearnedModel) -> [usize; 3] {
    let mut counts = [0; 3];
    for row in learned.rows() {
        for entry in row.entries.iter().filter(|entry| entry.learned < 1.0) {
            let p = row.row.p(truth, entry.column);
            let [low, high] = entry.interval;
            counts[usize::from(p < low) + 2 * usize::from(p > high)] += 1;
        }
    }
    counts
}

/// A row drawn from Dirichlet(`strength` times `row`).
fn drawn_row(row: &[f64], strength: f64, generator: &mut impl Rng) -> Vec<f64> {
    let draw = |p: &f64| match *p > 0.0 {
        true => Gamma::new(p * strength, 1.0).unwrap().sample(generator),
        false => 0.0,
    };
    let drawn: Vec<f64> = row.iter().map(draw).collect();
    let sum: f64 = drawn.iter().sum();
    drawn.iter().map(|weight| weight / sum).collect()
}

/// A world that the prior expects: every row is drawn around that of `hand`.
fn drawn_world(hand: &Pomdp, strength: f64, generator: &mut impl Rng) -> Pomdp {
    let (n, actions, k) = (
        hand.states().len(),
        hand.actions().len(),
        hand.observations().len(),
    );
    let start = drawn_row(hand.start(), strength, generator);
    let mut transitions = vec![Vec::new(); actions];
    let mut likelihoods = vec![0.0; actions * k * n];
    for action in 0..actions {
        for state in 0..n {
            let successors = hand.successors(state, action);
            let row: Vec<f64> = successors.iter().map(|(_, p)| *p).collect();
            let row = drawn_row(&row, strength, generator);
            let to = successors.iter().map(|(to, _)| *to);
            transitions[action].push(to.zip(row).collect::<Vec<_>>());
            let row: Vec<f64> = (0..k).map(|z| hand.likelihood(action, z)[state]).collect();
            for (z, p) in drawn_row(&row, strength, generator).into_iter().enumerate() {
                likelihoods[(action * k + z) * n + state] = p;
            }
        }
    }
    let probabilities = Probabilities {
        start,
        transitions,
        likelihoods,
    };
    hand.with_probabilities(probabilities).unwrap()
}

#[test]
fn where_the_prior_is_right_they_do() {
    let hand = Pomdp::parse(HAND).unwrap();
    let mut generator = Pcg64Mcg::seed_from_u64(3);
    let mut sums = [0; 3];
    for world in 0..60 {
        let strength = STRENGTHS[world as usize % STRENGTHS.len()];
        let settings = Settings {
            prior_strength: strength,
            iterations_max: 300,
            ..Settings::default()
        };
        let truth = drawn_world(&hand, strength, &mut generator);
        let records = missions(&truth, world, 200, 20, false);
        let found = learn(&hand, &records, &settings, &mut |_| ()).unwrap();
        let counts = coverage(&truth, &found);
        sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
    }
    let all: usize = sums.iter().sum();
    let share = sums[0] as f64 / all as f64;
    assert!(all > 1000 && (0.92..=0.98).contains(&share), "{sums:?}");
}

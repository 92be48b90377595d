//! Do credible intervals of learned probabilities hold what they promise?

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use vigil_missions::learning::{LearnedModel, Posterior, Settings, learn};
use vigil_pomdp::Pomdp;

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
        // The world is one of those that the prior expects.
        let worlds = Posterior::new(&hand, strength).unwrap();
        let truth = worlds.sample(&mut generator).unwrap();
        let records = missions(&truth, world, 200, 20, false);
        let found = learn(&hand, &records, &settings, &mut |_| ()).unwrap();
        let counts = coverage(&truth, &found);
        sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
    }
    let all: usize = sums.iter().sum();
    let share = sums[0] as f64 / all as f64;
    assert!(all > 1000 && (0.92..=0.98).contains(&share), "{sums:?}");
}

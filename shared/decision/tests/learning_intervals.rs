//! Do credible intervals of learned probabilities hold what they promise?

#![allow(clippy::unwrap_used, missing_docs)]

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use vigil_decision::Pomdp;
use vigil_decision::learning::{Learned, Posterior, Record, Settings, Table, learn};
use vigil_decision::simulation::{Random, Rules};

const HAND: &str = "
discount: 0.9 values: reward states: good worn broken
actions: use mend observations: fine rattle still
start: 0.7 0.3 0
T: use : good 0.8 0.15 0.05
T: use : worn 0 0.7 0.3
T: use : broken 0 0 1
T: mend : * 0.9 0.1 0
O: * : good 0.85 0.15 0
O: * : worn 0.4 0.5 0.1
O: use : broken 0 0.1 0.9
O: mend : broken 0.2 0.2 0.6
R: use : good : * : * 2
";
/// Visits that the prior counts as.
const STRENGTHS: [f64; 3] = [5.0, 20.0, 80.0];

fn missions(world: &Pomdp, seed: u64) -> Vec<Record> {
    let rules = Rules {
        steps_max: 20,
        is_end: vec![false; 2],
    };
    let mut agent = Random::new(2);
    let one = |e| Record::simulated(world, &mut agent, &rules, (seed, e), false).0;
    (0..200).map(one).collect()
}

/// How many true probabilities lie in their intervals, below and above them.
fn coverage(truth: &Pomdp, learned: &Learned) -> [usize; 3] {
    let mut counts = [0; 3];
    for row in learned.rows() {
        for entry in row.entries.iter().filter(|entry| entry.learned < 1.0) {
            let (a, s) = (row.row.action, row.row.state);
            let p = match row.row.table {
                Table::Start => truth.start()[entry.column],
                Table::Transition => {
                    let row = truth.successors(s, a).iter();
                    row.filter(|e| e.0 == entry.column).map(|e| e.1).sum()
                }
                Table::Observation => truth.likelihood(a, entry.column)[s],
            };
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
        let records = missions(&truth, world);
        let found = learn(&hand, &records, &settings, &mut |_| ()).unwrap();
        let counts = coverage(&truth, &found);
        sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
    }
    let all: usize = sums.iter().sum();
    let share = sums[0] as f64 / all as f64;
    assert!(all > 1000 && (0.92..=0.98).contains(&share), "{sums:?}");
}

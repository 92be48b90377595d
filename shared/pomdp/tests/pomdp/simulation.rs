//! What a policy earns in simulated episodes.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_pomdp::{AlphaVectors, Evidence, PointBased, Policy, Pomdp, Tracker};

/// The entry at which the sum of the probabilities exceeds u.
fn pick(u: f64, probabilities: impl IntoIterator<Item = f64>) -> usize {
    let mut sum = 0.0;
    let exceeds = |p| {
        sum += p;
        u < sum
    };
    probabilities.into_iter().position(exceeds).unwrap()
}

/// Mean and standard error of what the policy of these vectors earns; an episode ends where the
/// discount has fallen below `weight_min`, or at a goal.
pub fn earned(
    model: &Pomdp,
    vectors: &AlphaVectors,
    episodes: usize,
    weight_min: f64,
) -> (f64, f64) {
    let policy = &mut PointBased::new(model, vectors).unwrap();
    let mut values = vec![0.0; model.actions().len()];
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let earned: Vec<f64> = (0..episodes)
        .map(|_| {
            let mut tracker = Tracker::new(model);
            let mut state = pick(rng.random(), model.start().iter().copied());
            let (mut sum, mut weight) = (0.0, 1.0);
            while weight > weight_min && !model.is_goal(state) {
                let a = policy.evaluate(tracker.belief(), &mut values).action;
                sum += weight * model.reward(state, a);
                weight *= model.discount();
                let row = model.successors(state, a);
                state = row[pick(rng.random(), row.iter().map(|r| r.1))].0;
                let observations = 0..model.observations().len();
                let seen = observations.map(|o| model.likelihood(a, o)[state]);
                let o = pick(rng.random(), seen);
                assert!(matches!(tracker.update(model, a, o), Evidence::Taken(_)));
            }
            sum
        })
        .collect();
    let mean = earned.iter().sum::<f64>() / episodes as f64;
    let variance = earned.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
    (mean, (variance / (episodes * (episodes - 1)) as f64).sqrt())
}

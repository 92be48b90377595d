//! Inspect or act: where information has its price, Q-MDP never pays it and a point-based policy
//! does. Both are simulated on the same random numbers.
//!
//! ```text
//! optimal value 4.54 to 4.55
//!       Q-MDP: 1.41 +- 0.10 (95 %)
//!                 run   1 %
//!                wait  99 %
//!             inspect   0 %
//!              repair   0 %
//! point-based: 4.69 +- 0.21 (95 %)
//!                 run  49 %
//!                wait   0 %
//!             inspect  48 %
//!              repair   3 %
//! ```

use std::error::Error;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_pomdp::solver::{self, Options};
use vigil_pomdp::{Budget, PointBased, Policy, Pomdp, QMdp, Tracker, mdp};

const EPISODES: u64 = 2000;
/// gamma^t is below 1e-4 afterwards.
const STEPS: usize = 180;

/// The entry below whose cumulative probability `u` lies.
fn pick(u: f64, probabilities: impl Iterator<Item = (usize, f64)>) -> usize {
    let (mut sum, mut last) = (0.0, 0);
    for (entry, p) in probabilities.filter(|(_, p)| *p > 0.0) {
        (sum, last) = (sum + p, entry);
        if u < sum {
            break;
        }
    }
    last
}

/// Discounted reward of one episode, and how often it took each action.
fn episode(model: &Pomdp, policy: &mut dyn Policy, seed: u64, taken: &mut [usize]) -> f64 {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut tracker = Tracker::new(model);
    let mut values = vec![0.0; model.actions().len()];
    let mut state = pick(rng.random(), model.start().iter().copied().enumerate());
    let (mut sum, mut weight) = (0.0, 1.0);
    for _ in 0..STEPS {
        let action = policy.evaluate(tracker.belief(), &mut values).action;
        taken[action] += 1;
        sum += weight * model.reward(state, action);
        weight *= model.discount();
        state = pick(
            rng.random(),
            model.successors(state, action).iter().copied(),
        );
        let seen = (0..model.observations().len()).map(|z| (z, model.likelihood(action, z)[state]));
        tracker.update(model, action, pick(rng.random(), seen));
    }
    sum
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = Pomdp::parse(include_str!("gearbox.pomdp"))?;

    let (mut stop, mut watch) = (|| false, |_: &solver::Progress| ());
    let options = Options {
        precision: 0.01,
        ..Options::default()
    };
    let found = solver::solve(&model, &options, &mut Budget::new(&mut stop), &mut watch)?;
    println!(
        "optimal value {:.2} to {:.2}",
        found.bracket.lower, found.bracket.upper
    );

    let vectors = found.vectors.ok_or("no policy yet")?;
    let policies: [(&str, Box<dyn Policy>); 2] = [
        ("Q-MDP", Box::new(QMdp::new(mdp::solve(&model)?))),
        ("point-based", Box::new(PointBased::new(&model, &vectors)?)),
    ];
    for (name, mut policy) in policies {
        let mut taken = vec![0; model.actions().len()];
        let earned: Vec<f64> = (0..EPISODES)
            .map(|seed| episode(&model, &mut *policy, seed, &mut taken))
            .collect();
        let mean = earned.iter().sum::<f64>() / EPISODES as f64;
        let squares: f64 = earned.iter().map(|e| (e - mean).powi(2)).sum();
        let half_width = 1.96 * squares.sqrt() / EPISODES as f64;
        println!("{name:>11}: {mean:.2} +- {half_width:.2} (95 %)");
        for (action, count) in model.actions().iter().zip(&taken) {
            let share = *count as f64 / (EPISODES as usize * STEPS) as f64;
            println!("{:>19} {:>3.0} %", action, 100.0 * share);
        }
    }
    Ok(())
}

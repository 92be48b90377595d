//! Learning on the way, by posterior sampling: does the policy improve over missions?

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use vigil_decision::Pomdp;
use vigil_decision::learning::{Posterior, Record};
use vigil_decision::simulation::Summary;

use super::{Failure, agent, escalation, rewards, rules};

/// Policy by which a drawn model is used: quick to solve.
const POLICY: &str = "qmdp";
/// Visits that each row of the wrong prior counts as.
const STRENGTH: f64 = 5.0;
/// Sweeps over all missions after each.
const SWEEPS: usize = 2;
/// Missions after which the policy of the mean model is measured.
const MEASURED_AFTER: [u64; 10] = [0, 1, 2, 5, 10, 20, 40, 80, 150, 300];
/// Missions of one such measurement, the same for all.
const MISSIONS: u64 = 1000;
/// Their seed.
const MEASURED: u64 = 22;
/// Seeds of learners start here.
const LEARNERS: u64 = 100;

/// What one learner did.
struct Life {
    /// Missions so far, and the mean reward of the mean model's policy.
    measured: Vec<(u64, f64)>,
    /// Of each mission, what the true model's policy earned in it more than the learner.
    regrets: Vec<f64>,
}

/// The lives of `learners` learners of `missions` missions.
///
/// # Errors
/// What learning refuses.
pub fn measure(
    truth: &Pomdp,
    prior: &Pomdp,
    learners: u64,
    missions: u64,
) -> Result<Value, Failure> {
    let mut lives = Vec::new();
    for learner in 0..learners {
        lives.push(life(truth, prior, LEARNERS + learner, missions)?);
        eprintln!("learner {} of {learners}", learner + 1);
    }
    let value = |model: &Pomdp| -> Result<f64, Failure> {
        let mut rewards = rewards(truth, &mut agent(model, POLICY)?, MEASURED, MISSIONS);
        Ok(Summary::of(&mut rewards).mean)
    };
    let mut baseline = rewards(truth, &mut escalation(truth)?, MEASURED, MISSIONS);
    let at = |index: usize| {
        let values: Vec<f64> = lives.iter().map(|life| life.measured[index].1).collect();
        let mut sorted = values.clone();
        let summary = Summary::of(&mut sorted);
        json!({"missions": lives[0].measured[index].0, "mean": summary.mean,
            "half_width_95": summary.half_width, "lowest": sorted.first(),
            "learners": values})
    };
    let count = lives.first().map_or(0, |life| life.measured.len());
    let curve: Vec<Value> = (0..count).map(at).collect();
    Ok(json!({
        "policy": POLICY, "prior_strength": STRENGTH, "sweeps": SWEEPS,
        "learners": learners, "missions": missions, "measured_on": MISSIONS,
        "true_policy": value(truth)?, "prior_policy": value(prior)?,
        "escalation": Summary::of(&mut baseline).mean,
        "curve": curve,
        "regret": windows(&lives, missions),
    }))
}

/// Mean regret of a mission, in tenths of the life.
fn windows(lives: &[Life], missions: u64) -> Vec<Value> {
    let width = (missions as usize / 10).max(1);
    let window = |first: usize| {
        let of = |life: &Life| {
            let window = &life.regrets[first..(first + width).min(life.regrets.len())];
            window.iter().sum::<f64>() / window.len() as f64
        };
        let mut means: Vec<f64> = lives.iter().map(of).collect();
        let summary = Summary::of(&mut means);
        json!({"from": first, "to": first + width, "mean": summary.mean,
            "half_width_95": summary.half_width})
    };
    (0..missions as usize).step_by(width).map(window).collect()
}

fn life(truth: &Pomdp, prior: &Pomdp, seed: u64, missions: u64) -> Result<Life, Failure> {
    let mut posterior = Posterior::new(prior, STRENGTH)?;
    let mut generator = Pcg64Mcg::seed_from_u64(seed);
    let rules = rules(truth);
    let best = rewards(truth, &mut agent(truth, POLICY)?, seed, missions);
    let mut life = Life {
        measured: Vec::new(),
        regrets: Vec::new(),
    };
    for mission in 0..=missions {
        if MEASURED_AFTER.contains(&mission) || mission == missions {
            let mean = posterior.mean()?;
            let mut values = rewards(truth, &mut agent(&mean, POLICY)?, MEASURED, MISSIONS);
            life.measured.push((mission, Summary::of(&mut values).mean));
        }
        if mission == missions {
            break;
        }
        let drawn = posterior.sample(&mut generator)?;
        let mut actor = agent(&drawn, POLICY)?;
        let numbers = (seed, mission);
        let (record, outcome) = Record::simulated(truth, &mut actor, &rules, numbers, false);
        life.regrets
            .push(best[mission as usize] - outcome.discounted);
        posterior.absorb(record, SWEEPS)?;
    }
    Ok(life)
}

//! All missions of all contestants, and what came out.

use std::time::Instant;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_missions::simulation::{
    Act, Agent, Episode, Mission, PairedDifference, Rules, Summary, run,
};
use vigil_pomdp::Pomdp;

use super::bound::Upper;
use super::contestant::{Contestant, Knowledge};
use crate::commands::pomdp::seed;
use vigil_terminal::CommandError;
use vigil_terminal::output::Progress;

/// Where and how long.
pub struct Setting<'a> {
    /// What happens follows this model.
    pub world: &'a Pomdp,
    /// When a mission ends.
    pub rules: &'a Rules,
    /// Seed of the missions.
    pub seed: u64,
    /// Their number.
    pub episodes: u64,
    /// Upper bound of the value at the start belief.
    pub upper: Option<Upper>,
    /// Index of the contestant that the others are compared with.
    pub against: usize,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model that the policies believe in.
    file: &'a str,
    /// Hash of that model.
    model_hash: String,
    /// Hash of the model that plays the world; the same without --model-error.
    world_hash: String,
    /// Discount of a step.
    discount: f64,
    /// Missions of each policy.
    episodes: u64,
    /// Seed of the missions.
    seed: u64,
    /// Greatest number of steps of a mission.
    steps_max: usize,
    /// What is left of the discount then.
    weight_beyond_horizon: f64,
    /// Actions that end a mission.
    ends: Vec<&'a str>,
    /// Actions that dual control may take to gain information.
    information_actions: Vec<&'a str>,
    /// Steps without falling entropy after which dual control gathers no more; 0: never.
    stall_guard_steps: u32,
    /// Upper bound of the value at the start belief; null if actions end missions.
    upper: Option<f64>,
    /// Where that is from: `given`, `point-based solver` or `fast informed bound`; null without it.
    upper_from: Option<&'static str>,
    /// The policy that each row is compared with.
    against: Reference<'a>,
    /// The policies, in the order of --policies.
    rows: &'a [Row],
}

/// A policy that others are compared with.
#[derive(Debug, Serialize, JsonSchema)]
struct Reference<'a> {
    /// Name of the policy.
    policy: &'a str,
    /// K of dual control; null without it.
    threshold: Option<f64>,
}

/// What came out, one row a contestant.
pub struct Contest {
    /// In the order of the contestants.
    pub rows: Vec<Row>,
}

/// What one contestant did.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Row {
    /// Name of the policy.
    pub policy: String,
    /// K of dual control; null without it.
    pub threshold: Option<f64>,
    /// Mean of the discounted rewards of a mission.
    pub mean: f64,
    /// The mean's 95 % interval is `mean` +- this.
    pub half_width_95: f64,
    /// Median of the discounted rewards.
    pub median: f64,
    /// 5 % quantile of the discounted rewards.
    pub worst_5_percent: f64,
    /// Upper bound minus mean; null without a bound.
    pub regret: Option<f64>,
    /// Mean of the undiscounted rewards.
    pub undiscounted_mean: f64,
    /// The undiscounted mean's 95 % interval is that mean +- this.
    pub undiscounted_half_width_95: f64,
    /// Steps of a mission, mean.
    pub steps_mean: f64,
    /// Share of missions that an action ended.
    pub ended_share: f64,
    /// Share of steps that dual control took for information.
    pub dual_share: f64,
    /// Share of steps in which gathering information had stalled.
    pub stalled_share: f64,
    /// Observations of all missions that the model which it believes in rules out.
    pub impossible: usize,
    /// Time of a decision without the belief's update, median, ns.
    pub decision_p50_ns: f64,
    /// Time of a decision without the belief's update, 99 % quantile, ns.
    pub decision_p99_ns: f64,
    /// Mean difference to the policy of `against`, mission by mission.
    pub difference: f64,
    /// The difference's 95 % interval is `difference` +- this.
    pub difference_half_width_95: f64,
    /// Probability of such a difference by chance (paired t-test, two-sided).
    pub difference_p: f64,
    /// True for the largest mean.
    pub is_best: bool,
    /// True if its paired difference to the best is not told from 0 (95 %).
    pub is_like_best: bool,
}

impl Contest {
    /// Holds it.
    pub fn hold(
        setting: &Setting<'_>,
        knowledge: &Knowledge<'_>,
        contestants: &[Contestant],
    ) -> Result<Self, CommandError> {
        // Refusals come before the first mission.
        let agents: Result<Vec<_>, _> = contestants.iter().map(|c| c.build(knowledge)).collect();
        let seed = seed::for_command("compare", setting.seed);
        let total = contestants.len() * setting.episodes as usize;
        let progress = Progress::new("missions", total);
        let (mut rows, mut rewards) = (Vec::new(), Vec::new());
        for (contestant, agent) in contestants.iter().zip(agents?) {
            let mut agent = TimedAgent {
                agent,
                times_ns: Vec::new(),
            };
            let mut missions = Vec::with_capacity(setting.episodes as usize);
            for number in 0..setting.episodes {
                let episode = Episode { seed, number };
                missions.push(run(setting.world, &mut agent, setting.rules, episode));
                let done = rows.len() * setting.episodes as usize + missions.len();
                if missions.len() % 64 == 0 {
                    progress.show(done);
                }
            }
            rewards.push(missions.iter().map(|m| m.discounted).collect::<Vec<f64>>());
            rows.push(row(contestant, setting, &missions, agent.times_ns));
        }
        compare(&mut rows, &rewards, setting.against);
        Ok(Self { rows })
    }

    /// As one JSON document.
    pub fn document<'a>(
        &'a self,
        setting: &Setting<'a>,
        of: &'a Knowledge<'_>,
        file: &'a str,
    ) -> Document<'a> {
        let discount = setting.world.discount();
        let against = &self.rows[setting.against];
        let ends = setting.world.actions().iter().zip(&setting.rules.is_end);
        let ends = ends.filter(|(_, is_end)| **is_end);
        Document {
            schema_version: 1,
            file,
            model_hash: format!("{:016x}", of.model.hash()),
            world_hash: format!("{:016x}", setting.world.hash()),
            discount,
            episodes: setting.episodes,
            seed: setting.seed,
            steps_max: setting.rules.steps_max,
            weight_beyond_horizon: discount.powi(setting.rules.steps_max as i32),
            ends: ends.map(|(action, _)| action.as_str()).collect(),
            information_actions: of.information_actions(),
            stall_guard_steps: of.stall_steps,
            upper: setting.upper.as_ref().map(|upper| upper.value),
            upper_from: setting.upper.as_ref().map(|upper| upper.from),
            against: Reference {
                policy: &against.policy,
                threshold: against.threshold,
            },
            rows: &self.rows,
        }
    }
}

/// An agent whose decisions are timed.
struct TimedAgent<'a> {
    agent: Box<dyn Agent + 'a>,
    times_ns: Vec<f64>,
}

impl Agent for TimedAgent<'_> {
    fn begin(&mut self) {
        self.agent.begin();
    }

    fn decide(&mut self, chance: f64) -> Act {
        let started = Instant::now();
        let act = self.agent.decide(chance);
        self.times_ns.push(started.elapsed().as_nanos() as f64);
        act
    }

    fn notice(&mut self, action: usize, observation: usize) -> bool {
        self.agent.notice(action, observation)
    }
}

fn row(
    contestant: &Contestant,
    setting: &Setting<'_>,
    missions: &[Mission],
    mut times_ns: Vec<f64>,
) -> Row {
    let mut discounted: Vec<f64> = missions.iter().map(|m| m.discounted).collect();
    let mut undiscounted: Vec<f64> = missions.iter().map(|m| m.undiscounted).collect();
    let discounted = Summary::new(&mut discounted);
    let undiscounted = Summary::new(&mut undiscounted);
    let count = |of: fn(&Mission) -> usize| missions.iter().map(of).sum::<usize>() as f64;
    let steps = count(|m| m.steps);
    times_ns.sort_unstable_by(f64::total_cmp);
    let quantile = |q: f64| {
        let at = (q * times_ns.len() as f64) as usize;
        let at = at.min(times_ns.len().saturating_sub(1));
        times_ns.get(at).copied().unwrap_or(f64::NAN)
    };
    Row {
        policy: contestant.name(),
        threshold: contestant.threshold,
        mean: discounted.mean,
        half_width_95: discounted.half_width,
        median: discounted.median,
        worst_5_percent: discounted.worst_5_percent,
        regret: (setting.upper.as_ref()).map(|upper| upper.value - discounted.mean),
        undiscounted_mean: undiscounted.mean,
        undiscounted_half_width_95: undiscounted.half_width,
        steps_mean: steps / missions.len() as f64,
        ended_share: count(|m| usize::from(m.is_ended)) / missions.len() as f64,
        dual_share: count(|m| m.dual_steps) / steps,
        stalled_share: count(|m| m.stalled_steps) / steps,
        impossible: missions.iter().map(|m| m.impossible).sum(),
        decision_p50_ns: quantile(0.5),
        decision_p99_ns: quantile(0.99),
        difference: 0.0,
        difference_half_width_95: 0.0,
        difference_p: 1.0,
        is_best: false,
        is_like_best: false,
    }
}

/// Compares with the reference and with the best, in pairs.
fn compare(rows: &mut [Row], rewards: &[Vec<f64>], against: usize) {
    let best = (0..rows.len()).reduce(|a, b| if rows[b].mean > rows[a].mean { b } else { a });
    for (index, (row, ours)) in rows.iter_mut().zip(rewards).enumerate() {
        let paired = PairedDifference::new(ours, &rewards[against]);
        row.difference = paired.difference;
        row.difference_half_width_95 = paired.half_width;
        row.difference_p = paired.p;
        row.is_best = Some(index) == best;
        let to_best = best.map(|best| PairedDifference::new(ours, &rewards[best]));
        row.is_like_best = to_best.is_some_and(|p| p.difference.abs() <= p.half_width);
    }
}

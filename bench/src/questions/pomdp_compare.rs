//! Do the heuristics earn what another implementation says, and what are they worth, how fast?
//!
//! The first on public models, which are read from `VIGIL_DATA`, the rest on the navigation model.

// The values that the tests hold the heuristics to.
#[path = "../../../shared/decision/tests/decision/public/heuristics.rs"]
mod heuristics;

use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use heuristics::{HEURISTICS, POLICIES, half_width};
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::{percentile, quantile};
use vigil_decision::navigation::{ACTIONS, ENDS, QUIET};
use vigil_decision::policy::{Base, Dual, PolicyKind, PolicyName};
use vigil_decision::simulation::{
    self, Agent, Escalation, Paired, PolicyAgent, Random, Rules, Summary, World, horizon,
};
use vigil_decision::solver::{self, Found};
use vigil_decision::{Budget, PointBased, Pomdp, Tracker, mdp};

const SEED: u64 = 1;
const THRESHOLDS: [f64; 3] = [0.2, 0.5, 0.8];
/// Gap at which the point-based policy's solution ends: 1 % of the value.
const PRECISION: f64 = 0.15;
/// Work for the upper bound that regret is measured from, in questions of some 20 us to its budget.
const BOUND_QUESTIONS: usize = 1_000_000;
/// Decisions whose time is measured, of each policy.
const DECISIONS: usize = 200_000;

type Failure = Box<dyn Error>;

/// How much is simulated.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions of each policy, at least 500.
    #[arg(long, value_name = "N", default_value_t = 3000)]
    episodes: u64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Failure> {
    let episodes = args.episodes.max(500);
    let data = std::env::var_os("VIGIL_DATA").ok_or("VIGIL_DATA: not set; it holds pomdp/*")?;
    let navigation = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/navigation.pomdp");
    let navigation = Pomdp::parse(&std::fs::read_to_string(navigation)?)?;
    let public = public(&PathBuf::from(data).join("pomdp"), episodes)?;
    let found = solved(&navigation)?;
    let vectors = found.vectors.as_ref().ok_or("no vectors")?;
    let policy = PointBased::new(&navigation, vectors)?;
    let upper = upper(&navigation)?.min(found.bracket.upper);
    let missions = missions(&navigation, &policy, upper, episodes)?;
    let times = times(&navigation, &policy)?;
    let raw = json!({
        "episodes": episodes, "seed": SEED, "public": public, "navigation": missions,
        "point_based": {"lower": found.bracket.lower, "upper": found.bracket.upper,
            "vectors": vectors.len(), "products": policy.products()},
        "upper": upper,
        "decision_times": times,
    });
    if args.json {
        println!("{raw:#}");
        return Ok(());
    }
    let mut archive = Archive::new("pomdp-compare")?;
    say_public(&mut archive, &public, episodes);
    archive.say(&format!(
        "point-based: solved to a gap of {PRECISION}: {:.4} to {:.4} at the start belief, \
         {} vectors; {}\nmultiplications a decision.\n",
        found.bracket.lower,
        found.bracket.upper,
        vectors.len(),
        policy.products()
    ));
    say_missions(&mut archive, &missions, upper, episodes);
    say_times(&mut archive, &times);
    archive.store("pomdp-compare.json", &raw)?;
    archive.close()?;
    Ok(())
}

/// Discounted rewards of an agent's missions.
fn rewards(model: &Pomdp, agent: &mut dyn Agent, ends: bool, episodes: u64) -> Vec<f64> {
    let is_end = |a: &String| ends && ENDS.contains(&a.as_str());
    let rules = Rules {
        steps_max: horizon(model.discount(), 2000),
        is_end: model.actions().iter().map(is_end).collect(),
    };
    let mission = |episode| simulation::run(model, agent, &rules, (SEED, episode)).discounted;
    (0..episodes).map(mission).collect()
}

/// Every heuristic on every public model, as published: all actions, no guard.
fn public(folder: &Path, episodes: u64) -> Result<Vec<Value>, Failure> {
    let mut rows = Vec::new();
    for (file, means, half_widths) in HEURISTICS {
        let model = Pomdp::parse(&std::fs::read_to_string(
            folder.join(format!("{file}.pomdp")),
        )?)?;
        let solution = mdp::solve(&model)?;
        for (name, reference) in POLICIES.into_iter().zip(means) {
            let half_width = half_width(name, half_widths);
            let policy: PolicyName = name.parse()?;
            let decider = policy.build(&model, &solution, |i| Dual::new(i, 0.5))?;
            let mut agent = PolicyAgent::new(&model, decider);
            let found = Summary::of(&mut rewards(&model, &mut agent, false, episodes));
            let both = found.half_width.hypot(half_width);
            rows.push(json!({
                "model": file, "policy": name, "mean": found.mean,
                "half_width_95": found.half_width, "reference": reference,
                "reference_half_width_95": half_width,
                "apart_in_intervals": (found.mean - reference) / both,
            }));
        }
        eprintln!("{file} done");
    }
    Ok(rows)
}

/// The navigation model, solved until the bounds are [`PRECISION`] apart.
fn solved(model: &Pomdp) -> Result<Found, Failure> {
    let options = solver::Options {
        precision: PRECISION,
        ..solver::Options::default()
    };
    let mut never = || false;
    let budget = &mut Budget::new(&mut never);
    Ok(solver::solve(model, &options, budget, &mut |_| ())?)
}

/// The lowest upper bound of the value at the start belief that some work finds.
fn upper(model: &Pomdp) -> Result<f64, Failure> {
    let options = solver::Options {
        precision: 0.0,
        ..solver::Options::default()
    };
    let mut left = BOUND_QUESTIONS;
    let mut stop = || {
        left = left.saturating_sub(1);
        left == 0
    };
    let budget = &mut Budget::new(&mut stop);
    Ok(solver::solve(model, &options, budget, &mut |_| ())?
        .bracket
        .upper)
}

/// The navigation model: missions to the horizon, with their regret to the bound `upper`, and such
/// as SH and GU end, for which there is no bound.
fn missions(
    model: &Pomdp,
    solved: &PointBased,
    upper: f64,
    episodes: u64,
) -> Result<Vec<Value>, Failure> {
    let solution = mdp::solve(model)?;
    let ladder = ["MA", "GO", "NP", "RL", "SH", "GU"];
    let mut rows = Vec::new();
    for ends in [false, true] {
        let mut baseline = Vec::new();
        let mut add = |name: &str, k: Option<f64>, ours: Vec<f64>| {
            if baseline.is_empty() {
                baseline.clone_from(&ours);
            }
            let paired = Paired::of(&ours, &baseline);
            let summary = Summary::of(&mut ours.clone());
            rows.push(json!({
                "ends": ends, "policy": name, "threshold": k, "mean": summary.mean,
                "half_width_95": summary.half_width, "median": summary.median,
                "worst_5_percent": summary.worst_5_percent,
                "regret": (!ends).then_some(upper - summary.mean),
                "difference": paired.difference,
                "difference_half_width_95": paired.half_width, "p": paired.p,
            }));
        };
        for patience in 1..=3 {
            let mut agent = Escalation::new(model, "FP", &ladder, &QUIET, patience)?;
            let name = format!("escalation-{patience}");
            add(&name, None, rewards(model, &mut agent, ends, episodes));
        }
        let mut random = Random::new(ACTIONS.len());
        add("random", None, rewards(model, &mut random, ends, episodes));
        for name in names() {
            let policy: PolicyKind = name.parse()?;
            let thresholds = if policy.is_dual() {
                &THRESHOLDS[..]
            } else {
                &THRESHOLDS[..1]
            };
            for &k in thresholds {
                let decider = policy.build(model, &solution, |i| guarded(i, k), Some(solved))?;
                let mut agent = PolicyAgent::new(model, decider);
                let k = policy.is_dual().then_some(k);
                add(&name, k, rewards(model, &mut agent, ends, episodes));
            }
        }
    }
    Ok(rows)
}

fn names() -> impl Iterator<Item = String> {
    let prefixes = ["", "dm-", "adm-"];
    prefixes
        .into_iter()
        .flat_map(|prefix| Base::ALL.map(|(_, x)| format!("{prefix}{x}")))
        .chain(["point-based".to_owned()])
}

/// Dual control as a robot should have it: neither SH nor GU for information, and a guard.
fn guarded(information: vigil_decision::policy::Information, k: f64) -> Dual {
    let mut dual = Dual::new(information, k);
    dual.allowed = Some((0..ACTIONS.len() - ENDS.len()).collect());
    dual.stall_steps = 5;
    dual
}

/// Time of update and decision with its record, on beliefs as missions bring them. With K = 0
/// and no guard every step looks ahead: the dearest case.
fn times(model: &Pomdp, solved: &PointBased) -> Result<Vec<Value>, Failure> {
    let solution = mdp::solve(model)?;
    let mut rows = Vec::new();
    for name in names() {
        let policy: PolicyKind = name.parse()?;
        let unguarded = |information| {
            let mut dual = guarded(information, 0.0);
            dual.stall_steps = 0;
            dual
        };
        let mut decider = policy.build(model, &solution, unguarded, Some(solved))?;
        let mut tracker = Tracker::new(model);
        let (mut decide_ns, mut both_ns) = (Vec::new(), Vec::new());
        let mut episode = 0;
        while decide_ns.len() < DECISIONS {
            let mut world = World::new(model, SEED, episode);
            tracker.reset();
            decider.reset();
            episode += 1;
            let mut action = decider.decide(tracker.belief()).action;
            for _ in 0..100 {
                let observation = world.step(action).observation;
                let started = Instant::now();
                tracker.update(model, action, observation);
                let updated = Instant::now();
                let decision = black_box(decider.decide(black_box(tracker.belief())));
                let ended = Instant::now();
                decide_ns.push((ended - updated).as_nanos() as f64);
                both_ns.push((ended - started).as_nanos() as f64);
                action = decision.action;
            }
        }
        let of = |times: &mut Vec<f64>| [0.5, 0.99, 0.999].map(|q| quantile(times, q));
        rows.push(json!({
            "policy": name, "n": decide_ns.len(), "decision_p50_p99_p999_ns": of(&mut decide_ns),
            "update_and_decision_p50_p99_p999_ns": of(&mut both_ns),
        }));
    }
    Ok(rows)
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or(f64::NAN)
}

/// A probability; what has vanished below the smallest double is told as such.
fn chance(p: f64) -> String {
    if p < 1e-300 {
        "< 1e-300".to_owned()
    } else {
        format!("{p:.1e}")
    }
}

fn say_public(archive: &mut Archive, rows: &[Value], episodes: u64) {
    archive.say(&format!(
        "Mean discounted reward on public models, {episodes} episodes, seed {SEED}, K = 0.5, no \
         guards, horizon where\ndiscount^t < 1e-4; in brackets the distance to another \
         implementation's mean, in units of the joint 95 %\nhalf-width (within +-1 in 19 of 20 \
         cells by chance).\n"
    ));
    archive.say(&format!("| model | {} |", POLICIES.join(" | ")));
    archive.say(&format!("|---|{}", "---|".repeat(POLICIES.len())));
    for row in rows.chunks(POLICIES.len()) {
        let model = row[0]["model"].as_str().unwrap_or_default();
        let cells: Vec<String> = row
            .iter()
            .map(|cell| {
                let apart = number(cell, "apart_in_intervals");
                format!("{:.4} ({apart:+.2})", number(cell, "mean"))
            })
            .collect();
        archive.say(&format!("| {model} | {} |", cells.join(" | ")));
    }
    let apart = |row: &&Value| number(row, "apart_in_intervals").abs() <= 1.0;
    let within = rows.iter().filter(apart).count();
    archive.say(&format!("\n{within} of {} cells within +-1.\n", rows.len()));
}

fn say_missions(archive: &mut Archive, rows: &[Value], upper: f64, episodes: u64) {
    for ends in [false, true] {
        let what = if ends {
            "SH and GU end a mission"
        } else {
            "to the horizon of 180 steps"
        };
        archive.say(&format!(
            "config/navigation.pomdp, {episodes} missions, {what}; difference: in pairs, to \
             escalation-1, the best\nof the deterministic baselines.\n"
        ));
        if !ends {
            archive.say(&format!(
                "Regret: to the upper bound {upper:.4} that a longer search finds (no policy can \
                 earn more), +- as the mean.\n"
            ));
        }
        archive.say("| policy | K | mean | median | worst 5 % | regret | difference | p |");
        archive.say("|---|---|---|---|---|---|---|---|");
        for row in rows.iter().filter(|row| row["ends"] == ends) {
            let k = row["threshold"]
                .as_f64()
                .map_or_else(|| "-".to_owned(), |k| k.to_string());
            let regret = row["regret"].as_f64();
            let regret = regret.map_or_else(|| "-".to_owned(), |regret| format!("{regret:.3}"));
            archive.say(&format!(
                "| {} | {k} | {:.3} +- {:.3} | {:.3} | {:.3} | {regret} | {:.3} +- {:.3} | {} |",
                row["policy"].as_str().unwrap_or_default(),
                number(row, "mean"),
                number(row, "half_width_95"),
                number(row, "median"),
                number(row, "worst_5_percent"),
                number(row, "difference"),
                number(row, "difference_half_width_95"),
                chance(number(row, "p")),
            ));
        }
        archive.say("");
    }
}

fn say_times(archive: &mut Archive, rows: &[Value]) {
    archive.say(
        "Time on config/navigation.pomdp, ns (p50, p99, p99.9), two clock readings included. dm-X \
         and adm-X with\nK = 0 and no guard: every step looks ahead. The tail holds what else ran \
         on this core.\n",
    );
    archive.say("| policy | decision | update and decision |");
    archive.say("|---|---|---|");
    for row in rows {
        let n = row["n"].as_u64().unwrap_or(0);
        let times = |key: &str| {
            let of = |i: usize| row[key][i].as_f64().unwrap_or(f64::NAN);
            let tail = |i: usize, q: f64| percentile(q, n, format!("{:.0}", of(i)));
            format!("{:.0}, {}, {}", of(0), tail(1, 0.99), tail(2, 0.999))
        };
        archive.say(&format!(
            "| {} | {} | {} |",
            row["policy"].as_str().unwrap_or_default(),
            times("decision_p50_p99_p999_ns"),
            times("update_and_decision_p50_p99_p999_ns"),
        ));
    }
}

//! From recorded missions to a model: is it as good as the true one?

use serde_json::{Value, json};
use vigil_decision::Pomdp;
use vigil_decision::learning::{Learned, Record, Settings, check, learn};
use vigil_decision::simulation::{Paired, Summary};

use super::{Failure, Models, agent, escalation, rewards, rules};

/// Policy by which a model is used.
const POLICY: &str = "fib";
/// Seed of the missions that are recorded.
const RECORDED: u64 = 11;
/// Seed of the missions in which models and policies are measured.
const MEASURED: u64 = 12;

/// Mean and 95 % half-width of discounted rewards.
fn mean(values: &[f64]) -> Value {
    let summary = Summary::of(&mut values.to_vec());
    json!({"mean": summary.mean, "half_width_95": summary.half_width})
}

/// Missions of the true world under the escalation policy.
///
/// # Errors
/// Names that the model lacks.
pub fn recorded(truth: &Pomdp, missions: u64) -> Result<Vec<Record>, Failure> {
    let mut agent = escalation(truth)?;
    let rules = rules(truth);
    let one = |e| Record::simulated(truth, &mut agent, &rules, (RECORDED, e), false).0;
    Ok((0..missions).map(one).collect())
}

/// Learns from `missions` recorded ones, beginning with the hasty model, and measures on as many.
///
/// # Errors
/// What learning refuses.
pub fn measure(models: &Models, missions: u64, strength: f64) -> Result<Value, Failure> {
    let truth = &models.truth;
    let records = recorded(truth, missions)?;
    let settings = Settings {
        prior_strength: strength,
        ..Settings::default()
    };
    let learned = learn(&models.hasty, &records, &settings, &mut |i| {
        eprintln!("iteration {}: {:.1} nats", i.iteration, i.log_likelihood);
    })?;
    let earns = |world: &Pomdp, model: &Pomdp| -> Result<Vec<f64>, Failure> {
        Ok(rewards(
            world,
            &mut agent(model, POLICY)?,
            MEASURED,
            missions,
        ))
    };
    let best = earns(truth, truth)?;
    let baseline = rewards(truth, &mut escalation(truth)?, MEASURED, missions);
    let true_mean = Summary::of(&mut best.clone()).mean;
    let row = |name: &str, model: &Pomdp| -> Result<Value, Failure> {
        let (predicted, measured) = (earns(model, model)?, earns(truth, model)?);
        let means = [&predicted, &measured].map(|v| Summary::of(&mut v.to_vec()).mean);
        let better = Paired::of(&measured, &baseline);
        let half_width = Paired::of(&predicted, &measured).half_width;
        let verdict = check::within(means[0], means[1], half_width);
        let logged = check::follow(model, &records);
        Ok(json!({
            "model": name,
            "predicted": mean(&predicted),
            "measured": mean(&measured),
            "predicted_off_true_value": (means[0] - true_mean).abs() / true_mean.abs(),
            "measured_below_true_policy": (true_mean - means[1]) / true_mean.abs(),
            "above_escalation": {"difference": better.difference,
                "half_width_95": better.half_width, "p": better.p},
            "escalation_predicted": mean(&rewards(model, &mut escalation(model)?, MEASURED,
                missions)),
            "logged_predicted": logged.map(|l| l.predicted.mean),
            "logged_measured": logged.map(|l| l.measured.mean),
            "refused": verdict.err().map(|refusal| refusal.to_string()),
        }))
    };
    let rows = [
        row("true", truth)?,
        row("by hand", &models.hasty)?,
        row("learned", &learned.model)?,
    ];
    let likelihoods = learned.iterations.iter().map(|i| i.log_likelihood);
    Ok(json!({
        "missions": missions, "prior_strength": strength, "policy": POLICY,
        "recorded_seed": RECORDED, "measured_seed": MEASURED,
        "escalation": mean(&baseline),
        "iterations": learned.iterations.len(),
        "log_likelihoods": likelihoods.collect::<Vec<f64>>(),
        "log_likelihood_true": likelihood(truth, &records, &settings)?,
        "rows": rows,
        "intervals": intervals(truth, &learned),
    }))
}

/// Of the model itself.
fn likelihood(model: &Pomdp, records: &[Record], settings: &Settings) -> Result<f64, Failure> {
    let once = Settings {
        iterations_max: 1,
        ..settings.clone()
    };
    let found = learn(model, records, &once, &mut |_| ())?;
    Ok(found
        .iterations
        .first()
        .map_or(f64::NAN, |i| i.log_likelihood))
}

/// How many true probabilities lie in their credible intervals, by how much of the row is data.
fn intervals(truth: &Pomdp, learned: &Learned) -> Value {
    let bins = [(0.0, 0.1), (0.1, 0.9), (0.9, 1.1)];
    let of = |&(low, high): &(f64, f64)| {
        let (mut rows, mut numbers, mut inside, mut error) = (0, 0, 0, 0.0_f64);
        for row in learned.rows() {
            let share = row.data_share();
            if !(low..high).contains(&share) {
                continue;
            }
            rows += 1;
            for entry in row.entries.iter().filter(|entry| entry.learned < 1.0) {
                let p = row.row.p(truth, entry.column);
                numbers += 1;
                inside += usize::from((entry.interval[0]..=entry.interval[1]).contains(&p));
                error = error.max((entry.learned - p).abs());
            }
        }
        json!({"data_share_from": low, "rows": rows, "numbers": numbers, "inside": inside,
            "largest_error": error})
    };
    bins.iter().map(of).collect()
}

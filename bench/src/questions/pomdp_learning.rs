//! Is a model learned from missions as good as the true one, and does learning on the way help?
//!
//! The recorded missions are those of the escalation policy; who learns on the way begins with a
//! wrong prior.

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::pomdp_learning::{Failure, Models, curve, offline, online};

use super::from_zero;

/// How much is learned from, and how much is believed before.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recorded missions.
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    missions: u64,
    /// Strength of the prior.
    #[arg(long, value_name = "K", default_value_t = 50.0, value_parser = from_zero)]
    prior_strength: f64,
    /// Robots that learn on the way.
    #[arg(long, value_name = "N", default_value_t = 24)]
    learners: u64,
    /// Missions of each of them.
    #[arg(long, value_name = "N", default_value_t = 300)]
    lifetime: u64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Failure> {
    let models = Models::read()?;
    let offline = offline::measure(&models, args.missions.max(2), args.prior_strength)?;
    let (learners, lifetime) = (args.learners.max(2), args.lifetime.max(2));
    let online = online::measure(&models.truth, &models.misled, learners, lifetime)?;
    let raw = json!({"offline": offline, "online": online});
    if args.json {
        println!("{raw:#}");
        return Ok(());
    }
    let mut archive = Archive::new("pomdp-learning")?;
    say_offline(&mut archive, &offline);
    say_online(&mut archive, &online);
    archive.store("pomdp-learning.json", &raw)?;
    archive.store_text("learning-curve.svg", &curve::draw(&online)?)?;
    archive.close()?;
    Ok(())
}

fn mean(value: &Value) -> String {
    let number = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
    format!("{:.3} +- {:.3}", number("mean"), number("half_width_95"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn say_offline(archive: &mut Archive, offline: &Value) {
    let all = offline["log_likelihoods"].as_array();
    let ends = all.and_then(|all| Some((number(all.first()?), number(all.last()?))));
    let (first, last) = ends.unwrap_or((f64::NAN, f64::NAN));
    archive.say(&format!(
        "{} missions of config/navigation.pomdp under escalation-1 (mean reward {}), no state \
         told. Learned\nfrom a hasty model (everything three times as often, remedies and symptoms \
         rough guesses), K = {}: {}\niterations, log-likelihood {first:.0} -> {last:.0} nats (true \
         model {:.0}). Predicted: the model's policy ({})\nin the model itself; measured: in the \
         true one; other missions than those recorded. Mean discounted\nreward, 95 %.\n",
        offline["missions"],
        mean(&offline["escalation"]),
        offline["prior_strength"],
        offline["iterations"],
        number(&offline["log_likelihood_true"]),
        offline["policy"].as_str().unwrap_or_default(),
    ));
    archive.say(
        "| model | predicted | measured | predicted off the true model's | policy below the true \
         model's | above escalation | escalation predicted | deployment |\n\
         |---|---|---|---|---|---|---|---|",
    );
    for row in offline["rows"].as_array().into_iter().flatten() {
        let above = &row["above_escalation"];
        let verdict = if row["refused"].is_null() {
            "allowed"
        } else {
            "refused"
        };
        archive.say(&format!(
            "| {} | {} | {} | {:.2} % | {:.2} % | {:.3} +- {:.3} | {} | {verdict} |",
            row["model"].as_str().unwrap_or_default(),
            mean(&row["predicted"]),
            mean(&row["measured"]),
            100.0 * number(&row["predicted_off_true_value"]),
            100.0 * number(&row["measured_below_true_policy"]),
            number(&above["difference"]),
            number(&above["half_width_95"]),
            mean(&row["escalation_predicted"]),
        ));
    }
    archive.say(
        "\nTrue probabilities within their credible intervals, by the rows' share of data. They \
         are for 95 % of the\nworlds that the prior expects; this prior is off on purpose, and \
         pulls learned numbers along:\n",
    );
    archive.say("| share from | rows | numbers | inside | largest error |\n|---|---|---|---|---|");
    for bin in offline["intervals"].as_array().into_iter().flatten() {
        archive.say(&format!(
            "| {} | {} | {} | {:.1} % | {:.3} |",
            bin["data_share_from"],
            bin["rows"],
            bin["numbers"],
            100.0 * number(&bin["inside"]) / number(&bin["numbers"]),
            number(&bin["largest_error"]),
        ));
    }
}

fn say_online(archive: &mut Archive, online: &Value) {
    archive.say(&format!(
        "\nPosterior sampling: {} learners of {} missions each, from a prior (each row worth {} \
         visits) that\nexpects help from the wrong actions. Policy {}. After each mission all \
         counts are taken anew. True\nmodel's policy {:.3}, prior's {:.3}, escalation-1 {:.3}; \
         each point: the mean model's policy on {} missions,\nmean and 95 % over learners.\n",
        online["learners"],
        online["missions"],
        online["prior_strength"],
        online["policy"].as_str().unwrap_or_default(),
        number(&online["true_policy"]),
        number(&online["prior_policy"]),
        number(&online["escalation"]),
        online["measured_on"],
    ));
    archive.say("| missions | mean reward | regret | worst learner |\n|---|---|---|---|");
    for point in online["curve"].as_array().into_iter().flatten() {
        archive.say(&format!(
            "| {} | {} | {:.3} | {:.3} |",
            point["missions"],
            mean(point),
            number(&online["true_policy"]) - number(&point["mean"]),
            number(&point["lowest"]),
        ));
    }
    archive.say(
        "\nRegret of a mission as it was lived, with models drawn from the posterior (paired):\n",
    );
    archive.say("| missions | regret |\n|---|---|");
    for window in online["regret"].as_array().into_iter().flatten() {
        archive.say(&format!(
            "| {}..{} | {} |",
            window["from"],
            window["to"],
            mean(window)
        ));
    }
}

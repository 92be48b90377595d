//! The contest as a table to read.

use std::fmt::Write;

use super::contest::{Contest, Row, Setting};
use super::contestant::Knowledge;

/// The table, and below it what its columns mean.
pub fn text(contest: &Contest, setting: &Setting<'_>, of: &Knowledge<'_>, file: &str) -> String {
    let discount = setting.world.discount();
    let steps = setting.rules.steps_max;
    let mut text = format!(
        "{file}: {} missions each, seed {}, {steps} steps at most (then weigh {:.1e})\n",
        setting.episodes,
        setting.seed,
        discount.powi(steps as i32),
    );
    let bound = setting.upper.as_ref().map_or_else(
        || "no upper bound: actions end missions".to_owned(),
        |upper| format!("upper bound {:.6} ({})", upper.value, upper.from),
    );
    let against = &contest.rows[setting.against];
    let k = against
        .threshold
        .map_or_else(String::new, |k| format!(" K={k}"));
    let _ = writeln!(text, "{bound}; differences are to {}{k}", against.policy);
    let information = of.information_actions().join(", ");
    let _ = writeln!(
        text,
        "dual control may take for information: {information}\n"
    );
    let _ = writeln!(
        text,
        "  {:<13}{:>5} {:>21} {:>10} {:>10} {:>9} {:>10} {:>6} {:>6} {:>6} {:>6}/{:<7} {:>21} \
         {:>8}",
        "policy",
        "K",
        "mean",
        "median",
        "worst 5 %",
        "regret",
        "undisc.",
        "dual",
        "stall",
        "imposs",
        "p50",
        "p99 ns",
        "difference",
        "p",
    );
    for row in &contest.rows {
        text.push_str(&line(row));
    }
    text.push_str(
        "\n* largest mean; ~ not to be told from it (95 %, in pairs). mean, median, worst 5 % \
         (quantile): discounted\nreward. dual, stall: share of steps for information, and of those \
         in which that led nowhere. Times are of\nthe decision alone.",
    );
    text
}

fn line(row: &Row) -> String {
    let mark = match (row.is_best, row.is_like_best) {
        (true, _) => '*',
        (_, true) => '~',
        _ => ' ',
    };
    let or_dash = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let threshold = row
        .threshold
        .map_or_else(|| "-".to_owned(), |k| k.to_string());
    let with_interval = |value: f64, half: f64| format!("{value:.4} +- {half:.4}");
    format!(
        "{mark} {:<13}{:>5} {:>21} {:>10.4} {:>10.4} {:>9} {:>10.3} {:>5.1}% {:>5.1}% {:>6} \
         {:>6.0}/{:<7.0} {:>21} {:>8}\n",
        row.policy,
        threshold,
        with_interval(row.mean, row.half_width_95),
        row.median,
        row.worst_5_percent,
        or_dash(row.regret, 4),
        row.undiscounted_mean,
        100.0 * row.dual_share,
        100.0 * row.stalled_share,
        row.impossible,
        row.decision_p50_ns,
        row.decision_p99_ns,
        with_interval(row.difference, row.difference_half_width_95),
        chance(row.difference_p),
    )
}

/// A probability; what has vanished below the smallest double is told as such.
fn chance(p: f64) -> String {
    if p < 1e-300 {
        "<1e-300".to_owned()
    } else {
        format!("{p:.1e}")
    }
}

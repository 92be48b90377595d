//! Filters beside each other as tables.

use super::summary::{number, ratio, types};
use super::{Report, SensorSet, words};
use crate::scoring::bounds::Difference;
use crate::scoring::{Row, Share};
use vigil_pages::page::{Section, escaped};

fn apart(difference: Option<&Difference>, scale: f64, decimals: usize) -> String {
    let Some(found) = difference else {
        return String::new();
    };
    let text = |x: f64| format!("{:+.decimals$}", scale * x);
    let (mean, lower, upper) = (text(found.mean), text(found.lower_95), text(found.upper_95));
    format!("<br/><span class=\"soft\">{mean} ({lower}, {upper})</span>")
}

fn share(share: &Share) -> String {
    let apart = apart(share.difference.as_ref(), 100.0, 1);
    let text = ratio(share.ratio);
    let short = text.split(';').next().unwrap_or_default();
    let end = if short.len() < text.len() { ")" } else { "" };
    format!("<td>{}{end}{apart}</td>", escaped(short))
}

fn row(row: &Row) -> String {
    let [leaf, side] = [&row.leaf, &row.side].map(|of| {
        let at = [&of.after_2_s, &of.after_5_s, &of.after_10_s];
        at.map(share).concat()
    });
    let log_score = number(row.log_score_nats, 2);
    let log_apart = apart(row.log_score_difference.as_ref(), 1.0, 2);
    format!(
        "<tr><th>{}</th>{leaf}{side}<td>{log_score}{log_apart}</td>{}</tr>\n",
        escaped(&row.filter),
        share(&row.confident_wrong)
    )
}

fn table(rows: &[Row], caption: &str) -> String {
    let heads = [
        "",
        "leaf at 2 s",
        "5 s",
        "10 s",
        "side at 2 s",
        "5 s",
        "10 s",
        "log score, nats",
        "wrong, p > 0.9",
    ];
    let heads: String = heads
        .iter()
        .map(|h| format!("<th>{}</th>", escaped(h)))
        .collect();
    let rows: String = rows.iter().map(row).collect();
    format!(
        "<div class=\"wide\"><table class=\"close\">\n<caption>{}</caption>\n\
         <thead><tr>{heads}</tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n",
        escaped(caption)
    )
}

/// The filters of all sets; none if none were compared.
pub fn section(report: &Report<'_>) -> Option<Section> {
    let part = |set: &SensorSet<'_>| {
        let contest = set.contest?;
        let tables = types(report).into_iter().filter_map(|class| {
            let rows = contest.get(&class)?;
            Some(table(rows, &format!("{}: {class}", words(set.name))))
        });
        Some(tables.collect::<String>())
    };
    let parts: Vec<String> = report.sets.iter().filter_map(part).collect();
    if parts.is_empty() {
        return None;
    }
    let about = "The same runs, the same detector. Below each figure: its difference from the \
                 first row, run by run, with a 95 % interval (shares in points, after Agresti and \
                 Min; log scores after Student).";
    Some(Section {
        id: "filters",
        heading: "Filters beside each other",
        about: about.to_owned(),
        inside: parts.concat(),
    })
}

//! What was reported for what was true, as coloured tables.

use std::collections::BTreeSet;

use super::{Report, words};
use crate::scoring::{MULTIPLE, Matrix, Taxonomy, UNKNOWN};
use vigil_pages::heat::Scale;
use vigil_pages::page::{Section, beside, escaped};

/// Shades of the cells.
const SHARES: Scale = Scale::linear("share of the runs in a row");
/// Width of the key of the shades.
const KEY_WIDTH: u32 = 1800;

/// Words that occur in a matrix, leaves first, in the tree's order.
fn order(words: &BTreeSet<&str>, taxonomy: &Taxonomy) -> Vec<String> {
    let leaves: Vec<&str> = taxonomy.leaf_names().map(|(_, name)| name).collect();
    let leaf = leaves.iter().filter(|leaf| words.contains(**leaf));
    let mut order: Vec<String> = leaf.map(|leaf| (*leaf).to_owned()).collect();
    let last = [MULTIPLE, UNKNOWN];
    let other = |word: &&&str| !leaves.contains(word) && !last.contains(word);
    order.extend(words.iter().filter(other).map(|word| (*word).to_owned()));
    let last = last.iter().filter(|word| words.contains(**word));
    order.extend(last.map(|word| (*word).to_owned()));
    order
}

fn table(matrix: &Matrix, taxonomy: &Taxonomy, caption: &str) -> String {
    let truths: BTreeSet<&str> = matrix.keys().map(String::as_str).collect();
    let reported = matrix
        .values()
        .flat_map(|row| row.keys())
        .map(String::as_str);
    let columns = order(&truths.iter().copied().chain(reported).collect(), taxonomy);
    let heads: String = columns
        .iter()
        .map(|word| format!("<th>{}</th>", escaped(word)))
        .collect();
    // Sides and types are words of the tree too.
    let is_known = |truth: &str| {
        taxonomy.index(truth).is_some()
            || ["left", "right"].contains(&truth)
            || taxonomy
                .leaf_names()
                .any(|(_, leaf)| taxonomy.class(leaf) == Some(truth))
    };
    let row = |truth: &String| {
        let row = matrix.get(truth);
        let total: usize = row.map_or(0, |row| row.values().sum());
        let cell = |word: &String| {
            let n = row.and_then(|row| row.get(word)).copied().unwrap_or(0);
            if n == 0 {
                return "<td></td>".to_owned();
            }
            let right = word == truth || (*word == UNKNOWN && !is_known(truth));
            let class = if right { " class=\"right\"" } else { "" };
            let style = SHARES.style(n as f64 / total.max(1) as f64);
            format!("<td{class} style=\"{style}\">{n}</td>")
        };
        let cells: String = columns.iter().map(cell).collect();
        format!("<tr><th>{}</th>{cells}</tr>\n", escaped(truth))
    };
    let rows: String = order(&truths, taxonomy).iter().map(row).collect();
    format!(
        "<div class=\"wide\"><table class=\"matrix\"><caption>{}</caption>\n\
         <thead><tr><th class=\"corner\">true</th>{heads}</tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n",
        escaped(caption)
    )
}

/// The matrices of all sets.
pub fn section(report: &Report<'_>) -> Section {
    let part = |set: &super::SensorSet<'_>| {
        let score = set.score;
        let head = format!("<h3>{}</h3>\n", escaped(words(set.name)));
        if !score.identifies {
            return head + &table(&score.confusion, report.taxonomy, "by label");
        }
        format!(
            "{head}{}{}{}",
            table(&score.confusion, report.taxonomy, "by leaf"),
            table(&score.confusion_by.side, report.taxonomy, "by side"),
            table(&score.confusion_by.class, report.taxonomy, "by type")
        )
    };
    let parts: Vec<String> = report.sets.iter().map(part).collect();
    let about = "Runs; rows: what was true, columns: what was reported 2 s after the onset (in \
                 nominal runs: at the end). What is right has a green frame.";
    Section {
        id: "confusion",
        heading: "Confusion",
        about: about.to_owned(),
        inside: format!("{}\n{}", SHARES.key(KEY_WIDTH), beside(&parts)),
    }
}

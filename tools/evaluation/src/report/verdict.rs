//! What an evaluation found, in a sentence or two.

use super::{Report, SensorSet, words};
use crate::scoring::{Ratio, Score};

fn share(ratio: Ratio) -> String {
    match ratio.fraction() {
        Some(p) => format!("{} of {} ({:.1} %)", ratio.right, ratio.n, 100.0 * p),
        None => "none".to_owned(),
    }
}

fn faults(score: &Score) -> String {
    let Some(found) = score.detection.get("all").filter(|found| found.n > 0) else {
        return "no run has a fault".to_owned();
    };
    let mut text = format!("{} faults were found", share(found.within.at_end));
    if let Some(p50_s) = found.delay.p50_s {
        text.push_str(&format!(", half of them within {p50_s:.2} s"));
    }
    let named = score.identification.get("all");
    if let Some(named) = named.filter(|_| score.identifies) {
        let right = share(named.leaf.after_2_s);
        text.push_str(&format!("; {right} had their right name after 2 s"));
    }
    text
}

fn set(set: &SensorSet<'_>) -> String {
    let alarms = &set.score.false_alarms;
    let count = match alarms.alarms {
        0 => "no false alarm".to_owned(),
        1 => "1 false alarm".to_owned(),
        n => format!("{n} false alarms"),
    };
    let hours = alarms.exposure_h;
    let (name, faults) = (words(set.name), faults(set.score));
    format!("With {name}: {faults}; {count} in {hours:.2} h without a fault.")
}

/// A sentence for each set of channels.
pub fn verdict(report: &Report<'_>) -> String {
    let sets: Vec<String> = report.sets.iter().map(set).collect();
    sets.join(" ")
}

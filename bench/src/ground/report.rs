//! Runs in figures.

use serde_json::{Value, json};

use super::{JUDGED_S, Judged, Run};
use crate::quantile;
use crate::shares::Share;

/// Figures of the faulty runs of one soil, set of sensors and type of fault.
#[derive(Debug, Clone)]
pub struct Figures {
    /// Runs with an alarm before the onset.
    pub false_alarms: Share,
    /// Detected in the 10 s that follow the onset.
    pub detected: Share,
    /// Delay, s: half, nine tenths, and all of those detected.
    pub delay_s: [f64; 3],
    /// Right leaf at each of [`JUDGED_S`].
    pub leaf: [Share; JUDGED_S.len()],
    /// Right side.
    pub side: [Share; JUDGED_S.len()],
    /// Unknown.
    pub unknown: [Share; JUDGED_S.len()],
    /// Confident and wrong.
    pub wrong: [Share; JUDGED_S.len()],
}

/// Figures of runs.
#[must_use]
pub fn figures(runs: &[&Run]) -> Figures {
    let mut delays: Vec<f64> = runs.iter().filter_map(|run| run.delay_s).collect();
    let at = |is: fn(&Judged) -> bool| {
        std::array::from_fn(|i| Share::of(runs, |run| is(&run.judged[i])))
    };
    Figures {
        false_alarms: Share::of(runs, |run| run.false_alarm),
        detected: Share::of(runs, |run| run.delay_s.is_some()),
        delay_s: [0.5, 0.9, 1.0].map(|q| quantile(&mut delays, q)),
        leaf: at(|judged| judged.leaf),
        side: at(|judged| judged.side),
        unknown: at(|judged| judged.unknown),
        wrong: at(|judged| judged.wrong),
    }
}

impl Figures {
    /// Head of a table of [`Self::row`].
    pub const HEAD: [&'static str; 2] = [
        "| soil | runs | alarms before | detected | p50, p90, max s | leaf 2/5/10 s | side | \
         unknown | wrong, p > 0.9 |",
        "|---|---|---|---|---|---|---|---|---|",
    ];

    /// A row of the table.
    #[must_use]
    pub fn row(&self, name: &str) -> String {
        let three = |shares: &[Share; JUDGED_S.len()]| {
            let percents: Vec<String> = shares
                .iter()
                .map(|share| format!("{:.1}", share.percent()))
                .collect();
            percents.join(" / ")
        };
        let [p50, p90, max] = self.delay_s;
        format!(
            "| {name} | {} | {} | {:.1} % | {p50:.2}, {p90:.2}, {max:.2} | {} | {} | {} | {} |",
            self.detected.of,
            self.false_alarms.hits,
            self.detected.percent(),
            three(&self.leaf),
            three(&self.side),
            three(&self.unknown),
            three(&self.wrong),
        )
    }

    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        let three = |shares: &[Share; JUDGED_S.len()]| shares.map(|share| share.json());
        json!({
            "false_alarms": self.false_alarms.json(), "detected": self.detected.json(),
            "delay_p50_p90_max_s": self.delay_s, "judged_s": JUDGED_S,
            "leaf": three(&self.leaf), "side": three(&self.side),
            "unknown": three(&self.unknown), "confident_wrong": three(&self.wrong),
        })
    }
}

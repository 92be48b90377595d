//! The figures on top, and what they are figures of.

use super::{Report, SensorSet, words};
use crate::scoring::{Calibration, Detection, Identification, Instants, Ratio, Score, Spread};
use vigil_pages::page::{Section, escaped};

/// A ratio with its bounds, as every table of the page writes it.
pub fn ratio(ratio: Ratio) -> String {
    let (Some(p), Some(bounds)) = (ratio.fraction(), ratio.bounds_95()) else {
        return "-".into();
    };
    let percent = |p: f64| format!("{:.1}", 100.0 * p);
    format!(
        "{} % ({}/{}; {} to {})",
        percent(p),
        ratio.right,
        ratio.n,
        percent(bounds.lower),
        percent(bounds.upper)
    )
}

/// A number with so many decimals, or a dash.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".into(), |x| format!("{x:.decimals$}"))
}

fn spread(spread: &Spread) -> String {
    let [p50, p90, max] = [spread.p50_s, spread.p90_s, spread.max_s].map(|s| number(s, 2));
    format!("{p50} / {p90} / {max}")
}

/// Name of a row and how its figure is read from one score.
type Row<'a> = (&'static str, &'a dyn Fn(&Score) -> String);

fn rows(report: &Report<'_>, rows: &[Row<'_>]) -> String {
    let row = |(name, figure): &Row<'_>| {
        let cell = |set: &SensorSet<'_>| format!("<td>{}</td>", escaped(&figure(set.score)));
        let cells: String = report.sets.iter().map(cell).collect();
        format!("<tr><th>{}</th>{cells}</tr>\n", escaped(name))
    };
    rows.iter().map(row).collect()
}

fn detection_rows(report: &Report<'_>, class: &str) -> String {
    let with = |read: &dyn Fn(&Detection) -> String, score: &Score| {
        score.detection.get(class).map_or("-".into(), read)
    };
    let read = |read: fn(&Detection) -> String| move |score: &Score| with(&read, score);
    rows(
        report,
        &[
            ("detected", &read(|d| ratio(d.within.at_end))),
            ("detected within 2 s", &read(|d| ratio(d.within.after_2_s))),
            ("delay p50 / p90 / max, s", &read(|d| spread(&d.delay))),
        ],
    )
}

fn identification_rows(report: &Report<'_>, class: &str) -> String {
    let read = |of: fn(&Identification) -> &Instants, at: fn(&Instants) -> Ratio| {
        move |score: &Score| {
            let found = score.identification.get(class);
            found.map_or("-".into(), |found| ratio(at(of(found))))
        }
    };
    rows(
        report,
        &[
            ("leaf right at 2 s", &read(|i| &i.leaf, |at| at.after_2_s)),
            ("leaf right at 5 s", &read(|i| &i.leaf, |at| at.after_5_s)),
            ("leaf right at 10 s", &read(|i| &i.leaf, |at| at.after_10_s)),
            ("side right at 2 s", &read(|i| &i.side, |at| at.after_2_s)),
            ("side right at 5 s", &read(|i| &i.side, |at| at.after_5_s)),
            ("side right at 10 s", &read(|i| &i.side, |at| at.after_10_s)),
            ("type right at 2 s", &read(|i| &i.class, |at| at.after_2_s)),
            ("type right at 5 s", &read(|i| &i.class, |at| at.after_5_s)),
            (
                "type right at 10 s",
                &read(|i| &i.class, |at| at.after_10_s),
            ),
            ("unknown at 2 s", &read(|i| &i.unknown, |at| at.after_2_s)),
            ("unknown at 10 s", &read(|i| &i.unknown, |at| at.after_10_s)),
        ],
    )
}

fn calibration_rows(report: &Report<'_>, class: &str) -> String {
    let read = |figure: fn(&Calibration) -> String| {
        move |score: &Score| score.calibration.get(class).map_or("-".into(), figure)
    };
    rows(
        report,
        &[
            (
                "log score of the true mode at 2 s, nats",
                &read(|c| number(c.log_score_nats, 3)),
            ),
            (
                "Brier score of the name at 2 s",
                &read(|c| number(c.brier_score, 4)),
            ),
            (
                "expected calibration error at 2 s",
                &read(|c| number(c.expected_calibration_error, 4)),
            ),
            (
                "wrong with p > 0.9 at 2 s",
                &read(|c| ratio(c.confident_wrong)),
            ),
        ],
    )
}

fn alarm_rows(report: &Report<'_>) -> String {
    let an_hour = |score: &Score| {
        let rate = &score.false_alarms.rate;
        format!(
            "{} ({} to {})",
            number(rate.false_alarms_per_h, 2),
            number(rate.lower_95_per_h, 2),
            number(rate.upper_95_per_h, 2)
        )
    };
    let alarms = |score: &Score| {
        let found = &score.false_alarms;
        format!(
            "{} in {:.2} h without a fault (and {:.2} h of warm-up)",
            found.alarms, found.exposure_h, found.warm_up_h
        )
    };
    let nominal = |score: &Score| {
        let found = &score.false_alarms;
        ratio(Ratio {
            n: found.nominal_runs,
            right: found.nominal_runs_alarmed,
        })
    };
    rows(
        report,
        &[
            ("false alarms", &alarms),
            ("false alarms an hour", &an_hour),
            ("nominal runs with an alarm", &nominal),
        ],
    )
}

/// Classes of a score: `all`, types of fault, then kinds.
pub fn types(report: &Report<'_>) -> Vec<String> {
    let first = report.sets.first();
    let types = first.map(|set| set.score.trade_off.configured.detection.keys().cloned());
    let mut types: Vec<String> = types.into_iter().flatten().collect();
    // One type alone is all there is.
    if types.len() == 2 {
        types.retain(|class| class != "all");
    }
    types
}

fn kinds(report: &Report<'_>) -> Vec<String> {
    let types = types(report);
    let first = report.sets.first();
    let kinds = first.map(|set| set.score.detection.keys().cloned());
    let kinds = kinds.into_iter().flatten();
    kinds
        .filter(|class| !types.contains(class) && class != "all")
        .collect()
}

fn group(report: &Report<'_>, class: &str) -> String {
    let runs = report
        .sets
        .first()
        .and_then(|set| set.score.detection.get(class));
    let n = runs.map_or(0, |found| found.n);
    let heading = match class {
        "all" => format!("all faults, {n} runs"),
        class => format!("{class}, {n} runs"),
    };
    let columns = report.sets.len() + 1;
    let mut rows = detection_rows(report, class);
    if report.identifies() {
        rows.push_str(&identification_rows(report, class));
        rows.push_str(&calibration_rows(report, class));
    }
    format!(
        "<tr class=\"group\"><th colspan=\"{columns}\">{}</th></tr>\n{rows}",
        escaped(&heading)
    )
}

fn table(report: &Report<'_>, body: &str) -> String {
    let head = |set: &SensorSet<'_>| format!("<th>{}</th>", escaped(words(set.name)));
    let heads: String = report.sets.iter().map(head).collect();
    format!(
        "<div class=\"wide\"><table>\n<thead><tr><th></th>{heads}</tr></thead>\n\
         <tbody>\n{body}</tbody>\n</table></div>\n"
    )
}

/// The figures.
pub fn section(report: &Report<'_>) -> Section {
    let mut body = alarm_rows(report);
    for class in types(report) {
        body.push_str(&group(report, &class));
    }
    let kinds: String = kinds(report).iter().map(|k| group(report, k)).collect();
    let wanted = ["command", "model", "runs", "settings"];
    let facts = report.facts.iter().filter(|fact| wanted.contains(&fact.0));
    let facts: String = facts
        .map(|(name, value)| format!("{name}: <code>{}</code><br/>", escaped(value)))
        .collect();
    let mut inside = format!("<p class=\"soft\">{facts}</p>\n{}", table(report, &body));
    if !kinds.is_empty() {
        let kinds = table(report, &kinds);
        inside.push_str(&format!(
            "<details><summary>by kind of fault</summary>\n{kinds}</details>\n"
        ));
    }
    let names = match report.identifies() {
        true => {
            "An abstract node is a wrong leaf, and a right side or type if all its leaves are of \
             it."
        }
        false => {
            "The labels name no leaf of the fault tree: they say fault or no fault, and leaf, \
             side, type and calibration do not apply."
        }
    };
    let about = format!(
        "In brackets: runs, and exact 95 % bounds (Clopper and Pearson; for false alarms an hour \
         Garwood, over the time in which an alarm was possible). Times count from the onset of \
         the fault; runs that end earlier do not count. {names}"
    );
    Section {
        id: "summary",
        heading: "Figures",
        about,
        inside,
    }
}

/// What was evaluated and how.
pub fn facts(facts: &[(&str, String)]) -> Section {
    let row = |(name, value): &(&str, String)| {
        format!(
            "<tr><th>{name}</th><td><code>{}</code></td></tr>\n",
            escaped(value)
        )
    };
    let rows: String = facts.iter().map(row).collect();
    let inside = format!("<div class=\"wide\"><table>\n<tbody>\n{rows}</tbody>\n</table></div>\n");
    Section {
        id: "provenance",
        heading: "What was evaluated, and how",
        about: "Enough to repeat it.".to_owned(),
        inside,
    }
}

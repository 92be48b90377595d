//! Calibration, delays, and delay against false alarms as charts.

use super::summary::{number, types};
use super::{Report, SensorSet, words};
use crate::scoring::{Bin, ClassDetection, Point, Score};
use vigil_pages::chart::{Axis, Chart, Curve, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::page::{KeyEntry, Section, beside, escaped, key};

const SIZE: (u32, u32) = (900, 560);
/// Values at which an axis of delays is labelled, s.
const DELAYS_S: [f64; 9] = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];
/// Values at which an axis of false alarms is labelled, 1/h.
const ALARMS_1_H: [f64; 6] = [0.0, 1.0, 10.0, 100.0, 1000.0, 10000.0];

/// One chart per set beside each other.
fn pair(report: &Report<'_>, draw: impl Fn(&SensorSet<'_>) -> String) -> String {
    let part = |set: &SensorSet<'_>| {
        let heading = escaped(words(set.name));
        format!("<h3>{heading}</h3>\n{}\n", draw(set))
    };
    beside(&report.sets.iter().map(part).collect::<Vec<_>>())
}

/// Colour of the type of fault at this place.
const fn colour(i: usize) -> Colour {
    Colour::Series(i)
}

fn curve(colour: Colour, stroke: Stroke, points: Vec<(f64, f64)>) -> Curve {
    Curve {
        colour,
        stroke,
        points,
    }
}

/// Reliability: how often claims of like probability were true.
pub fn calibration(report: &Report<'_>) -> Section {
    let names = types(report);
    // All of them are the sum of what is drawn.
    let drawn = |class: &str| class != "all" || names.len() == 1;
    let charts = pair(report, |set| {
        let mut curves = vec![curve(
            Colour::Ink,
            Stroke::Dashed,
            vec![(0.0, 0.0), (1.0, 1.0)],
        )];
        let mut tables = String::new();
        for (i, class) in names.iter().enumerate().filter(|(_, class)| drawn(class)) {
            let found = set.score.calibration.get(class);
            let bins: &[Bin] = found.map_or(&[], |found| &found.reliability);
            curves.extend(bins.iter().filter_map(|bin| {
                let bounds = bin.is_true.bounds_95()?;
                let bar = vec![(bin.p_mean, bounds.lower), (bin.p_mean, bounds.upper)];
                Some(curve(colour(i), Stroke::Thin, bar))
            }));
            let at = |bin: &Bin| Some((bin.p_mean, bin.is_true.fraction()?));
            let points = bins.iter().filter_map(at).collect();
            curves.push(curve(colour(i), Stroke::Dots, points));
            tables.push_str(&reliability(class, bins));
        }
        let chart = Chart {
            caption: format!("Reliability, {}", words(set.name)),
            size: SIZE,
            x: Axis::share("probability of the name"),
            y: Axis::share("share true"),
            curves,
            ..Chart::default()
        };
        let tables = format!("<details><summary>as tables</summary>\n{tables}</details>\n");
        format!("{}{tables}", chart.svg())
    });
    let about = "The probability that came with the name 2 s after the onset, in ten bins of \
                 equal width, against the share that was true, with 95 % bounds. An abstract \
                 node above the true leaf is true. Below the broken line names are less often true \
                 than they claim, above it more often.";
    let legend = legend(&names, drawn, &[("", Stroke::Solid)]);
    let inside = format!("{legend}{charts}");
    Section {
        id: "calibration",
        heading: "Calibration",
        about: about.to_owned(),
        inside,
    }
}

fn reliability(class: &str, bins: &[Bin]) -> String {
    let row = |bin: &Bin| {
        format!(
            "<tr><td class=\"n\">{}</td><td class=\"n\">{:.4} to {:.4}</td>\
             <td class=\"n\">{:.4}</td><td class=\"n\">{}</td></tr>\n",
            bin.n,
            bin.p_min,
            bin.p_max,
            bin.p_mean,
            number(bin.is_true.fraction(), 4)
        )
    };
    let rows: String = bins.iter().map(row).collect();
    format!(
        "<table>\n<caption>{}</caption><thead><tr><th class=\"n\">runs</th>\
         <th class=\"n\">probability</th><th class=\"n\">mean</th>\
         <th class=\"n\">share true</th></tr></thead>\n<tbody>\n{rows}</tbody></table>\n",
        escaped(class)
    )
}

/// Share of faults found within a time.
pub fn delays(report: &Report<'_>) -> Section {
    let names = types(report);
    let charts = pair(report, |set| {
        let curves = names.iter().enumerate().filter_map(|(i, class)| {
            let found = set.score.detection.get(class)?;
            let n = found.n.max(1) as f64;
            let mut points = vec![(place_delay(0.0), 0.0)];
            for (k, delay_s) in found.delays_s.iter().enumerate() {
                let at = place_delay(*delay_s);
                points.extend([(at, k as f64 / n), (at, (k + 1) as f64 / n)]);
            }
            let end = points.last().map_or(0.0, |last| last.1);
            points.push((place_delay(10.0), end));
            Some(curve(colour(i), Stroke::Solid, points))
        });
        let chart = Chart {
            caption: format!("Share of faults found within a time, {}", words(set.name)),
            size: SIZE,
            x: Axis::placed("delay, s", &DELAYS_S, place_delay),
            y: Axis::share("share of faults found"),
            curves: curves.collect(),
            ..Chart::default()
        };
        chart.svg()
    });
    let about = "From the onset of the fault to the alarm, at the configured threshold.";
    let inside = format!(
        "{}{charts}",
        legend(&names, |_| true, &[("", Stroke::Solid)])
    );
    Section {
        id: "delay",
        heading: "Time to the alarm",
        about: about.to_owned(),
        inside,
    }
}

fn legend(names: &[String], drawn: impl Fn(&str) -> bool, strokes: &[(&str, Stroke)]) -> String {
    let names = names.iter().enumerate().filter(|(_, name)| drawn(name));
    let all = names.flat_map(|(i, name)| {
        strokes.iter().map(move |(words, stroke)| KeyEntry {
            colour: colour(i),
            stroke: *stroke,
            name: format!("{name} {words}").trim_end().to_owned(),
        })
    });
    key(&all.collect::<Vec<_>>())
}

/// Place of a delay on its axis: logarithmic, what lies outside at its ends.
fn place_delay(delay_s: f64) -> f64 {
    delay_s.clamp(0.02, 10.0).log10()
}

/// Place of a rate on its axis: linear near none, logarithmic far from it.
fn place_rate(rate_1_h: f64) -> f64 {
    (1.0 + rate_1_h).log10()
}

fn rate_axis(score: &Score) -> Axis {
    let rates = score.trade_off.points.iter();
    let rates = rates.filter_map(|point| point.rate.false_alarms_per_h);
    let highest = rates.fold(0.0, f64::max);
    let below = ALARMS_1_H.iter().filter(|rate| **rate < highest).count();
    let ticks = ALARMS_1_H.get(..=below.max(1)).unwrap_or(&ALARMS_1_H);
    Axis::placed("false alarms an hour", ticks, place_rate)
}

/// A curve over all thresholds, and its point at the configured one.
fn over_thresholds(
    score: &Score,
    class: &str,
    of: impl Fn(&ClassDetection) -> Option<f64>,
) -> [Vec<(f64, f64)>; 2] {
    let at = |point: &Point| {
        let rate = point.rate.false_alarms_per_h?;
        Some((place_rate(rate), of(point.detection.get(class)?)?))
    };
    let curve = score.trade_off.points.iter().filter_map(at).collect();
    [curve, at(&score.trade_off.configured).into_iter().collect()]
}

/// Delay and misses against false alarms.
pub fn trade_off(report: &Report<'_>) -> Section {
    let names = types(report);
    let charts = pair(report, |set| {
        let score = set.score;
        let (mut delay, mut missed) = (Vec::new(), Vec::new());
        for (i, class) in names.iter().enumerate() {
            let [points, here] =
                over_thresholds(score, class, |found| found.delay.p50_s.map(place_delay));
            delay.push(curve(colour(i), Stroke::Solid, points));
            delay.push(curve(colour(i), Stroke::Dots, here));
            let [points, _] =
                over_thresholds(score, class, |found| found.delay_mean_s.map(place_delay));
            delay.push(curve(colour(i), Stroke::Dashed, points));
            let [points, here] = over_thresholds(score, class, |found| found.miss_rate);
            missed.push(curve(colour(i), Stroke::Solid, points));
            missed.push(curve(colour(i), Stroke::Dots, here));
        }
        let delay = Chart {
            caption: format!("Delay against false alarms, {}", words(set.name)),
            size: SIZE,
            x: rate_axis(score),
            y: Axis::placed("delay, s", &DELAYS_S, place_delay),
            curves: delay,
            ..Chart::default()
        };
        let missed = Chart {
            caption: format!("Missed against false alarms, {}", words(set.name)),
            size: SIZE,
            x: rate_axis(score),
            y: Axis::share("share missed"),
            curves: missed,
            ..Chart::default()
        };
        format!(
            "{}{}{}",
            delay.svg(),
            missed.svg(),
            configured(score, &names)
        )
    });
    let about = "All thresholds of the detector over one pass, the alarm armed again after each; \
                 the dots are the configured threshold. An alarm that already stands at the onset \
                 finds nothing, so that misses rise again where false alarms are many. Delays are \
                 those of the faults found. To the left \
                 of the dots they may come out too long: once its own alarm stands, the detector \
                 follows the robot and gathers less evidence.";
    let legend = legend(
        &names,
        |_| true,
        &[("median", Stroke::Solid), ("mean", Stroke::Dashed)],
    );
    let inside = format!("{legend}{charts}");
    Section {
        id: "trade-off",
        heading: "Delay against false alarms",
        about: about.to_owned(),
        inside,
    }
}

fn configured(score: &Score, names: &[String]) -> String {
    let point = &score.trade_off.configured;
    let of = |class: &String| {
        let found = point.detection.get(class)?;
        Some(format!(
            "{class} median {} s, mean {} s, {} of {} missed",
            number(found.delay.p50_s, 2),
            number(found.delay_mean_s, 2),
            found.n - found.detected,
            found.n
        ))
    };
    let found: Vec<String> = names.iter().filter_map(of).collect();
    let text = format!(
        "Configured: log-odds {:.2}, {} false alarms, {} an hour ({} to {}); {}.",
        point.threshold_log_odds,
        point.false_alarms,
        number(point.rate.false_alarms_per_h, 2),
        number(point.rate.lower_95_per_h, 2),
        number(point.rate.upper_95_per_h, 2),
        found.join("; ")
    );
    format!("<p class=\"soft\">{}</p>\n", escaped(&text))
}

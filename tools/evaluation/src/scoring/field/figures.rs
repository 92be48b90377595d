//! Many runs as figures: each with its bound and its worst run.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use schemars::JsonSchema;
use serde::Serialize;

use super::{JudgedTime, Onset, Run};
use crate::scoring::bounds::{Bounds, Difference, binomial, poisson};
use crate::scoring::expected_calibration_error;

/// Times within which an alarm or a name should have fallen, s: with encoders, by the pose alone.
const CLEARED_S: [f64; 2] = [3.0, 10.0];
/// Sets of runs that are drawn for the bounds of a calibration error.
const DRAWS: usize = 400;
/// Time within which a fault should be announced, s.
const SOON_S: f64 = 2.0;

/// The run that is worst in a figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Worst {
    /// Its value; null where something never happened.
    pub value: Option<f64>,
    /// Number of the run: its id, or the seed of a simulated one.
    pub seed: u64,
}

/// A figure over all runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Figure {
    /// Its name; the unit is last. Documents have it as their key.
    #[serde(skip)]
    pub name: &'static str,
    /// Its value; null where something never happened.
    pub value: Option<f64>,
    /// Lower end of bounds that cover the true value with 95 %. Those of counts and of shares of
    /// cases are exact. Those of shares of time, times and log scores are of a mean over runs, by
    /// Student's distribution; those of a calibration error are of a bootstrap over runs.
    pub lower_95: Option<f64>,
    /// Upper end of the same bounds.
    pub upper_95: Option<f64>,
    /// Cases behind it: runs, onsets, ends or events.
    pub n: usize,
    /// The worst run; null if no single run has this figure.
    pub worst: Option<Worst>,
}

impl Figure {
    fn new(name: &'static str, value: f64, bounds: Option<Bounds>, n: usize) -> Self {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        Self {
            name,
            value: finite(value),
            lower_95: bounds.and_then(|bounds| finite(bounds.lower)),
            upper_95: bounds.and_then(|bounds| finite(bounds.upper)),
            n,
            worst: None,
        }
    }

    /// True if it is about what the robot was ordered to do.
    pub(super) fn is_of_actions(&self) -> bool {
        let heads = ["actions", "slow", "stop", "help", "other", "blind_stops"];
        heads.iter().any(|head| self.name.starts_with(head))
    }

    fn with_worst(mut self, worst: Option<(f64, u64)>) -> Self {
        self.worst = worst.map(|(value, seed)| Worst {
            value: Some(value).filter(|value| value.is_finite()),
            seed,
        });
        self
    }
}

/// Figures over runs; those without a case are left out.
#[must_use]
pub fn figures(runs: &[Run]) -> Vec<Figure> {
    let mut all = Vec::new();
    all.extend(of_onsets(runs));
    all.extend(of_time(runs));
    all.extend(of_ends(runs));
    all.extend(of_health(runs));
    all.extend(of_claims(runs));
    all
}

fn of_onsets(runs: &[Run]) -> Vec<Figure> {
    let within = |limit_s: f64| {
        move |onset: &Onset| {
            let is_seen = onset.delay_s.is_some_and(|delay_s| delay_s <= limit_s);
            // Nothing can be said of a fault that was gone before.
            let lasted = onset.until_s - onset.t_s + 1e-6 >= limit_s;
            (is_seen || lasted || limit_s.is_infinite()).then_some(is_seen)
        }
    };
    let delays = |run: &Run| -> Vec<f64> {
        let delay = |onset: &Onset| onset.delay_s.unwrap_or(f64::INFINITY);
        run.onsets.iter().map(delay).collect()
    };
    let at = |i: usize| {
        (
            move |onset: &Onset| onset.leaf[i],
            move |onset: &Onset| onset.side[i],
        )
    };
    let mut found = vec![
        share_of_onsets("detected", runs, within(f64::INFINITY)),
        share_of_onsets("detected_2s", runs, within(SOON_S)),
        quantile("delay_p50_s", runs, delays, 0.5),
        quantile("delay_p95_s", runs, delays, 0.95),
    ];
    let names = [
        ("leaf_2s", "side_2s"),
        ("leaf_5s", "side_5s"),
        ("leaf_10s", "side_10s"),
    ];
    for (i, (leaf, side)) in names.into_iter().enumerate() {
        let (is_leaf, is_side) = at(i);
        found.push(share_of_onsets(leaf, runs, is_leaf));
        found.push(share_of_onsets(side, runs, is_side));
    }
    found.push(share_of_onsets("size_3s", runs, |onset| onset.size));
    found.into_iter().flatten().collect()
}

/// The time of a run from an instant after each onset on.
type From = fn(&Run) -> &JudgedTime;

fn of_time(runs: &[Run]) -> Vec<Figure> {
    let of = |pick: From, part: fn(&JudgedTime) -> f64| {
        move |run: &Run| (part(pick(run)), pick(run).driven_s)
    };
    let early: From = |run| &run.from_2_s;
    let late: From = |run| &run.from_10_s;
    let minutes = |run: &Run| run.duration_s / 60.0;
    let settled_minutes = |run: &Run| run.from_2_s.driven_s / 60.0;
    let found = [
        share_of_time("right_share", runs, of(early, |s| s.leaf_s), true),
        share_of_time("right_side_share", runs, of(early, |s| s.side_s), true),
        share_of_time(
            "reported_right_share",
            runs,
            of(early, |s| s.reported_s),
            true,
        ),
        share_of_time("right_share_10s", runs, of(late, |s| s.leaf_s), true),
        share_of_time("right_side_share_10s", runs, of(late, |s| s.side_s), true),
        share_of_time("standing_share_10s", runs, of(late, |s| s.alarm_s), true),
        share_of_time(
            "confident_wrong_share",
            runs,
            of(early, |s| s.confident_wrong_s),
            false,
        ),
        mean("wrong_s", runs, |run| run.wrong_s),
        rate("settled_mode_changes", runs, |r| r.mode.settled, |_| 1.0),
        rate(
            "settled_mode_changes_per_min",
            runs,
            |run| run.mode.settled,
            settled_minutes,
        ),
        rate(
            "settled_reported_changes",
            runs,
            |r| r.reported.settled,
            |_| 1.0,
        ),
        rate("mode_changes_per_min", runs, |run| run.mode.all, minutes),
        rate(
            "reported_changes_per_min",
            runs,
            |run| run.reported.all,
            minutes,
        ),
        mean("contradiction_s", runs, |run| run.contradiction_s),
        longest(runs),
        most("faults_told_most", runs, Run::faults_told),
        most("activations_most", runs, Run::activations),
        mean("blind_s", runs, |run| run.blind_s),
    ];
    let has_fault = runs.iter().any(|run| run.from_2_s.driven_s > 0.0);
    let applies = |figure: &Figure| has_fault || !figure.name.starts_with("settled");
    found.into_iter().flatten().filter(applies).collect()
}

fn of_ends(runs: &[Run]) -> Vec<Figure> {
    let alarms = |run: &Run| run.ends.iter().map(|e| (e.alarm_s, e.driven_s)).collect();
    let names = |run: &Run| run.ends.iter().map(|e| (e.name_s, e.driven_s)).collect();
    let times = |of: fn(&Run) -> Vec<ClearingTime>| {
        move |run: &Run| -> Vec<f64> {
            let time = |(time_s, _): ClearingTime| time_s.unwrap_or(f64::INFINITY);
            of(run).into_iter().map(time).collect()
        }
    };
    let found = [
        cleared("alarm_cleared_3s", runs, alarms, CLEARED_S[0]),
        cleared("alarm_cleared_10s", runs, alarms, CLEARED_S[1]),
        quantile("alarm_cleared_p50_s", runs, times(alarms), 0.5),
        quantile("alarm_cleared_p95_s", runs, times(alarms), 0.95),
        cleared("name_cleared_3s", runs, names, CLEARED_S[0]),
        cleared("name_cleared_10s", runs, names, CLEARED_S[1]),
        quantile("name_cleared_p50_s", runs, times(names), 0.5),
        quantile("name_cleared_p95_s", runs, times(names), 0.95),
    ];
    found.into_iter().flatten().collect()
}

fn of_health(runs: &[Run]) -> Vec<Figure> {
    if !runs.iter().any(|run| run.healthy_driven_s > 0.0) {
        return Vec::new();
    }
    let hours = |run: &Run| run.healthy_driven_s / 3600.0;
    let one = |_: &Run| 1.0;
    let alarmed = |run: &Run| vec![run.alarms > 0];
    let latched = |run: &Run| usize::from(run.is_help_latched);
    let found = [
        rate("alarms", runs, |run| run.alarms, one),
        rate("alarms_per_h", runs, |run| run.alarms, hours),
        rate("faults_told", runs, Run::faults_told, one),
        rate(
            "told_without_alarm",
            runs,
            |run| run.told_without_alarm,
            one,
        ),
        rate("faults_pending", runs, |run| run.faults_pending, one),
        share("runs_with_alarm", runs, alarmed, false),
        share_of_time(
            "alarm_share",
            runs,
            |run| (run.healthy_alarm_s, run.healthy_driven_s),
            false,
        ),
        share_of_time(
            "healthy_wrong_share",
            runs,
            |run| (run.healthy_wrong_s, run.healthy_driven_s),
            false,
        ),
        rate("actions", runs, |run| run.actions.all(), one),
        rate("actions_per_h", runs, |run| run.actions.all(), hours),
        rate("slow_per_h", runs, |run| run.actions.slow, hours),
        rate("stop_per_h", runs, |run| run.actions.stop, hours),
        rate("help_per_h", runs, |run| run.actions.help, hours),
        rate("other_per_h", runs, |run| run.actions.other, hours),
        rate("blind_stops_per_h", runs, |run| run.actions.blind, hours),
        rate("help_latched", runs, latched, one),
    ];
    found.into_iter().flatten().collect()
}

fn of_claims(runs: &[Run]) -> Vec<Figure> {
    let mean_score = || {
        let of = |run: &Run| run.log_score_2_s_nats;
        let scores: Vec<f64> = runs.iter().filter_map(of).collect();
        let n = scores.len();
        let bounds = of_mean(&scores).map(|bounds| Bounds {
            lower: bounds.lower.max(0.0),
            ..bounds
        });
        let mean = scores.iter().sum::<f64>() / n.max(1) as f64;
        let found = Figure::new("log_score_2s", mean, bounds, n);
        (n > 0).then(|| found.with_worst(worst(runs, false, of)))
    };
    [calibration_error(runs), mean_score()]
        .into_iter()
        .flatten()
        .collect()
}

/// Expected calibration error of all claims. Bounds: the middle 95 % of those of [`DRAWS`] times as
/// many runs drawn with replacement; few claims raise both of them, as chance adds to the error.
fn calibration_error(runs: &[Run]) -> Option<Figure> {
    let error = |runs: &mut dyn Iterator<Item = &Run>| {
        let claims = runs.flat_map(|run| &run.claims);
        expected_calibration_error(claims.map(|claim| (claim.p, claim.is_true)))
    };
    let value = error(&mut runs.iter())?;
    let mut rng = Pcg64Mcg::seed_from_u64(DRAWS as u64);
    let mut drawn = Vec::with_capacity(DRAWS);
    for _ in 0..DRAWS {
        let any = (0..runs.len()).filter_map(|_| runs.get(rng.random_range(0..runs.len())));
        drawn.extend(error(&mut any.into_iter()));
    }
    drawn.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| drawn.get((share * drawn.len() as f64) as usize).copied();
    let bounds = at(0.025).zip(at(0.975));
    let bounds = bounds.map(|(lower, upper)| Bounds { lower, upper });
    let n = runs.iter().map(|run| run.claims.len()).sum();
    Some(Figure::new(
        "ece",
        value,
        bounds.filter(|_| runs.len() > 1),
        n,
    ))
}

fn share_of_onsets(
    name: &'static str,
    runs: &[Run],
    judged: impl Fn(&Onset) -> Option<bool>,
) -> Option<Figure> {
    share(
        name,
        runs,
        |run| run.onsets.iter().filter_map(&judged).collect(),
        true,
    )
}

/// Time until something had cleared, if it had, and the driven time there was.
type ClearingTime = (Option<f64>, f64);

/// Ends after which something was down within a limit, of those after which so much was driven.
fn cleared(
    name: &'static str,
    runs: &[Run],
    of: impl Fn(&Run) -> Vec<ClearingTime>,
    limit_s: f64,
) -> Option<Figure> {
    let judged = |(time_s, driven_s): ClearingTime| {
        let is_down = time_s.is_some_and(|time_s| time_s <= limit_s);
        (is_down || driven_s >= limit_s).then_some(is_down)
    };
    let cases = |run: &Run| of(run).into_iter().filter_map(judged).collect();
    share(name, runs, cases, true)
}

/// A share of cases.
fn share(
    name: &'static str,
    runs: &[Run],
    cases: impl Fn(&Run) -> Vec<bool>,
    higher_is_better: bool,
) -> Option<Figure> {
    let (mut hits, mut of) = (0, 0);
    let worst = worst(runs, higher_is_better, |run| {
        let cases = cases(run);
        let right = cases.iter().filter(|&&is| is).count();
        (hits, of) = (hits + right, of + cases.len());
        (!cases.is_empty()).then(|| right as f64 / cases.len() as f64)
    });
    let bounds = binomial(hits, of)?;
    Some(Figure::new(name, hits as f64 / of as f64, Some(bounds), of).with_worst(worst))
}

/// A share of time: of the time of all runs together, with the bounds of the mean over runs.
fn share_of_time(
    name: &'static str,
    runs: &[Run],
    times: impl Fn(&Run) -> (f64, f64),
    higher_is_better: bool,
) -> Option<Figure> {
    let (mut part_s, mut all_s, mut shares) = (0.0, 0.0, Vec::new());
    let worst = worst(runs, higher_is_better, |run| {
        let (part, all) = times(run);
        (part_s, all_s) = (part_s + part, all_s + all);
        let share = (all > 0.0).then(|| part / all);
        shares.extend(share);
        share
    });
    if shares.is_empty() {
        return None;
    }
    let bounds = of_mean(&shares).map(|bounds| Bounds {
        lower: bounds.lower.max(0.0),
        upper: bounds.upper.min(1.0),
    });
    Some(Figure::new(name, part_s / all_s, bounds, shares.len()).with_worst(worst))
}

/// Events over an exposure.
fn rate(
    name: &'static str,
    runs: &[Run],
    events: impl Fn(&Run) -> usize,
    exposure: impl Fn(&Run) -> f64,
) -> Option<Figure> {
    let count: usize = runs.iter().map(&events).sum();
    // A count is given as such: its exposure is all there was.
    let is_count = runs
        .iter()
        .all(|run| (exposure(run) - 1.0).abs() < f64::EPSILON);
    let all = match is_count {
        true => 1.0,
        false => runs.iter().map(&exposure).sum(),
    };
    if runs.is_empty() || all <= 0.0 {
        return None;
    }
    let bounds = poisson(count);
    let bounds = Bounds {
        lower: bounds.lower / all,
        upper: bounds.upper / all,
    };
    let worst = worst(runs, false, |run| {
        let exposure = exposure(run);
        (exposure > 0.0).then(|| events(run) as f64 / exposure)
    });
    Some(Figure::new(name, count as f64 / all, Some(bounds), count).with_worst(worst))
}

/// Mean over runs.
fn mean(name: &'static str, runs: &[Run], of: impl Fn(&Run) -> f64) -> Option<Figure> {
    let values: Vec<f64> = runs.iter().map(&of).collect();
    if values.is_empty() {
        return None;
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let bounds = of_mean(&values).map(|bounds| Bounds {
        lower: bounds.lower.max(0.0),
        ..bounds
    });
    let worst = worst(runs, false, |run| Some(of(run)));
    Some(Figure::new(name, mean, bounds, values.len()).with_worst(worst))
}

/// The most of any run, where the life of faults was followed.
fn most(name: &'static str, runs: &[Run], of: fn(&Run) -> usize) -> Option<Figure> {
    let worst = worst(runs, false, |run| Some(of(run) as f64));
    let (value, _) = worst?;
    Some(Figure::new(name, value, None, runs.len()).with_worst(worst))
}

/// The longest contradiction of any run.
fn longest(runs: &[Run]) -> Option<Figure> {
    let worst = worst(runs, false, |run| Some(run.contradiction_longest_s));
    let (value, _) = worst?;
    Some(Figure::new("contradiction_longest_s", value, None, runs.len()).with_worst(worst))
}

/// The time below which the share `q` of all times lies; a time that never came is infinite.
fn quantile(
    name: &'static str,
    runs: &[Run],
    times: impl Fn(&Run) -> Vec<f64>,
    q: f64,
) -> Option<Figure> {
    let mut all: Vec<f64> = runs.iter().flat_map(&times).collect();
    all.sort_unstable_by(f64::total_cmp);
    let at = (q * all.len() as f64).ceil() as usize;
    let value = *all.get(at.saturating_sub(1))?;
    let worst = worst(runs, false, |run| times(run).into_iter().reduce(f64::max));
    Some(Figure::new(name, value, None, all.len()).with_worst(worst))
}

/// Bounds of a mean; none of fewer than two values.
fn of_mean(values: &[f64]) -> Option<Bounds> {
    let found = Difference::of_numbers(values)?;
    Some(Bounds {
        lower: found.lower_95,
        upper: found.upper_95,
    })
}

/// The first run with the worst value.
fn worst(
    runs: &[Run],
    higher_is_better: bool,
    mut value: impl FnMut(&Run) -> Option<f64>,
) -> Option<(f64, u64)> {
    let mut worst: Option<(f64, u64)> = None;
    for run in runs {
        let Some(value) = value(run) else { continue };
        let is_worse = worst.is_none_or(|(worst, _)| match higher_is_better {
            true => value < worst,
            false => value > worst,
        });
        if is_worse {
            worst = Some((value, run.seed));
        }
    }
    worst
}

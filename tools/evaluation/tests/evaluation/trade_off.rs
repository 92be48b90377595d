//! Delay against false alarms, from hand-made log-odds.

use vigil_evaluation::scoring::{Case, Point, Taxonomy, TradeOff, Verdict, score};
use vigil_recording::labels::Label;

use crate::rover::{robot, tree};

/// A run with a verdict every 0.1 s from 0.1 s on; the log-odds hold from the times given on.
fn case(run: u32, mode: &str, onset_s: Option<f64>, end_s: f64, log_odds: &[(f64, f64)]) -> Case {
    let verdicts = (1..=(end_s * 10.0).round() as u32).map(|i| {
        let t_s = f64::from(i) / 10.0;
        let now = log_odds.iter().rev().find(|now| now.0 <= t_s + 1e-9);
        Verdict {
            t_s,
            log_odds: now.map_or(-20.0, |now| now.1),
            ..Verdict::default()
        }
    });
    Case {
        label: Label {
            run,
            mode: mode.into(),
            kind: String::new(),
            wheel: None,
            onset_s,
            command_curvature_1_m: 0.0,
            command_speed_m_s: 0.2,
            duration_s: end_s,
            group: String::new(),
        },
        verdicts: verdicts.collect(),
    }
}

fn trade_off(cases: &[Case], alarm_log_odds: f64) -> TradeOff {
    score(cases, &Taxonomy::new(&tree(), &robot()), alarm_log_odds).trade_off
}

fn cases() -> Vec<Case> {
    vec![
        // Healthy: 1 for a while, later 3 twice, with more than a second of quiet between.
        case(
            0,
            "ND",
            None,
            36.1,
            &[
                (5.0, 1.0),
                (6.0, -20.0),
                (20.0, 3.0),
                (21.0, -20.0),
                (23.0, 3.0),
                (24.0, -20.0),
            ],
        ),
        // Faults: up in steps, to 2 after 0.5 s, to 4 after 1.5 s.
        case(1, "RM_STUCK", Some(10.0), 20.0, &[(10.5, 2.0), (11.5, 4.0)]),
        // To 6 at the onset itself.
        case(2, "RR_ENC", Some(10.0), 20.0, &[(10.0, 6.0)]),
        // Never beyond 0.
        case(3, "LF_STUCK", Some(10.0), 20.0, &[(11.0, 0.0)]),
    ]
}

fn near(found: Option<f64>, wanted: f64) {
    assert!(
        (found.unwrap() - wanted).abs() < 1e-9,
        "{found:?} is not {wanted}"
    );
}

#[test]
fn every_threshold_has_the_alarms_and_delays_that_its_alarm_would_have_had() {
    let point = |threshold| trade_off(&cases(), threshold).configured;
    // Exposure: 36 s and three times 0.1 to 9.9 s.
    let exposure_h = (36.0 + 3.0 * 9.8) / 3600.0;

    let high = point(3.5);
    assert_eq!((high.false_alarms, high.detection["all"].detected), (0, 2));
    near(high.rate.false_alarms_per_h, 0.0);
    near(high.rate.upper_95_per_h, -0.025_f64.ln() / exposure_h);
    near(high.detection["all"].miss_rate, 1.0 / 3.0);
    near(high.detection["stuck"].miss_rate, 0.5);
    near(high.detection["stuck"].delay.p50_s, 1.5);
    near(high.detection["encoder"].delay.p50_s, 0.0);
    near(high.detection["all"].delay_mean_s, 0.75);

    // Both rises to 3 count, as the alarm is armed again between them.
    let middle = point(2.5);
    assert_eq!(middle.false_alarms, 2);
    near(middle.rate.false_alarms_per_h, 2.0 / exposure_h);
    near(middle.detection["stuck"].delay.p50_s, 1.5);

    let low = point(0.5);
    assert_eq!(low.false_alarms, 3);
    near(low.detection["stuck"].delay.p50_s, 0.5);
    assert_eq!(low.detection["all"].detected, 2);

    // An alarm that always stands rises once a run, and finds nothing at any onset.
    let always = point(-30.0);
    assert_eq!(
        (always.false_alarms, always.detection["all"].detected),
        (4, 0)
    );
    near(always.detection["all"].miss_rate, 1.0);
    assert!(always.detection["all"].delay_mean_s.is_none());

    // None at all.
    let never = point(100.0);
    assert_eq!(
        (never.false_alarms, never.detection["all"].detected),
        (0, 0)
    );
}

#[test]
fn an_alarm_is_armed_again_only_after_a_second_far_below_its_threshold() {
    let alarms = |gap: &[(f64, f64)]| {
        let log_odds = [&[(5.0, 10.0)], gap, &[(20.0, 10.0)]].concat();
        let run = case(0, "ND", None, 30.0, &log_odds);
        trade_off(&[run], 5.0).configured.false_alarms
    };
    // Below 5 - 8 and -4 for a second: twice.
    assert_eq!(alarms(&[(8.0, -4.5), (9.0, 0.0)]), 2);
    // Not long enough; not low enough for any time; low enough twice, but not in one go.
    assert_eq!(alarms(&[(8.0, -4.5), (8.9, 0.0)]), 1);
    assert_eq!(alarms(&[(8.0, -3.9)]), 1);
    assert_eq!(
        alarms(&[(8.0, -4.5), (8.8, 0.0), (9.0, -4.5), (9.8, 0.0)]),
        1
    );
}

#[test]
fn the_curve_holds_every_level_at_which_a_first_alarm_changes() {
    let found = trade_off(&cases(), 2.5);
    let levels: Vec<f64> = found.points.iter().map(|p| p.threshold_log_odds).collect();
    assert_eq!(levels, [-20.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0]);
    let alarms: Vec<usize> = found.points.iter().map(|p| p.false_alarms).collect();
    // An alarm is above its threshold: at 3 none is left. At -20 the first one never falls.
    assert_eq!(alarms, [1, 3, 2, 2, 0, 0, 0]);
    let missed = |point: &Point| point.detection["all"].n - point.detection["all"].detected;
    let missed: Vec<usize> = found.points.iter().map(missed).collect();
    assert_eq!(missed, [0, 1, 1, 1, 1, 2, 3]);
    let empty = trade_off(&[], 2.5);
    assert!(empty.points.is_empty() && empty.configured.rate.upper_95_per_h.is_none());
}

#[test]
fn a_long_curve_is_thinned_and_keeps_its_ends() {
    let log_odds: Vec<(f64, f64)> = (0..500)
        .map(|i| (f64::from(i) / 10.0, f64::from(i)))
        .collect();
    let found = trade_off(&[case(0, "ND", None, 49.9, &log_odds)], 2.5);
    let levels: Vec<f64> = found.points.iter().map(|p| p.threshold_log_odds).collect();
    // The 30 highest, and 30 over the rest.
    assert_eq!(levels.len(), 60);
    assert_eq!((levels[0], levels[30], levels[59]), (1.0, 470.0, 499.0));
    assert!(levels.windows(2).all(|pair| pair[1] - pair[0] < 18.0));
}

#[test]
fn no_alarm_rises_while_the_detector_warms_up_and_that_time_is_no_exposure() {
    let mut cases = cases();
    for verdict in &mut cases[0].verdicts {
        verdict.warming_up = verdict.t_s < 21.95;
    }
    let found = trade_off(&cases, 2.5).configured;
    // The rise at 20 s does not count, that at 23 s does.
    assert_eq!(found.false_alarms, 1);
    let exposure_h = (36.1 - 21.9 + 3.0 * 9.8) / 3600.0;
    near(found.rate.false_alarms_per_h, 1.0 / exposure_h);
}

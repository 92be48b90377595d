//! Runs made by hand, with the figures that they must have.

#![allow(clippy::unwrap_used)]

use super::*;
use vigil_inference::FaultTree;
use vigil_inference::tree::Node;
use vigil_robot::Description;

const DT_S: f64 = 0.5;

fn taxonomy() -> Taxonomy {
    let node = |name: &str, parent: Option<usize>, fault: Option<&str>| Node {
        name: name.to_owned(),
        parent,
        fault: fault.map(str::to_owned),
    };
    let tree = FaultTree::new(vec![
        node("ND", None, None),
        node("LSS", None, None),
        node("RSS", None, None),
        node("LF_STUCK", Some(1), Some("stuck:LF")),
        node("LM_STUCK", Some(1), Some("stuck:LM")),
        node("RM_STUCK", Some(2), Some("stuck:RM")),
        node("RM_ENC", None, Some("encoder:RM")),
    ]);
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(root.join("config/robots/rover.toml")).unwrap();
    let robot: Description = toml::from_str(&text).unwrap();
    Taxonomy::new(&tree.unwrap(), &robot)
}

fn healthy_until(from_s: f64, truth: Truth) -> Vec<Stretch> {
    let stretch = |from_s, truth| Stretch { from_s, truth };
    vec![stretch(0.0, Truth::Healthy), stretch(from_s, truth)]
}

fn fault(name: &str) -> Truth {
    Truth::Faults(vec![name.to_owned()])
}

/// What is said in a nominal moment.
fn quiet(t_s: f64) -> Moment<'static> {
    Moment {
        t_s,
        dt_s: DT_S,
        drives: true,
        alarm: false,
        p_nominal: 0.99,
        mode: "ND",
        p_mode: 0.99,
        set: "ND",
        reported: "ND",
        told: Told::GoOn,
        action: 0,
    }
}

/// A fault is said.
fn said(t_s: f64, mode: &'static str) -> Moment<'static> {
    Moment {
        alarm: true,
        p_nominal: 0.01,
        mode,
        p_mode: 0.95,
        set: mode,
        reported: mode,
        ..quiet(t_s)
    }
}

/// Scores moments at every half second up to `end_s`.
fn score(truth: &[Stretch], end_s: f64, moment: impl Fn(f64) -> Moment<'static>) -> Run {
    let taxonomy = taxonomy();
    let mut scorer = Scorer::new(truth, &taxonomy, 7);
    let mut t_s = 0.0;
    while t_s < end_s {
        scorer.take(&moment(t_s));
        t_s += DT_S;
    }
    scorer.finish()
}

fn near(found: f64, wanted: f64) {
    assert!((found - wanted).abs() < 1e-9, "{found} is not {wanted}");
}

fn figure(runs: &[Run], name: &str) -> Figure {
    let found = figures(runs);
    found
        .into_iter()
        .find(|figure| figure.name == name)
        .unwrap()
}

#[test]
fn a_fault_that_is_named_at_once_and_kept_is_right_all_the_time() {
    let run = score(
        &healthy_until(10.0, fault("RM_STUCK")),
        70.0,
        |t_s| match t_s {
            t if t < 10.5 => quiet(t),
            t => said(t, "RM_STUCK"),
        },
    );
    let onset = &run.onsets[0];
    assert_eq!((run.onsets.len(), onset.delay_s), (1, Some(0.5)));
    assert_eq!(onset.leaf, [Some(true); 3]);
    // Moments at 12.0 to 69.5 s, and at 20.0 to 69.5 s.
    near(run.from_2_s.driven_s, 58.0);
    near(run.from_2_s.leaf_s, 58.0);
    near(run.from_10_s.driven_s, 50.0);
    near(run.wrong_s, 0.5);
    near(run.healthy_driven_s, 10.0);
    assert_eq!(run.mode, Changes { all: 1, settled: 0 });
    assert_eq!((run.alarms, run.contradiction_s), (0, 0.0));
}

#[test]
fn a_name_that_flaps_is_wrong_for_as_long_and_each_change_counts() {
    let run = score(
        &healthy_until(0.0, fault("LF_STUCK")),
        20.0,
        |t_s| match t_s {
            t if t < 5.0 => said(t, "LF_STUCK"),
            t if t < 7.0 => said(t, "LM_STUCK"),
            t if t < 8.0 => said(t, "LSS"),
            t if t < 9.0 => Moment {
                set: "LF_STUCK+RM_ENC",
                ..said(t, "MULTIPLE")
            },
            t => said(t, "LF_STUCK"),
        },
    );
    assert_eq!(run.onsets[0].leaf, [Some(true), Some(false), Some(true)]);
    assert_eq!(run.onsets[0].side, [Some(true); 3]);
    near(run.from_2_s.driven_s - run.from_2_s.leaf_s, 4.0);
    near(run.from_2_s.driven_s - run.from_2_s.side_s, 1.0);
    // Only the other leaf is a wrong leaf; two faults and the abstract node are not.
    near(run.from_2_s.confident_wrong_s, 2.0);
    assert_eq!(run.mode, Changes { all: 4, settled: 4 });
    let rate = figure(&[run], "settled_mode_changes_per_min");
    near(rate.value.unwrap(), 4.0 / 0.3);
}

#[test]
fn what_is_not_seen_is_missed_and_never_left_out() {
    let missed = score(&healthy_until(5.0, fault("RM_STUCK")), 30.0, quiet);
    let found = score(
        &healthy_until(5.0, fault("RM_STUCK")),
        30.0,
        |t_s| match t_s {
            t if t < 5.5 => quiet(t),
            t => said(t, "RM_STUCK"),
        },
    );
    assert_eq!(missed.onsets[0].delay_s, None);
    let runs = [found, missed];
    let detected = figure(&runs, "detected");
    assert_eq!((detected.value, detected.n), (Some(0.5), 2));
    // Clopper and Pearson, 1 of 2.
    let lower = detected.lower_95.unwrap();
    assert!((lower - (1.0 - 0.975_f64.sqrt())).abs() < 1e-8, "{lower}");
    assert_eq!(
        detected.worst,
        Some(Worst {
            value: Some(0.0),
            seed: 7
        })
    );
    assert_eq!(figure(&runs, "delay_p50_s").value, Some(0.5));
    assert_eq!(figure(&runs, "delay_p95_s").value, None);
    near(figure(&runs, "right_share").value.unwrap(), 0.5);
}

#[test]
fn an_alarm_that_stands_already_announces_nothing() {
    let run = score(
        &healthy_until(5.0, fault("RM_STUCK")),
        30.0,
        |t_s| match t_s {
            t if t < 2.0 => quiet(t),
            t => said(t, "RM_STUCK"),
        },
    );
    assert_eq!((run.alarms, run.onsets[0].delay_s), (1, None));
    let rate = figure(std::slice::from_ref(&run), "alarms_per_h");
    near(rate.value.unwrap(), 720.0);
    // Garwood's limits of one event: 0.0253 and 5.572, over 5 s.
    assert!((rate.lower_95.unwrap() - 720.0 * 0.0253).abs() < 0.1);
    assert!((rate.upper_95.unwrap() - 720.0 * 5.572).abs() < 0.4);
}

#[test]
fn a_second_fault_is_announced_by_a_new_name() {
    let both = Truth::Faults(vec!["RM_STUCK".to_owned(), "RM_ENC".to_owned()]);
    let mut truth = healthy_until(5.0, fault("RM_STUCK"));
    truth.push(Stretch {
        from_s: 15.0,
        truth: both,
    });
    let run = score(&truth, 30.0, |t_s| match t_s {
        t if t < 5.0 => quiet(t),
        t if t < 16.0 => said(t, "RM_STUCK"),
        t => Moment {
            set: "RM_ENC+RM_STUCK",
            ..said(t, "MULTIPLE")
        },
    });
    let delays: Vec<Option<f64>> = run.onsets.iter().map(|onset| onset.delay_s).collect();
    assert_eq!(delays, [Some(0.0), Some(1.0)]);
    assert_eq!(run.onsets[1].leaf, [Some(true); 3]);
    assert_eq!(run.onsets[0].until_s, 14.5);
    assert_eq!(run.mode.settled, 0);
}

#[test]
fn clearing_is_counted_in_driven_seconds_and_may_never_happen() {
    let mut truth = healthy_until(5.0, fault("RM_STUCK"));
    let healthy = |from_s| Stretch {
        from_s,
        truth: Truth::Healthy,
    };
    truth.push(healthy(10.0));
    let cleared = |alarm_s: f64, name_s: f64| {
        score(&truth, 60.0, move |t_s| {
            let fault = if (5.0..name_s).contains(&t_s) {
                said(t_s, "RM_STUCK")
            } else {
                quiet(t_s)
            };
            Moment {
                alarm: (5.0..alarm_s).contains(&t_s),
                // It stands for two seconds after the end.
                drives: !(10.0..12.0).contains(&t_s),
                ..fault
            }
        })
    };
    let run = cleared(16.0, 13.0);
    let end = &run.ends[0];
    assert_eq!(
        (end.t_s, end.alarm_s, end.name_s),
        (10.0, Some(4.0), Some(1.0))
    );
    near(end.driven_s, 48.0);
    // Alarm without a fault's name from 13 to 16 s.
    near(run.contradiction_s, 3.0);
    near(run.contradiction_longest_s, 3.0);
    let never = cleared(f64::INFINITY, 13.0);
    assert_eq!(never.ends[0].alarm_s, None);
    let runs = [run, never];
    assert_eq!(figure(&runs, "alarm_cleared_3s").value, Some(0.0));
    assert_eq!(figure(&runs, "alarm_cleared_10s").value, Some(0.5));
    assert_eq!(figure(&runs, "name_cleared_3s").value, Some(1.0));
    assert_eq!(figure(&runs, "alarm_cleared_p95_s").value, None);
}

#[test]
fn what_no_model_describes_is_unknown_or_its_own_leaf() {
    let own = Truth::Unmodelled {
        own: Some("RM_ENC".to_owned()),
    };
    let run = score(&healthy_until(0.0, own), 12.0, |t_s| match t_s {
        t if t < 4.0 => said(t, "UNKNOWN"),
        t if t < 6.0 => said(t, "RM_ENC"),
        t if t < 8.0 => said(t, "RSS"),
        t if t < 9.0 => said(t, "RM_STUCK"),
        t => quiet(t),
    });
    near(run.from_2_s.leaf_s, 4.0);
    near(run.from_2_s.side_s, 6.0);
    near(run.from_2_s.confident_wrong_s, 1.0);
}

#[test]
fn actions_are_entries_and_stops_by_rule_are_counted_apart() {
    let told = |t_s, told, action| Moment {
        told,
        action,
        ..quiet(t_s)
    };
    let run = score(&[], 10.0, |t_s| match t_s {
        t if t < 2.0 => quiet(t),
        t if t < 3.0 => told(t, Told::Slow, 1),
        t if t < 4.0 => told(t, Told::Other, 2),
        // The same kind for another wheel is another action.
        t if t < 5.0 => told(t, Told::Other, 3),
        t if t < 6.0 => told(t, Told::Blind, 4),
        t if t < 7.0 => quiet(t),
        t if t < 8.0 => told(t, Told::Stop, 4),
        t => told(t, Told::Help, 5),
    });
    let wanted = Actions {
        slow: 1,
        stop: 1,
        help: 1,
        other: 2,
        blind: 1,
    };
    assert_eq!((run.actions, run.actions.all()), (wanted, 5));
    assert!(run.is_help_latched);
    near(figure(&[run], "actions_per_h").value.unwrap(), 5.0 * 360.0);
}

#[test]
fn a_reported_fault_without_alarm_contradicts_and_blind_is_no_name() {
    let run = score(&[], 10.0, |t_s| match t_s {
        t if t < 2.0 => quiet(t),
        t if t < 3.0 => Moment {
            reported: "LSS",
            ..quiet(t)
        },
        t if t < 4.0 => quiet(t),
        t if t < 6.0 => Moment {
            mode: BLIND,
            reported: BLIND,
            ..quiet(t)
        },
        t => quiet(t),
    });
    near(run.contradiction_s, 1.0);
    near(run.blind_s, 2.0);
    near(run.healthy_wrong_s, 0.0);
    assert_eq!(run.reported, Changes { all: 4, settled: 0 });
}

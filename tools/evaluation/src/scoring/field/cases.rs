//! Runs made by hand, with the figures that they must have.

use super::*;
use crate::scoring::Verdict;
use vigil_blocks::SizeKind;
use vigil_robot::Description;
use vigil_robot::FaultTree;
use vigil_robot::tree::Node;

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
    let stretch = |from_s, truth| Stretch {
        from_s,
        truth,
        size: None,
    };
    vec![stretch(0.0, Truth::Healthy), stretch(from_s, truth)]
}

fn fault(name: &str) -> Truth {
    Truth::Faults(vec![name.to_owned()])
}

/// Probabilities of the nodes: before an alarm, and of a wheel that is stuck on the right.
const HEALTHY: [f64; 7] = [0.99, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
const FAULTY: [f64; 7] = [0.01, 0.01, 0.97, 0.01, 0.0, 0.97, 0.0];

fn belief(p_nodes: &[f64], p_unknown: f64, is_identifying: bool) -> Belief<'_> {
    Belief {
        p_nodes,
        p_unknown,
        is_identifying,
    }
}

/// What is said in a nominal moment.
fn quiet(t_s: f64) -> Verdict {
    Verdict {
        t_s,
        drives: true,
        p_nodes: HEALTHY.to_vec(),
        p_unknown: 0.01,
        mode: "ND".to_owned(),
        p_mode: 0.99,
        fault_set: "ND".to_owned(),
        reported: "ND".to_owned(),
        ..Verdict::default()
    }
}

/// A fault is said.
fn said(t_s: f64, mode: &'static str) -> Verdict {
    Verdict {
        alarm: true,
        p_nodes: FAULTY.to_vec(),
        is_identifying: true,
        mode: mode.to_owned(),
        p_mode: 0.95,
        fault_set: mode.to_owned(),
        reported: mode.to_owned(),
        ..quiet(t_s)
    }
}

/// Scores moments at every half second up to `end_s`.
fn score(truth: &[Stretch], end_s: f64, moment: impl Fn(f64) -> Verdict) -> Run {
    let taxonomy = taxonomy();
    let mut scorer = Scorer::new(truth, &taxonomy, [-DT_S, end_s], 7);
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
    near(run.from_10_s.alarm_s, 50.0);
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
            t if t < 9.0 => Verdict {
                fault_set: "LF_STUCK+RM_ENC".to_owned(),
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
        size: None,
    });
    let run = score(&truth, 30.0, |t_s| match t_s {
        t if t < 5.0 => quiet(t),
        t if t < 16.0 => said(t, "RM_STUCK"),
        t => Verdict {
            fault_set: "RM_ENC+RM_STUCK".to_owned(),
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
        size: None,
    };
    truth.push(healthy(10.0));
    let cleared = |alarm_s: f64, name_s: f64| {
        score(&truth, 60.0, move |t_s| {
            let fault = if (5.0..name_s).contains(&t_s) {
                said(t_s, "RM_STUCK")
            } else {
                quiet(t_s)
            };
            Verdict {
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
fn a_size_is_right_with_its_leaf_its_way_and_within_a_fifth() {
    let gain = |value| Size {
        kind: SizeKind::Gain,
        value,
    };
    let mut truth = healthy_until(5.0, fault("RM_ENC"));
    truth[1].size = Some(gain(0.5));
    let right = |name, size| {
        let run = score(&truth, 20.0, move |t_s| match t_s {
            t if t < 6.0 => quiet(t),
            // At 3 s and no later.
            t if t > 8.0 => Verdict {
                size: gain(2.0),
                ..said(t, name)
            },
            t => Verdict {
                size,
                ..said(t, name)
            },
        });
        run.onsets[0].size
    };
    let bias = Size {
        kind: SizeKind::BiasRadS,
        value: 0.5,
    };
    assert_eq!(right("RM_ENC", gain(0.41)), Some(true));
    assert_eq!(right("RM_ENC", gain(0.61)), Some(false));
    assert_eq!(right("RM_ENC", bias), Some(false));
    assert_eq!(right("RM_STUCK", gain(0.5)), Some(false));
    let run = score(&healthy_until(5.0, fault("RM_ENC")), 20.0, quiet);
    assert_eq!(run.onsets[0].size, None);
}

#[test]
fn actions_are_entries_and_stops_by_rule_are_counted_apart() {
    let order = |t_s, order, action: u32| Verdict {
        order,
        action: action.to_string(),
        ..quiet(t_s)
    };
    let run = score(&[], 10.0, |t_s| match t_s {
        t if t < 2.0 => quiet(t),
        t if t < 3.0 => order(t, RobotOrder::Slow, 1),
        t if t < 4.0 => order(t, RobotOrder::Other, 2),
        // The same kind for another wheel is another action.
        t if t < 5.0 => order(t, RobotOrder::Other, 3),
        t if t < 6.0 => order(t, RobotOrder::Blind, 4),
        t if t < 7.0 => quiet(t),
        t if t < 8.0 => order(t, RobotOrder::Stop, 4),
        t => order(t, RobotOrder::Help, 5),
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
        t if t < 3.0 => Verdict {
            reported: "LSS".to_owned(),
            ..quiet(t)
        },
        t if t < 4.0 => quiet(t),
        t if t < 6.0 => Verdict {
            mode: BLIND.to_owned(),
            reported: BLIND.to_owned(),
            ..quiet(t)
        },
        t => quiet(t),
    });
    near(run.contradiction_s, 1.0);
    near(run.blind_s, 2.0);
    near(run.healthy_wrong_s, 0.0);
    assert_eq!(run.reported, Changes { all: 4, settled: 0 });
}

#[test]
fn a_belief_before_an_alarm_is_shared_out_by_the_priors() {
    let taxonomy = taxonomy().with_prior_unknown(0.2);
    // Four leaves have 0.2 each of what is not nominal, the unknown 0.2.
    let before = belief(&[0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.6, false);
    near(before.node(0, &taxonomy), 0.4);
    near(before.node(5, &taxonomy), 0.12);
    near(before.unknown(&taxonomy), 0.12);
    assert_eq!(before.top(&taxonomy), (Some(0), 0.4));
    // After the alarm nothing is divided; abstract nodes are no modes.
    let after = belief(&[0.1, 0.0, 0.5, 0.0, 0.0, 0.3, 0.0], 0.6, true);
    near(after.node(5, &taxonomy), 0.3);
    assert_eq!(after.top(&taxonomy), (None, 0.6));
}

#[test]
fn claims_are_made_at_fixed_instants_of_the_first_fault_and_as_many_before() {
    let mut truth = healthy_until(10.0, fault("RM_STUCK"));
    truth.push(Stretch {
        from_s: 14.0,
        truth: Truth::Healthy,
        size: None,
    });
    let moment = |t_s: f64| match t_s {
        t if t < 11.5 => quiet(t),
        t => said(t, "RM_STUCK"),
    };
    // Five before the onset; at 0.5, 1 and 2 s; the fault is gone at 5 s.
    let run = score(&truth, 30.0, moment);
    let claim = |p, is_true| Claim { p, is_true };
    let mut wanted = vec![claim(0.99, true); 5];
    wanted.extend([claim(0.99, false), claim(0.99, false), claim(0.97, true)]);
    assert_eq!(run.claims, wanted);
    near(run.log_score_2_s_nats.unwrap(), -0.97_f64.ln());
    // All are in the last bin: 6 true of 8, 7.9 claimed.
    let found = figure(std::slice::from_ref(&run), "ece");
    near(found.value.unwrap(), (7.9 - 6.0) / 8.0);
    assert_eq!((found.n, found.lower_95), (8, None));

    // A fault that is not seen: the leaf has a quarter of 0.99 * 0.01, and five claims are true.
    let missed = score(&healthy_until(10.0, fault("RM_STUCK")), 30.0, quiet);
    let p = 0.99 * 0.01 / 4.0_f64;
    near(missed.log_score_2_s_nats.unwrap(), -p.ln());
    let runs = [run, missed];
    let mean = figure(&runs, "log_score_2s");
    near(mean.value.unwrap(), -(p.ln() + 0.97_f64.ln()) / 2.0);
    assert_eq!(mean.n, 2);
    let found = figure(&runs, "ece");
    near(found.value.unwrap(), (7.9 + 9.9 - 11.0) / 18.0);
    assert!(found.lower_95.unwrap() < found.value.unwrap());
}

#[test]
fn what_no_model_describes_claims_the_unknown_or_its_own_leaf() {
    let own = |own: Option<&str>| Truth::Unmodelled {
        own: own.map(str::to_owned),
    };
    let moment = move |t_s: f64| Verdict {
        p_nodes: vec![0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.4],
        p_unknown: 0.3,
        ..said(t_s, "RM_ENC")
    };
    let run = score(&healthy_until(0.0, own(Some("RM_ENC"))), 20.0, moment);
    // The robot was never healthy: only the five claims after the onset.
    let is_true: Vec<bool> = run.claims.iter().map(|claim| claim.is_true).collect();
    assert_eq!(is_true, [true; 5]);
    near(run.log_score_2_s_nats.unwrap(), -0.7_f64.ln());
    let run = score(&healthy_until(0.0, own(None)), 20.0, moment);
    assert!(run.claims.iter().all(|claim| !claim.is_true));
    near(run.log_score_2_s_nats.unwrap(), -0.3_f64.ln());
    // Several faults: either leaf is true, but of just both no probability is published.
    let both = Truth::Faults(vec!["RM_STUCK".to_owned(), "RM_ENC".to_owned()]);
    let run = score(&healthy_until(0.0, both), 20.0, moment);
    assert!(run.claims.iter().all(|claim| claim.is_true));
    assert_eq!(run.log_score_2_s_nats, None);
}

//! Scores of hand-made verdicts.

use vigil_evaluation::scoring::{Case, Claims, Ratio, Score, Side, Taxonomy, Verdict, score};
use vigil_recording::labels::Label;
use vigil_robot::FaultTree;
use vigil_robot::tree::Node;

use crate::rover::{robot, tree};

/// Threshold of the hand-made verdicts' alarms, which have log-odds of 20 while they stand, -20
/// otherwise.
const ALARM: f64 = 10.0;

fn label(run: u32, mode: &str, kind: &str, onset_s: Option<f64>) -> Label {
    Label {
        run,
        mode: mode.into(),
        kind: kind.into(),
        wheel: None,
        onset_s,
        command_curvature_1_m: 0.0,
        command_speed_m_s: 0.2,
        duration_s: 15.0,
        group: String::new(),
    }
}

/// Verdicts at 0.1 s, 0.2 s .. `end_s`. From each time in `changes` on: alarm, mode, its
/// probability (which is also its node's).
fn case(label: Label, end_s: f64, changes: &[(f64, bool, &str, f64)]) -> Case {
    let tree = tree();
    let verdicts = (1..=(end_s * 10.0).round() as u32).map(|i| {
        let t_s = f64::from(i) / 10.0;
        let now = changes.iter().rev().find(|change| change.0 <= t_s + 1e-9);
        let &(_, alarm, mode, p) = now.unwrap_or(&(0.0, false, "ND", 1.0));
        let mut p_nodes = vec![0.0; tree.nodes().len()];
        if let Some(node) = tree.index(mode) {
            p_nodes[node] = p;
        }
        Verdict {
            t_s,
            log_odds: if alarm { 20.0 } else { -20.0 },
            alarm,
            mode: mode.into(),
            p_mode: p,
            p_nodes,
            is_identifying: alarm,
            ..Verdict::default()
        }
    });
    Case {
        label,
        verdicts: verdicts.collect(),
    }
}

fn scored(cases: &[Case]) -> Score {
    score(cases, &Taxonomy::new(&tree(), &robot()), ALARM)
}

fn ratio(right: usize, n: usize) -> Ratio {
    Ratio { n, right }
}

#[test]
fn side_and_type_of_nodes_follow_from_their_leaves() {
    let taxonomy = Taxonomy::new(&tree(), &robot());
    for (mode, side, class) in [
        ("ND", None, None),
        ("LSS", Some(Side::Left), Some("stuck")),
        ("RSS", Some(Side::Right), Some("stuck")),
        ("RLE", None, Some("encoder")),
        ("RM_STUCK", Some(Side::Right), Some("stuck")),
        ("LF_ENC", Some(Side::Left), Some("encoder")),
        ("UNKNOWN", None, None),
    ] {
        assert_eq!(taxonomy.side(mode), side, "{mode}");
        assert_eq!(taxonomy.class(mode), class, "{mode}");
    }
    assert!(taxonomy.covers("RSS", "RM_STUCK") && taxonomy.covers("RM_STUCK", "RM_STUCK"));
    assert!(!taxonomy.covers("LSS", "RM_STUCK") && !taxonomy.covers("UNKNOWN", "RM_STUCK"));
    assert!(taxonomy.covers("UNKNOWN", "SLOPE") && !taxonomy.covers("RSS", "SLOPE"));
    let left = taxonomy
        .leaves("stuck", Side::Left)
        .map(|i| taxonomy.name(i).unwrap());
    assert_eq!(
        left.collect::<Vec<_>>(),
        ["LF_STUCK", "LM_STUCK", "LR_STUCK"]
    );
}

/// Nominal and faulty runs with alarms at all sorts of times.
fn alarms() -> Vec<Case> {
    vec![
        // Two false alarms in one nominal run, none in the other.
        case(
            label(0, "ND", "", None),
            10.0,
            &[
                (1.0, true, "ND", 1.0),
                (2.0, false, "ND", 1.0),
                (3.0, true, "ND", 1.0),
            ],
        ),
        case(label(1, "ND", "", None), 10.0, &[]),
        // On time; at the onset itself; never.
        case(
            label(2, "LF_STUCK", "stuck", Some(4.0)),
            15.0,
            &[(4.3, true, "LF_STUCK", 1.0)],
        ),
        case(
            label(3, "LF_STUCK", "stuck", Some(4.0)),
            15.0,
            &[(4.0, true, "LF_STUCK", 1.0)],
        ),
        case(label(4, "RR_ENC", "zero", Some(4.0)), 15.0, &[]),
        // A false alarm that stands is no detection; one that falls and rises again is both.
        case(
            label(5, "RR_ENC", "noise", Some(4.0)),
            15.0,
            &[(3.9, true, "RR_ENC", 1.0)],
        ),
        case(
            label(6, "RR_ENC", "noise", Some(4.0)),
            15.0,
            &[
                (2.0, true, "ND", 1.0),
                (3.0, false, "ND", 1.0),
                (6.0, true, "RR_ENC", 1.0),
            ],
        ),
    ]
}

#[test]
fn alarms_are_counted_by_their_rise_before_and_after_the_onset() {
    let score = scored(&alarms());
    let false_alarms = &score.false_alarms;
    assert_eq!(
        (false_alarms.nominal_runs, false_alarms.nominal_runs_alarmed),
        (2, 1)
    );
    assert_eq!(false_alarms.faulty_runs, 5);
    assert_eq!(false_alarms.faulty_runs_alarmed_before_onset, 2);
    assert_eq!(false_alarms.alarms, 4);
    assert_eq!(false_alarms.run_ids, [0, 5, 6]);
    // Two times 9.9 s, five times from 0.1 to 3.9 s.
    let exposure_s = 2.0 * 9.9 + 5.0 * 3.8;
    assert!((false_alarms.exposure_h * 3600.0 - exposure_s).abs() < 1e-9);

    let of = |class: &str| &score.detection[class];
    assert_eq!(
        (of("all").n, of("all").detected, of("all").missed),
        (5, 3, 2)
    );
    assert_eq!(of("all").missed_run_ids, [4, 5]);
    assert_eq!((of("stuck").detected, of("encoder").detected), (2, 1));
    assert_eq!(
        (of("zero").missed, of("noise").missed, of("noise").detected),
        (1, 1, 1)
    );
    // 0.0 and 0.3 s; 2.0 s; two never.
    assert_eq!(of("all").within.after_2_s, ratio(3, 5));
    assert_eq!(of("noise").within.after_2_s, ratio(1, 2));
    assert_eq!(of("all").within.at_end, ratio(3, 5));
    assert!(of("zero").delay.p50_s.is_none());
    let near = |value: Option<f64>, wanted: f64| (value.unwrap() - wanted).abs() < 1e-9;
    let rate = &false_alarms.rate;
    assert!(near(rate.false_alarms_per_h, 4.0 * 3600.0 / exposure_s));
    // Garwood's bounds on 4 events: 1.0899 and 10.2416.
    let an_hour = 3600.0 / exposure_s;
    assert!((rate.lower_95_per_h.unwrap() - 1.089_87 * an_hour).abs() < 1e-3);
    assert!((rate.upper_95_per_h.unwrap() - 10.241_59 * an_hour).abs() < 1e-3);
    assert!(near(of("stuck").delay.p50_s, 0.0) && near(of("stuck").delay.max_s, 0.3));
    assert!(near(of("all").delay.p50_s, 0.3) && near(of("all").delay.p90_s, 2.0));
    assert_eq!(score.runs["nominal"], 2);
    assert_eq!(
        (score.runs["stuck"], score.runs["zero"], score.runs["noise"]),
        (2, 1, 2)
    );
}

#[test]
fn leaf_side_and_type_are_judged_at_instants_after_the_onset() {
    let stuck = |run| label(run, "RM_STUCK", "stuck", Some(4.0));
    let cases = [
        // Right at 2 s and to the end.
        case(stuck(0), 15.0, &[(4.5, true, "RM_STUCK", 0.9)]),
        // The side only, and the leaf exactly from 5 s after the onset on.
        case(
            stuck(1),
            15.0,
            &[(4.5, true, "RSS", 0.9), (9.0, true, "RM_STUCK", 0.9)],
        ),
        // Wrong side, right type; then unknown; ends before 10 s after the onset.
        case(
            stuck(2),
            12.0,
            &[(4.5, true, "LSS", 0.9), (9.5, true, "UNKNOWN", 0.9)],
        ),
        // Right side, wrong type; lost in the end.
        case(
            stuck(3),
            15.0,
            &[(4.5, true, "RR_ENC", 0.6), (14.0, true, "ND", 0.9)],
        ),
    ];
    let score = scored(&cases);
    let of = &score.identification["stuck"];
    assert_eq!(of.leaf.after_2_s, ratio(1, 4));
    assert_eq!(of.leaf.after_5_s, ratio(2, 4));
    assert_eq!(of.leaf.after_10_s, ratio(2, 3));
    assert_eq!(of.leaf.at_end, ratio(2, 4));
    assert_eq!(of.side.after_2_s, ratio(3, 4));
    assert_eq!(of.side.after_10_s, ratio(2, 3));
    assert_eq!(of.class.after_2_s, ratio(3, 4));
    assert_eq!(of.unknown.at_end, ratio(1, 4));
    assert_eq!(of.wrong_run_ids_after_2_s, [1, 2, 3]);
    assert_eq!(of.isolation.n, 2);
    assert!((of.isolation.p50_s.unwrap() - 0.5).abs() < 1e-9);
    assert!((of.isolation.max_s.unwrap() - 5.0).abs() < 1e-9);
    let by = &score.confusion_by;
    assert_eq!(
        (by.side["right"]["right"], by.side["right"]["left"]),
        (3, 1)
    );
    assert_eq!(
        (by.class["stuck"]["stuck"], by.class["stuck"]["encoder"]),
        (3, 1)
    );
    let row = &score.confusion["RM_STUCK"];
    assert_eq!(row.values().sum::<usize>(), 4);
    assert_eq!(
        (row["RM_STUCK"], row["RSS"], row["LSS"], row["RR_ENC"]),
        (1, 1, 1, 1)
    );
}

#[test]
fn the_type_encoder_is_right_for_its_abstract_node_but_the_side_is_not() {
    let encoder = label(0, "LF_ENC", "frozen", Some(4.0));
    let score = scored(&[case(encoder, 15.0, &[(4.5, true, "RLE", 0.9)])]);
    let of = &score.identification["frozen"];
    assert_eq!(
        (of.leaf.after_2_s, of.side.after_2_s),
        (ratio(0, 1), ratio(0, 1))
    );
    assert_eq!(of.class.after_2_s, ratio(1, 1));
    assert_eq!(*of, score.identification["encoder"]);
}

#[test]
fn a_fault_that_the_tree_lacks_is_to_be_called_unknown() {
    let slope = |run| label(run, "SLOPE", "slope", Some(4.0));
    let mut unknown = case(slope(0), 15.0, &[(4.5, true, "UNKNOWN", 0.8)]);
    for verdict in &mut unknown.verdicts {
        verdict.p_unknown = 0.8;
    }
    let cases = [
        unknown,
        case(slope(1), 15.0, &[(4.5, true, "RM_STUCK", 0.95)]),
    ];
    let score = scored(&cases);
    assert_eq!(
        score.identification["unmodelled"].leaf.after_2_s,
        ratio(1, 2)
    );
    let calibration = &score.calibration["slope"];
    assert_eq!(calibration.confident_wrong, ratio(1, 2));
    // -ln 0.8 and the floor of 1e-6.
    let log_score = (-0.8_f64.ln() + 6.0 * 10.0_f64.ln()) / 2.0;
    assert!((calibration.log_score_nats.unwrap() - log_score).abs() < 1e-9);
}

#[test]
fn calibration_counts_an_abstract_node_above_the_truth_as_true() {
    let stuck = |run| label(run, "RM_STUCK", "stuck", Some(4.0));
    let cases = [
        case(stuck(0), 15.0, &[(4.5, true, "RM_STUCK", 0.5)]),
        case(stuck(1), 15.0, &[(4.5, true, "RSS", 0.95)]),
        case(stuck(2), 15.0, &[(4.5, true, "LSS", 0.95)]),
        // Too short to be judged.
        case(stuck(3), 5.0, &[(4.5, true, "LSS", 0.95)]),
        case(label(4, "ND", "", None), 15.0, &[]),
    ];
    let score = scored(&cases);
    let calibration = &score.calibration["stuck"];
    assert_eq!(*calibration, score.calibration["all"]);
    assert_eq!(calibration.n, 3);
    assert_eq!(calibration.confident_wrong, ratio(1, 3));
    // One claim in the bin from 0.5, two in the last, of which one is true.
    let error = (0.5 + (1.9 - 1.0)) / 3.0;
    assert!((calibration.expected_calibration_error.unwrap() - error).abs() < 1e-12);
    let brier = (0.25 + 0.0025 + 0.9025) / 3.0;
    assert!((calibration.brier_score.unwrap() - brier).abs() < 1e-12);
    let bins = calibration.reliability.iter();
    let bins: Vec<_> = bins
        .map(|bin| (bin.n, bin.p_mean, bin.is_true.right))
        .collect();
    assert_eq!(bins, [(1, 0.5, 1), (2, 0.95, 1)]);
    let log_score = (-0.5_f64.ln() + 12.0 * 10.0_f64.ln()) / 3.0;
    assert!((calibration.log_score_nats.unwrap() - log_score).abs() < 1e-9);
}

#[test]
fn calibration_bins_are_of_equal_width() {
    let mut claims = Claims::default();
    assert!(claims.expected_calibration_error().is_none());
    // 0.05 and 0.0 with nothing true; 0.1 begins the next bin; 1.0 belongs to the last one.
    for (p, is_true) in [
        (0.05, false),
        (0.0, false),
        (0.1, true),
        (0.95, true),
        (1.0, true),
        (0.99, false),
    ] {
        claims.add(p, is_true);
    }
    let bins: Vec<_> = claims
        .bins()
        .iter()
        .map(|b| (b.n, b.p_min, b.p_max))
        .collect();
    assert_eq!(bins, [(2, 0.0, 0.05), (1, 0.1, 0.1), (3, 0.95, 1.0)]);
    let wanted = (0.05 + 0.9 + (2.94 - 2.0)) / 6.0;
    assert!((claims.expected_calibration_error().unwrap() - wanted).abs() < 1e-12);
}

#[test]
fn no_runs_give_a_score_without_fractions() {
    let score = scored(&[]);
    assert!(score.detection.is_empty() && score.identification.is_empty());
    assert!(score.calibration.is_empty());
    assert!(score.to_string().contains("false alarms    0 in 0.00 h"));
    let silent = Case {
        label: label(0, "RM_STUCK", "stuck", Some(1.0)),
        verdicts: Vec::new(),
    };
    let score = scored(&[silent]);
    assert_eq!(score.detection["all"].missed, 1);
    assert_eq!(score.identification["all"].leaf.at_end, ratio(0, 0));
}

#[test]
fn the_detectors_warm_up_is_no_exposure() {
    let mut cases = alarms();
    for verdict in cases.iter_mut().flat_map(|case| &mut case.verdicts) {
        verdict.warming_up = verdict.t_s < 1.05;
    }
    let found = &scored(&cases).false_alarms;
    // Of each of the seven runs the part from 0.1 to 1.0 s.
    let (exposure_s, warm_up_s) = (2.0 * 9.9 + 5.0 * 3.8 - 7.0 * 0.9, 7.0 * 0.9);
    assert!((found.exposure_h * 3600.0 - exposure_s).abs() < 1e-9);
    assert!((found.warm_up_h * 3600.0 - warm_up_s).abs() < 1e-9);
    let rate = found.rate.false_alarms_per_h.unwrap();
    assert!((rate - found.alarms as f64 * 3600.0 / exposure_s).abs() < 1e-6);
    assert!(scored(&cases).to_string().contains("h of warm-up"));
}

#[test]
fn a_model_of_nominal_behaviour_is_scored_by_fault_or_no_fault() {
    let nominal = Node {
        name: "ND".into(),
        parent: None,
        fault: None,
    };
    let tree = FaultTree::new(vec![nominal]).unwrap();
    let mut cases = alarms();
    for case in &mut cases {
        for verdict in &mut case.verdicts {
            verdict.mode = if verdict.alarm { "UNKNOWN" } else { "ND" }.into();
        }
    }
    let score = score(&cases, &Taxonomy::new(&tree, &robot()), ALARM);
    assert!(!score.identifies && scored(&cases).identifies);
    assert_eq!(score.detection["all"], scored(&cases).detection["all"]);
    assert_eq!(score.false_alarms, scored(&cases).false_alarms);
    let modes = cases
        .iter()
        .filter(|case| !case.label.is_nominal())
        .map(|case| &case.label.mode);
    for mode in modes {
        assert!(score.detection[mode].n > 0, "{mode} is a class of its own");
    }
    assert!(score.identification.is_empty() && score.calibration.is_empty());
    assert!(score.confusion_by.side.is_empty() && score.confusion_by.class.is_empty());
    let reported = score.confusion.values().flat_map(|row| row.keys());
    assert!(
        reported
            .into_iter()
            .all(|mode| mode == "ND" || mode == "UNKNOWN")
    );
    assert!(score.to_string().contains("do not apply"));
}

//! The page, and filters beside each other, from hand-made verdicts.

use roxmltree::{Document, ParsingOptions};
use vigil_evaluation::report::{Report, SensorSet};
use vigil_evaluation::scoring::{Case, Entrant, Taxonomy, Verdict, contest, score};
use vigil_recording::labels::Label;

use crate::rover::{robot, tree};

/// A run with a verdict every 0.1 s to 15 s that names `mode` with `p` from `since_s` on.
fn case(run: u32, truth: &str, mode: &str, since_s: f64, p: f64) -> Case {
    let tree = tree();
    let verdicts = (1..=150).map(|i| {
        let t_s = f64::from(i) / 10.0;
        let (mode, p) = if t_s < since_s {
            ("ND", 1.0)
        } else {
            (mode, p)
        };
        let mut p_nodes = vec![0.0; tree.nodes().len()];
        p_nodes[0] = 1.0 - p;
        p_nodes[tree.index(mode).unwrap()] = p;
        Verdict {
            t_s,
            log_odds: if mode == "ND" { -20.0 } else { 20.0 },
            alarm: mode != "ND",
            mode: mode.into(),
            p_mode: p,
            p_nodes,
            is_identifying: mode != "ND",
            ..Verdict::default()
        }
    });
    Case {
        label: Label {
            run,
            mode: truth.into(),
            kind: "<odd> & \"kind\"".into(),
            wheel: None,
            onset_s: (truth != "ND").then_some(4.0),
            command_curvature_1_m: 0.0,
            command_speed_m_s: 0.2,
            duration_s: 15.0,
            group: String::new(),
        },
        verdicts: verdicts.collect(),
    }
}

fn cases(named: &str) -> Vec<Case> {
    vec![
        case(0, "ND", "ND", 99.0, 1.0),
        case(1, "RM_STUCK", "RM_STUCK", 4.5, 0.8),
        case(2, "RM_STUCK", named, 4.5, 0.95),
        case(3, "LF_ENC", "LF_ENC", 5.0, 0.6),
    ]
}

/// The index leads to every section, and the verdict says what was found.
fn check_head(page: &Document<'_>, sections: &[&str]) {
    let links = page.descendants().filter_map(|node| node.attribute("href"));
    let wanted: Vec<String> = sections.iter().map(|id| format!("#{id}")).collect();
    assert_eq!(links.collect::<Vec<_>>(), wanted);
    let mut all = page.descendants();
    let verdict = all.find(|node| node.attribute("class") == Some("verdict"));
    let verdict = verdict.and_then(|node| node.text()).unwrap();
    assert!(
        verdict.contains("3 of 3 (100.0 %) faults were found"),
        "{verdict}"
    );
}

#[test]
fn the_page_is_well_formed_and_loads_nothing() {
    let taxonomy = Taxonomy::new(&tree(), &robot());
    let (good, bad) = (cases("RM_STUCK"), cases("LM_STUCK"));
    let scores = [&good, &bad].map(|cases| score(cases, &taxonomy, 10.0));
    let entrants = [("multiple-hypothesis", &good), ("imm", &bad)];
    let entrants = entrants.map(|(name, cases)| Entrant::new(name, cases, &taxonomy));
    let contest = contest(&entrants);
    let set = |name, i: usize, cases| SensorSet {
        name,
        score: &scores[i],
        cases,
        contest: Some(&contest),
    };
    let report = Report {
        facts: vec![("command", "vigil evaluate <a> & \u{1b}[1m\"b\"".into())],
        sets: vec![set("pose", 1, &bad), set("pose+encoders", 0, &good)],
        taxonomy: &taxonomy,
    };
    let html = report.html();
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = Document::parse_with_options(&html, options).unwrap();
    let sections: Vec<&str> = page
        .descendants()
        .filter(|node| node.has_tag_name("section"))
        .filter_map(|node| node.attribute("id"))
        .collect();
    let wanted = [
        "summary",
        "filters",
        "confusion",
        "calibration",
        "delay",
        "trade-off",
        "belief",
        "provenance",
    ];
    assert_eq!(sections, wanted);
    check_head(&page, &wanted);
    for outside in [
        "http://", "https://", "src=", "<script", "<link", "@import", "url(",
    ] {
        assert!(!html.contains(outside), "{outside}");
    }
    // The key of shades, two each of calibration, delay, delay and misses over alarms, and two a
    // run.
    let drawings = page.descendants().filter(|node| node.has_tag_name("svg"));
    let drawings: Vec<_> = drawings.collect();
    assert_eq!(drawings.len(), 1 + 8 + 2 * 4);
    // No drawing keeps a colour that the page cannot change with light and dark.
    for drawing in drawings {
        for node in drawing.descendants() {
            for name in ["fill", "stroke"] {
                let colour = node.attribute(name).unwrap_or("none");
                let free = ["none", "currentColor"].contains(&colour) || colour.starts_with("var(");
                assert!(free, "{name}={colour}");
            }
        }
    }
    // The run that pose misnamed comes first, and in no other place.
    let runs = page
        .descendants()
        .filter(|node| node.attribute("class") == Some("run"));
    let heads = runs.filter_map(|run| run.descendants().find(|node| node.has_tag_name("h3")));
    let heads: Vec<&str> = heads.filter_map(|head| head.text()).collect();
    assert_eq!(heads.len(), 4);
    assert!(heads[0].starts_with("run 2: RM_STUCK (<odd> & \"kind\"), onset 4.00 s"));
}

#[test]
fn filters_are_compared_run_by_run_with_the_first() {
    let taxonomy = Taxonomy::new(&tree(), &robot());
    let (good, bad) = (cases("RM_STUCK"), cases("LM_STUCK"));
    let entrants = [
        ("multiple-hypothesis", &good),
        ("imm", &bad),
        ("raised", &good),
    ];
    let entrants = entrants.map(|(name, cases)| Entrant::new(name, cases, &taxonomy));
    let contest = contest(&entrants);
    assert_eq!(
        contest.keys().collect::<Vec<_>>(),
        ["all", "encoder", "stuck"]
    );
    let [exact, imm, raised] = &contest["stuck"][..] else {
        panic!("three filters");
    };
    assert!(exact.leaf.after_2_s.difference.is_none());
    assert_eq!(imm.filter, "imm");
    let leaf = imm.leaf.after_2_s.difference.unwrap();
    assert_eq!((leaf.n, leaf.mean), (2, -0.5));
    assert!(leaf.lower_95 < -0.5 && leaf.upper_95 > -0.5);
    assert_eq!(imm.confident_wrong.ratio.right, 1);
    assert_eq!(imm.confident_wrong.difference.unwrap().mean, 0.5);
    // -ln 0.95 of run 2 became the floor of 1e-6.
    let worse = (0.95_f64.ln() + 6.0 * 10.0_f64.ln()) / 2.0;
    assert!((imm.log_score_difference.unwrap().mean - worse).abs() < 1e-9);
    assert_eq!(raised.leaf.after_10_s.difference.unwrap().mean, 0.0);
    assert_eq!(contest["all"][0].leaf.after_2_s.ratio.n, 3);
    assert!(vigil_evaluation::scoring::contest(&[]).is_empty());
}

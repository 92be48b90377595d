//! Scenarios of `bench/field.toml`, and small ones.

use std::collections::BTreeSet;

use super::*;
use crate::field::course::{Range, course};
use crate::field::fault::{Places, changes, truth};
use crate::field::ground::stream;
use crate::simulated::Rover;
use vigil_diagnosis::Sensors;
use vigil_evaluation::scoring::field::{Run, Truth, figures};
use vigil_robot::disturbance_kind::KINDS;

fn shipped() -> (File, Rover) {
    let file = File::read(&crate::root().join("bench/field.toml")).unwrap();
    (file, Rover::read().unwrap())
}

#[test]
fn every_scenario_can_be_driven_and_every_bar_has_a_figure() {
    let (file, rover) = shipped();
    let mut run = Run {
        healthy_driven_s: 1.0,
        duration_s: 1.0,
        ..Run::default()
    };
    run.from_2_s.driven_s = 1.0;
    run.from_10_s.driven_s = 1.0;
    let names = figures(&[run]);
    let of_cases = [
        "detected",
        "leaf",
        "side",
        "alarm_cleared",
        "name_cleared",
        "delay",
        "size",
        "ece",
        "log_score",
    ];
    let mut seeds = BTreeSet::new();
    for scenario in file.scenario.iter().filter(|s| s.recorded.is_none()) {
        let rng = &mut stream(scenario.first_seed, 1);
        let range = Range {
            command: &rover.model.command,
            robot: &rover.robot,
            graph: &[],
        };
        course(&scenario.drive, range, scenario.run_s, rng).unwrap();
        let places = Places::draw(&rover.robot, 0, rng);
        for specs in [&scenario.faults, &scenario.context] {
            let specs = scenario.specs(specs, 0);
            changes(&specs, &places, &rover.robot, 0.0).unwrap();
        }
        for bar in &scenario.bars {
            let known = names.iter().any(|figure| figure.name == bar.figure);
            let is_case = of_cases.iter().any(|head| bar.figure.starts_with(head));
            assert!(known || is_case, "{}: {bar}", scenario.name);
        }
        seeds.insert(scenario.first_seed);
    }
    let disturbed = file.scenario.iter();
    let disturbed = disturbed.flat_map(|s| s.faults.iter().chain(&s.in_turn));
    let disturbed: BTreeSet<&str> = disturbed.filter_map(|s| s.split(':').next()).collect();
    assert!(KINDS.iter().all(|row| disturbed.contains(row.name)));
    assert!(seeds.len() > 40);
}

#[test]
fn values_and_places_are_put_in() {
    let text = "[[scenario]]\nname = \"a\"\nabout = \"b\"\nrun_s = 1\nruns = 1\n\
                first_seed = 1\ndrive = \"random\"\nvary = { key = \"world.lag_s\", \
                values = [0.1, 0.2] }\neach = [\"tether:10\", \"slope\"]\n\
                faults = [\"EACH@1\"]\n";
    let path = std::env::temp_dir().join(format!("vigil-field-{}.toml", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let file = File::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let names: Vec<&str> = file.scenario.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names,
        ["a/0.1/tether", "a/0.1/slope", "a/0.2/tether", "a/0.2/slope"]
    );
    assert_eq!(file.scenario[2].world.lag_s, Some(Draw::Always(0.2)));
    assert_eq!(file.scenario[2].faults, ["tether:10@1"]);
}

#[test]
fn a_departure_becomes_a_scenario_of_each_size() {
    let (file, _) = shipped();
    let named = |name: &str| file.scenario.iter().find(|s| s.name == name).unwrap();
    let healthy = named("departure/encoder-gain/0.5");
    assert_eq!(healthy.faults, ["encoder-scale:W1:1.012000@10"]);
    let bars = |s: &Scenario| s.bars.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(bars(healthy), ["detected <= 0"]);
    assert!(named("departure/encoder-gain/1").bars.is_empty());
    let faulty = bars(named("departure/encoder-gain/3"));
    assert_eq!(faulty, ["detected >= 1", "standing_share_10s >= 0.99"]);
}

#[test]
fn truth_follows_what_breaks_and_mends() {
    let (_, rover) = shipped();
    let specs = [
        "stuck:LF@10",
        "encoder:RM:zero@20+5",
        "clear:LF@30",
        "tether:20@40",
    ];
    let specs = specs.map(str::to_owned);
    let places = Places::draw(&rover.robot, 0, &mut stream(1, 1));
    let all = changes(&specs, &places, &rover.robot, 1.0).unwrap();
    let of = |sensors| -> Vec<(f64, Truth)> {
        let found = truth(&all, &rover.tree, &rover.robot, sensors);
        found.into_iter().map(|s| (s.from_s, s.truth)).collect()
    };
    let faults = |names: &[&str]| Truth::Faults(names.iter().map(ToString::to_string).collect());
    let unmodelled = Truth::Unmodelled { own: None };
    assert_eq!(
        of(Sensors::PoseEncoders),
        [
            (0.0, Truth::Healthy),
            (11.0, faults(&["LF_STUCK"])),
            (26.0, faults(&["LF_STUCK", "RM_ENC"])),
            (31.0, faults(&["RM_ENC"])),
            (41.0, unmodelled.clone()),
        ]
    );
    assert_eq!(
        of(Sensors::Pose),
        [
            (0.0, Truth::Healthy),
            (11.0, faults(&["LF_STUCK"])),
            (31.0, Truth::Healthy),
            (41.0, unmodelled),
        ]
    );
}

//! Services die beside a fault, one or several, twice: what was known stands, nobody is called for
//! what has an answer, and nothing else is named.
#![cfg(test)]

mod virtual_graph;

use std::fmt;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{
    Action, EventKind, FaultRecord, FaultSource, FaultState, Faults, Health, RecoveryKind,
};
use vigil_cycle::port::Bus;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Receiver, Topic, VirtualClock};
use vigil_learning::channel_learning::{Log, learn};
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{Document, Setup};

use virtual_graph::kobuki::Kobuki;
use virtual_graph::{Publisher, Stages, VirtualGraph, document};

/// Faults, and what is to be done about them.
struct Scenario<'a> {
    config: &'static str,
    /// Another model than that of the configuration.
    model: Option<&'a Path>,
    inject: &'static [&'static str],
    /// They are known and answered by then, s.
    known_s: f64,
    faults: &'static [&'static str],
    answer: RecoveryKind,
}

/// Services are dead from an instant on, each until it is started again.
struct Death {
    from_s: f64,
    until_s: Vec<(ServiceName, f64)>,
}

impl fmt::Display for Death {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.2} s", self.from_s)?;
        for (service, until_s) in &self.until_s {
            write!(f, " {} until {until_s:.2} s", service.as_str())?;
        }
        write!(f, "; ")
    }
}

/// Two deaths of one service or several. Both, and how long they last, are drawn.
fn deaths(rng: &mut Pcg64Mcg, known_s: f64) -> Vec<Death> {
    let mut from_s = known_s;
    let mut draw = || {
        // The second may begin while services of the first are dead.
        from_s += rng.random_range(0.2..8.0);
        // One at least.
        let subset = rng.random_range(1..8);
        let chosen = ServiceName::STEPPING.into_iter().enumerate();
        let chosen = chosen.filter(|(bit, _)| subset >> bit & 1 == 1);
        let until_s: Vec<_> = chosen
            .map(|(_, name)| (name, from_s + rng.random_range(0.05..1.5)))
            .collect();
        Death { from_s, until_s }
    };
    vec![draw(), draw()]
}

/// What the supervisor did and told of.
struct Watch {
    actions: Box<dyn Receiver<Action>>,
    faults: Box<dyn Receiver<Faults>>,
    /// Kinds of action from `known_s` on, each once in a row, and since when.
    kinds: Vec<(f64, RecoveryKind)>,
    known_s: f64,
    known: Box<Faults>,
    told: Box<Faults>,
    simulator: Box<dyn Receiver<Health>>,
    goal_s: Option<f64>,
}

impl Watch {
    fn new(graph: &Graph, known_s: f64) -> Self {
        let simulator = Topic::Health(ServiceName::SensorSim);
        Self {
            actions: graph.receiver(Topic::Action).unwrap(),
            faults: graph.receiver(Topic::Faults).unwrap(),
            kinds: Vec::new(),
            known_s,
            known: Box::default(),
            told: Box::default(),
            simulator: graph.receiver(simulator).unwrap(),
            goal_s: None,
        }
    }

    fn look(&mut self, t_s: f64) {
        let is_known = t_s >= self.known_s;
        while let Some(action) = self.actions.take_next() {
            let kind = RecoveryKind::from_repr(action.kind).unwrap();
            let is_new = self.kinds.last().is_none_or(|(_, last)| *last != kind);
            if is_known && is_new {
                self.kinds.push((t_s, kind));
            }
        }
        while let Some(health) = self.simulator.take_next() {
            let goal = EventKind::Goal as u32;
            if health.events.iter().any(|event| event.kind == goal) {
                self.goal_s.get_or_insert(t_s);
            }
        }
        while let Some(faults) = self.faults.take_next() {
            *self.told = *faults;
            if !is_known {
                *self.known = *faults;
            }
        }
    }
}

/// Faults of the robot that were active, and how often each became so.
fn active(faults: &Faults, setup: &Setup) -> Vec<(String, u32)> {
    let of_robot = |it: &&FaultRecord| it.source == FaultSource::Robot as u32;
    let active = faults.kept().filter(of_robot);
    let active = active.filter(|it| it.state() == Some(FaultState::Active));
    active
        .map(|it| (setup.tree.mode_name(it.what).to_owned(), it.count))
        .collect()
}

/// The graph, from its first cycle on.
fn drive(scenario: &Scenario<'_>, deaths: &[Death], kept: &Path, until_s: f64) -> (Watch, Setup) {
    let learned = |file: &mut GraphFile| {
        if let Some(model) = scenario.model {
            file.files.model = model.display().to_string();
        }
    };
    let text = document(scenario.config, learned).to_text().unwrap();
    let setup = Document::from_text(kept, text).unwrap().check().unwrap();
    let (period_ns, clock) = (setup.period_ns(), VirtualClock::default());
    let graph = Graph::InProcess(Bus::new(clock.clone()));
    let mut watch = Watch::new(&graph, scenario.known_s);
    let mut publisher = Publisher::new(&setup, &graph, scenario.inject);
    clock.set(period_ns);
    let mut stages = Stages::new(VirtualGraph {
        setup: &setup,
        graph: &graph,
        clock: &clock,
        kept,
    });
    let mut dead = Vec::new();
    for k in 1..=(until_s * 1e9) as u64 / period_ns {
        let t_ns = k * period_ns;
        let is_now = |at_s: f64| (at_s * 1e9) as u64 / period_ns == k;
        clock.set(t_ns);
        for (name, until_s) in deaths.iter().flat_map(|death| &death.until_s) {
            if is_now(*until_s) {
                stages.start(*name);
                dead.retain(|it| it != name);
            }
        }
        for death in deaths.iter().filter(|death| is_now(death.from_s)) {
            for (name, _) in &death.until_s {
                stages.end(*name);
                dead.push(*name);
            }
        }
        publisher.turn(&clock, t_ns);
        for name in ServiceName::STEPPING {
            // Who hears nothing waits until its deadline.
            if dead.contains(&name) {
                clock.set(t_ns + period_ns - 1);
            }
            stages.turn(name);
        }
        watch.look(t_ns as f64 * 1e-9);
    }
    (watch, setup)
}

/// A drive goes on so long after the last death, s.
const AFTER_S: f64 = 12.0;
/// The answer stands so long after the last death, s.
const AGAIN_S: f64 = 4.0;

/// Why what was done with these deaths is wrong, if it is.
fn wrong(scenario: &Scenario<'_>, deaths: &[Death], kept: &Path) -> Option<String> {
    let last = deaths.iter().flat_map(|death| &death.until_s);
    let until_s = last.fold(0.0, |until_s: f64, (_, it)| until_s.max(*it)) + AFTER_S;
    let (watch, setup) = drive(scenario, deaths, kept, until_s);
    let (answer, kinds) = (scenario.answer, &watch.kinds);
    let is_answered = kinds.first().is_some_and(|(_, kind)| *kind == answer);
    let allowed = [answer, RecoveryKind::Stop, RecoveryKind::SlowDown];
    let is_right = kinds.iter().all(|(_, kind)| allowed.contains(kind));
    // Nobody needs longer than this to do it again.
    let last_s = kinds.last().map_or(f64::INFINITY, |(t_s, _)| *t_s);
    let ends = kinds.last().is_some_and(|(_, kind)| *kind == answer);
    let ends = ends && last_s < until_s - AFTER_S + AGAIN_S;
    // Each of them was told before, and nothing is told anew.
    let (before, told) = (active(&watch.known, &setup), active(&watch.told, &setup));
    let are_told = |name: &&str| told.iter().any(|(told, _)| told == name);
    let is_told = scenario.faults.iter().all(are_told) && told == before;
    let is_well = is_answered && is_right && ends && is_told;
    (!is_well).then(|| format!("{kinds:?}; {before:?}, {told:?}"))
}

/// Seeds of the deaths.
const SEEDS: [u64; 8] = [0, 1, 17, 42, 183, 195, 239, 240];

/// Nothing else is done or told, whoever dies.
fn demand_the_same(scenario: &Scenario<'_>) {
    let folder = tempfile::tempdir().unwrap();
    for seed in SEEDS {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let deaths = deaths(&mut rng, scenario.known_s);
        let kept = folder.path().join(seed.to_string());
        let wrong = wrong(scenario, &deaths, &kept);
        let deaths: String = deaths.iter().map(ToString::to_string).collect();
        assert_eq!(wrong, None, "seed {seed}: {deaths}");
    }
}

const STUCK: Scenario<'_> = Scenario {
    config: "rover.toml",
    model: None,
    inject: &["stuck:RM@3"],
    known_s: 6.0,
    faults: &["RM_STUCK"],
    answer: RecoveryKind::Compensate,
};

const ENCODER: Scenario<'_> = Scenario {
    inject: &["encoder:LF:zero@3"],
    faults: &["LF_ENC"],
    answer: RecoveryKind::IgnoreEncoder,
    ..STUCK
};

/// The yaw rate and the motors' currents are measured, too.
const ALL: &str = "rover-all.toml";

#[test]
fn a_stuck_wheel_stays_compensated() {
    demand_the_same(&STUCK);
}

#[test]
fn a_stuck_wheel_stays_compensated_where_currents_are_measured() {
    demand_the_same(&Scenario {
        config: ALL,
        ..STUCK
    });
}

#[test]
fn a_broken_encoder_stays_ignored() {
    demand_the_same(&ENCODER);
    demand_the_same(&Scenario {
        config: ALL,
        ..ENCODER
    });
}

#[test]
fn a_rover_with_two_stuck_wheels_limps_on() {
    demand_the_same(&Scenario {
        inject: &["stuck:RM@3", "stuck:LF@3"],
        known_s: 8.0,
        faults: &["LF_STUCK", "RM_STUCK"],
        answer: RecoveryKind::LimpHome,
        ..STUCK
    });
}

#[test]
fn a_call_for_help_stands() {
    demand_the_same(&Scenario {
        inject: &["stuck:RM@3", "stuck:RF@3"],
        known_s: 8.0,
        faults: &["RF_STUCK", "RM_STUCK"],
        answer: RecoveryKind::CallForHelp,
        ..STUCK
    });
}

#[test]
fn a_call_about_a_weak_motor_or_a_broken_gyro_stands() {
    for (inject, faults) in [
        (&["torque-loss:LR:0.9@3"], &["LR_TORQUE"]),
        (&["gyro-bias:0.2@3"], &["GYRO"]),
    ] {
        demand_the_same(&Scenario {
            config: ALL,
            inject,
            known_s: 10.0,
            faults,
            answer: RecoveryKind::CallForHelp,
            ..STUCK
        });
    }
}

#[test]
fn a_healthy_rover_drives_on() {
    for config in ["rover.toml", ALL] {
        demand_the_same(&Scenario {
            config,
            inject: &[],
            faults: &[],
            answer: RecoveryKind::GoOn,
            ..STUCK
        });
    }
}

#[test]
fn so_it_is_of_a_robot_whose_model_was_learned_from_its_log() {
    let config = "kobuki.toml";
    let setup = document(config, |_| {}).check().unwrap();
    let log = [Kobuki::new(&setup.robot, &[], 2).drive(setup.file.graph.rate_hz, 900.0)];
    let (model, _) = learn(&Log::of_healthy(&log), &setup.robot).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("kobuki.toml");
    std::fs::write(&file, model.to_toml().unwrap()).unwrap();
    let kobuki = Scenario {
        config,
        model: Some(&file),
        known_s: 16.0,
        ..STUCK
    };
    demand_the_same(&Scenario {
        inject: &[],
        faults: &[],
        answer: RecoveryKind::GoOn,
        ..kobuki
    });
    demand_the_same(&Scenario {
        inject: &["stuck:L@8"],
        faults: &["drive_L"],
        answer: RecoveryKind::CallForHelp,
        ..kobuki
    });
}

#[test]
fn a_rover_with_a_stuck_wheel_reaches_its_goal_though_each_service_dies() {
    let scenario = Scenario {
        config: "corridor-people.toml",
        inject: &["stuck:RM@5"],
        known_s: 12.0,
        ..STUCK
    };
    let death = |from_s: f64, name| Death {
        from_s,
        until_s: vec![(name, from_s + 0.4)],
    };
    let deaths = [
        death(20.0, ServiceName::Supervisor),
        death(25.0, ServiceName::Detector),
        death(30.0, ServiceName::Identifier),
    ];
    let folder = tempfile::tempdir().unwrap();
    let (watch, setup) = drive(&scenario, &deaths, &folder.path().join("kept"), 120.0);
    let goal_s = watch.goal_s.unwrap();
    for death in &deaths {
        let soon_s = death.from_s + 1.0;
        let mut kinds = watch.kinds.iter().filter(|(t_s, _)| *t_s < soon_s);
        let is_steered = matches!(kinds.next_back(), Some((_, RecoveryKind::Compensate)));
        assert!(is_steered && goal_s > soon_s, "{death}{:?}", watch.kinds);
    }
    // Nobody calls a person, or drives as if all wheels turned.
    let is_wrong = |kind| [RecoveryKind::CallForHelp, RecoveryKind::GoOn].contains(&kind);
    let all_right = watch.kinds.iter().all(|(_, kind)| !is_wrong(*kind));
    assert!(all_right && !watch.kinds.is_empty(), "{:?}", watch.kinds);
    assert_eq!(active(&watch.told, &setup), [("RM_STUCK".to_owned(), 1)]);
}

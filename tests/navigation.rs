//! The corridor world, its watchers and the supervisor in one thread: what is done, in order.
#![cfg(test)]

use std::path::PathBuf;

use vigil_blocks::{
    Action, ActionOutcome, DetectionBelief, Entry, FaultBelief, ParticleBlock, RecoveryKind,
    SensorFrame, Symptoms,
};
use vigil_decision::{Inputs, Supervisor};
use vigil_diagnosis::detect::Detector;
use vigil_diagnosis::identify::{Diagnoser, Input};
use vigil_robot::injection::Injection;
use vigil_sensor_sim::{NavigatorEvent, SensorSource, Simulation};
use vigil_setup::graph_file::{GraphFile, Trouble, TroubleKind};
use vigil_setup::{Setup, load_graph};

const PERIOD_NS: u64 = 10_000_000;

/// A shipped graph, changed.
fn setup(name: &str, change: impl FnOnce(&mut GraphFile)) -> Setup {
    let config = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config");
    // The sequences below are those of a drive at full speed from its first instant on.
    let at_full_speed = |file: &mut GraphFile| {
        file.supervisor.arming_speed_scale = 1.0;
        change(file);
    };
    load_graph(&config.join(name), at_full_speed).unwrap()
}

/// Has a corridor decide by the paper's model, which has fewer states and actions.
fn by_the_papers_model(file: &mut GraphFile) {
    let paper = ["FP", "NP", "RL", "GO", "MA", "SH", "GU"];
    let supervisor = &mut file.supervisor;
    file.files.decision = "navigation.pomdp".to_owned();
    supervisor
        .actions
        .retain(|name, _| paper.contains(&name.as_str()));
    supervisor.lost_state = None;
    (supervisor.policy, supervisor.policy_file) = ("qmdp".to_owned(), None);
}

/// Four services in one thread.
struct Corridor {
    setup: Setup,
    simulation: Simulation,
    detector: Detector,
    identifier: Diagnoser,
    supervisor: Supervisor,
    frame: SensorFrame,
    detection: Box<DetectionBelief>,
    diagnosis: Box<FaultBelief>,
    particles: [Box<ParticleBlock>; 2],
    action: Option<Box<Action>>,
    /// What was decided, fired and happened, in words: `FP`, `+EPM`, `GO failed`, `goal`.
    told: Vec<String>,
}

impl Corridor {
    fn new(setup: Setup) -> Self {
        let SensorSource::Simulator(simulation, _) =
            vigil_sensor_sim::assemble(&setup, &[]).unwrap()
        else {
            unreachable!("a corridor is simulated");
        };
        Self {
            simulation: *simulation,
            detector: vigil_detector::assemble(&setup).unwrap(),
            identifier: vigil_identifier::assemble(&setup).unwrap(),
            supervisor: vigil_supervisor::assemble(&setup).unwrap(),
            frame: SensorFrame::default(),
            detection: Box::default(),
            diagnosis: Box::default(),
            particles: [Box::default(), Box::default()],
            action: None,
            told: Vec::new(),
            setup,
        }
    }

    fn step(&mut self) {
        let action = self.action.as_deref();
        self.simulation.step(PERIOD_NS as f64 * 1e-9, action, 0);
        self.simulation.measure(&mut self.frame);
        self.frame.header.t_capture_ns += PERIOD_NS;
        match self.simulation.take_event() {
            Some(NavigatorEvent::Ended(kind, outcome)) => {
                let name = Self::name(kind);
                let how = if outcome == ActionOutcome::Succeeded {
                    "done"
                } else {
                    "failed"
                };
                self.told.push(format!("{name} {how}"));
            }
            Some(NavigatorEvent::Goal) => self.told.push("goal".to_owned()),
            None => {}
        }
        let fired = self.detection.symptoms;
        let [detected, drawn] = &mut self.particles;
        let entry = Entry::Frame(&self.frame);
        self.detector.step(entry, &mut self.detection, detected);
        // Those of the monitors; outcomes are told above.
        for (name, bit) in &Symptoms::NAMED[..4] {
            if self.detection.symptoms & !fired & bit != 0 {
                self.told.push(format!("+{name}"));
            }
        }
        let input = Input {
            frame: &self.frame,
            detection: Some((&*self.detection, &**detected)),
        };
        self.identifier
            .step(Entry::Frame(input), &mut self.diagnosis, drawn);
        self.diagnosis.header.t_capture_ns = self.frame.header.t_capture_ns;
        self.detection.header.t_capture_ns = self.frame.header.t_capture_ns;
        self.decide();
    }

    fn decide(&mut self) {
        let inputs = Inputs {
            diagnosis: Some(&self.diagnosis),
            detection: Some(&self.detection),
        };
        let action = self.action.get_or_insert_default();
        let before = action.decision_seq;
        self.supervisor.step(Entry::Frame(inputs), action);
        action.valid_until_ns = u64::MAX;
        if action.decision_seq != before {
            let kind = RecoveryKind::from_repr(action.kind).unwrap();
            let name = Self::name(kind);
            self.told.push(name);
        }
    }

    fn name(kind: RecoveryKind) -> String {
        let names = [
            (RecoveryKind::GoOn, "FP"),
            (RecoveryKind::SlowDown, "SL"),
            (RecoveryKind::Compensate, "CP"),
            (RecoveryKind::IgnoreEncoder, "IG"),
            (RecoveryKind::NewPath, "NP"),
            (RecoveryKind::Relocalise, "RL"),
            (RecoveryKind::GoThrough, "GO"),
            (RecoveryKind::MoveAway, "MA"),
            (RecoveryKind::CallForHelp, "SH"),
            (RecoveryKind::GiveUp, "GU"),
        ];
        let found = names.iter().find(|(of, _)| *of == kind);
        found.map_or("?", |(_, name)| name).to_owned()
    }

    /// All of this happened, and nobody was called.
    fn demand(&self, happened: &[&str]) {
        let is = |what: &str| self.told.iter().any(|told| told == what);
        assert!(happened.iter().all(|what| is(what)), "{:?}", self.told);
        assert!(!is("SH"), "{:?}", self.told);
    }

    fn drive(&mut self, seconds: f64) {
        (0..(seconds * 1e9 / PERIOD_NS as f64) as u32).for_each(|_| self.step());
    }
}

#[test]
fn an_obstacle_is_gone_round() {
    // The paper's first story, by its model.
    let mut corridor = Corridor::new(setup("corridor-obstacle.toml", by_the_papers_model));
    corridor.drive(40.0);
    let expected = [
        "FP",
        "+EPM",
        "GO",
        "+EPS",
        "GO failed",
        "NP",
        "NP done",
        "FP",
        "goal",
    ];
    assert_eq!(corridor.told, expected);
    let mut shipped = Corridor::new(setup("corridor-obstacle.toml", |_| {}));
    shipped.drive(60.0);
    shipped.demand(&["NP done", "goal"]);
}

#[test]
fn people_are_waited_for_and_passed() {
    // The paper's second story, by its model.
    let mut corridor = Corridor::new(setup("corridor-people.toml", by_the_papers_model));
    corridor.drive(40.0);
    corridor.told.retain(|what| !what.starts_with('+'));
    assert_eq!(corridor.told, ["FP", "GO", "GO done", "FP", "goal"]);
    let mut shipped = Corridor::new(setup("corridor-people.toml", |_| {}));
    shipped.drive(60.0);
    shipped.demand(&["goal"]);
}

/// The people's corridor without people, and with this trouble.
fn troubled(kind: TroubleKind, at_s: f64, place: [f64; 3]) -> Corridor {
    Corridor::new(setup("corridor-people.toml", |file| {
        let navigation = file.navigation.as_mut().unwrap();
        navigation.obstacle.clear();
        if kind == TroubleKind::WrongHeading {
            navigation.walls.clear();
        }
        navigation.trouble.push(Trouble {
            kind,
            at_s,
            x_m: place[0],
            y_m: place[1],
            yaw_rad: place[2],
        });
    }))
}

#[test]
fn a_phantom_is_gone_through() {
    let mut corridor = troubled(TroubleKind::Phantom, 0.0, [4.5, 0.0, 0.0]);
    corridor.drive(60.0);
    corridor.demand(&["GO done", "goal"]);
}

#[test]
fn a_mislocalised_robot_finds_its_place() {
    for place in [[0.3, 0.9, 0.4], [0.2, -0.3, -0.15], [1.2, 0.0, 0.0]] {
        let mut corridor = troubled(TroubleKind::Mislocalised, 5.0, place);
        corridor.drive(60.0);
        let told = &corridor.told;
        let ends = ["RL", "RL done", "FP", "goal"];
        assert!(
            told.ends_with(&ends.map(str::to_owned)),
            "{place:?}: {told:?}"
        );
        assert_eq!(
            told.iter().filter(|what| *what == "RL").count(),
            1,
            "{told:?}"
        );
        assert!(!told.contains(&"SH".to_owned()), "{told:?}");
    }
}

#[test]
fn without_a_state_for_it_a_lost_robot_is_taken_for_a_broken_one() {
    let place = [0.3, 0.9, 0.4];
    let mut corridor = troubled(TroubleKind::Mislocalised, 5.0, place);
    corridor.setup.file.supervisor.lost_state = None;
    corridor.supervisor = vigil_supervisor::assemble(&corridor.setup).unwrap();
    corridor.drive(80.0);
    let told = &corridor.told;
    let ends = ["SH done", "FP", "goal"].map(str::to_owned);
    assert!(told.ends_with(&ends), "{told:?}");
}

#[test]
fn a_wrong_heading_is_corrected() {
    for yaw_rad in [1.8, 0.8, -0.8] {
        let mut corridor = troubled(TroubleKind::WrongHeading, 5.0, [0.0, 0.0, yaw_rad]);
        corridor.drive(80.0);
        corridor.demand(&["goal"]);
    }
}

#[test]
fn a_tether_that_nobody_has_modelled_stops_the_robot() {
    let mut corridor = Corridor::new(setup("corridor-people.toml", |file| {
        file.navigation.as_mut().unwrap().obstacle.clear();
    }));
    // Three seconds after the start the noise is hardly known yet, and it relocates once first.
    corridor.drive(6.0);
    let change = Injection::parse_change("tether:60", &corridor.setup.robot).unwrap();
    corridor.simulation.change(change).unwrap();
    corridor.drive(60.0);
    // Held fast while all wheels turn is no lost place: somebody must help.
    let expected = ["FP", "SL", "SH", "SH done", "FP", "goal"];
    assert_eq!(corridor.told, expected);
}

#[test]
fn a_blind_robot_touches_and_is_helped() {
    let mut corridor = Corridor::new(setup("corridor-people.toml", |file| {
        let navigation = file.navigation.as_mut().unwrap();
        for obstacle in &mut navigation.obstacle {
            obstacle.until_s = None;
        }
        navigation.trouble.push(Trouble {
            kind: TroubleKind::Blind,
            at_s: 1.0,
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
        });
    }));
    corridor.drive(160.0);
    let told = &corridor.told;
    assert!(
        told.ends_with(&["SH done", "FP", "goal"].map(str::to_owned)),
        "{told:?}"
    );
    // No way leads round: the question is not repeated at once.
    let asked = ["NP", "NP failed", "NP"].map(str::to_owned);
    let first = told.iter().position(|what| *what == asked[0]).unwrap();
    assert_ne!(told.get(first..first + 3), Some(&asked[..]), "{told:?}");
}

/// The people's corridor with this fault from the fifth second on, and without people unless they
/// are wanted.
fn broken(fault: &str, people: bool) -> Corridor {
    let mut corridor = Corridor::new(setup("corridor-people.toml", |file| {
        if !people {
            file.navigation.as_mut().unwrap().obstacle.clear();
        }
    }));
    corridor.drive(5.0);
    let change = Injection::parse_change(fault, &corridor.setup.robot).unwrap();
    corridor.simulation.change(change).unwrap();
    corridor.drive(60.0);
    corridor
}

#[test]
fn a_stuck_wheel_is_compensated_on_the_way_and_through_an_opening() {
    // A look before that, at half the speed, is no matter.
    let told = |people| {
        let mut told = broken("stuck:RM", people).told;
        told.retain(|what| what != "SL");
        told
    };
    assert_eq!(told(false), ["FP", "CP", "goal"]);
    let passed = told(true);
    let is = |what: &str| passed.iter().any(|of| of == what);
    assert!(is("goal") && is("+EPM") && !is("SH"), "{passed:?}");
    // From the first counter-steering on it follows the path by nothing else.
    let first = passed.iter().position(|what| what == "CP").unwrap();
    let goal = passed.iter().position(|what| what == "goal").unwrap();
    let plain = passed[first..goal].iter().any(|what| what == "FP");
    assert!(!plain, "{passed:?}");
}

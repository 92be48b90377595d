//! The event simulator: random numbers in pairs, missions, statistics.

use vigil_missions::simulation::{
    Act, Agent, Episode, Escalation, EscalationError, PairedDifference, PolicyAgent, Random, Rules,
    Summary, World, horizon, run,
};
use vigil_pomdp::policy::{Control, Dual, PolicyName};
use vigil_pomdp::{Pomdp, mdp};

const WEAR: &str = "
discount: 0.9 values: reward states: good worn
actions: use mend observations: fine rattle
start: 0.75 0.25
T: use : good 0.8 0.2
T: use : worn 0 1
T: mend : * 1 0
O: * : good 0.9 0.1
O: * : worn 0.3 0.7
R: use : good : * : * 2
R: use : worn : * : * -1
R: mend : * : * : * -3
";

fn model() -> Pomdp {
    Pomdp::parse(WEAR).unwrap()
}

fn endless(steps_max: usize) -> Rules {
    Rules {
        steps_max,
        is_end: vec![false; 2],
    }
}

/// Takes the actions of a list, again and again, and writes down what comes.
struct Scripted {
    actions: Vec<usize>,
    heard: Vec<usize>,
    chances: Vec<f64>,
}

impl Scripted {
    fn new(actions: &[usize]) -> Self {
        Self {
            actions: actions.to_vec(),
            heard: Vec::new(),
            chances: Vec::new(),
        }
    }
}

impl Agent for Scripted {
    fn begin(&mut self) {
        self.heard.clear();
        self.chances.clear();
    }

    fn decide(&mut self, chance: f64) -> Act {
        self.chances.push(chance);
        Act {
            action: self.actions[self.heard.len() % self.actions.len()],
            control: Control::Policy,
        }
    }

    fn notice(&mut self, _action: usize, observation: usize) -> bool {
        self.heard.push(observation);
        true
    }
}

#[test]
fn events_come_as_often_as_the_model_says() {
    let model = model();
    let (mut worn, mut wears, mut used, mut rattles) = (0.0, 0.0, 0.0, 0.0);
    let episodes = 40_000;
    for episode in 0..episodes {
        let mut world = World::new(
            &model,
            Episode {
                seed: 3,
                number: episode,
            },
        );
        let before = world.state();
        worn += before as f64;
        let event = world.step(0);
        assert_eq!(event.reward, [2.0, -1.0][before]);
        if before == 0 {
            used += 1.0;
            wears += world.state() as f64;
        } else {
            assert_eq!(world.state(), 1);
            rattles += event.observation as f64;
        }
    }
    // Within five standard deviations.
    let near = |share: f64, n: f64, p: f64| (share - p).abs() < 5.0 * (p * (1.0 - p) / n).sqrt();
    let n = episodes as f64;
    assert!(near(worn / n, n, 0.25), "{}", worn / n);
    assert!(near(wears / used, used, 0.2), "{}", wears / used);
    assert!(near(rattles / worn, worn, 0.7), "{}", rattles / worn);
}

#[test]
fn the_same_step_of_the_same_mission_takes_the_same_numbers_whoever_acts() {
    let model = model();
    let numbers = |actions: &[usize], episode| {
        let mut agent = Scripted::new(actions);
        run(
            &model,
            &mut agent,
            &endless(50),
            Episode {
                seed: 9,
                number: episode,
            },
        );
        (agent.chances, agent.heard)
    };
    let (chances, heard) = numbers(&[0], 5);
    assert_eq!(numbers(&[1], 5).0, chances, "whatever it does");
    assert_eq!(numbers(&[0], 5), (chances.clone(), heard));
    assert_ne!(numbers(&[0], 6).0, chances);
    // From the second step on both mend: the worlds have become one.
    let late = |first: usize| {
        let actions: Vec<usize> = std::iter::once(first).chain([1; 49]).collect();
        numbers(&actions, 5).1[1..].to_vec()
    };
    assert_eq!(late(0), late(1));
}

#[test]
fn rewards_agree_with_the_exact_value_of_a_fixed_policy() {
    let model = model();
    let rules = endless(horizon(model.discount(), 1000));
    assert_eq!(rules.steps_max, 88);
    let mut mission = |episode| {
        run(
            &model,
            &mut Scripted::new(&[0]),
            &rules,
            Episode {
                seed: 1,
                number: episode,
            },
        )
    };
    let missions: Vec<_> = (0..20_000).map(&mut mission).collect();
    let summary = Summary::new(&mut missions.iter().map(|m| m.discounted).collect::<Vec<_>>());
    // Never mended: V(worn) = -1/(1 - 0.9), V(good) = (2 + 0.9 0.2 V(worn)) / (1 - 0.9 0.8).
    let worn = -10.0;
    let good = (2.0 + 0.9 * 0.2 * worn) / (1.0 - 0.9 * 0.8);
    let exact = 0.75 * good + 0.25 * worn;
    let sigmas = (summary.mean - exact) / (summary.half_width / 1.96);
    assert!(sigmas.abs() < 4.0, "{summary:?}, {exact}");
    assert!(summary.worst_5_percent <= summary.median && summary.median <= good * 2.0);
    assert!(
        missions
            .iter()
            .all(|m| m.steps == 88 && !m.is_ended && m.dual_steps == 0)
    );
    let certain = missions.iter().find(|m| m.undiscounted == -88.0).unwrap();
    assert!((certain.discounted - worn * (1.0 - 0.9_f64.powi(88))).abs() < 1e-12);
}

#[test]
fn an_ending_action_is_paid_for_and_is_the_last() {
    let model = model();
    let rules = Rules {
        steps_max: 30,
        is_end: vec![false, true],
    };
    let mut agent = Scripted::new(&[0, 0, 1]);
    let mission = run(&model, &mut agent, &rules, Episode { seed: 1, number: 1 });
    assert!(mission.is_ended && mission.steps == 3);
    assert_eq!(agent.heard.len(), 2, "nothing is observed after the end");
    let mut random = Random::new(2);
    let shares = (0..2000)
        .map(|e| run(&model, &mut random, &rules, Episode { seed: 1, number: e }).steps as f64);
    let mean = Summary::new(&mut shares.collect::<Vec<_>>()).mean;
    assert!((mean - 2.0).abs() < 0.2, "half of all steps end it: {mean}");
}

#[test]
fn the_horizon_is_where_rewards_have_lost_their_weight() {
    assert_eq!(horizon(0.95, 1000), 180);
    assert!(0.95_f64.powi(180) < 1e-4 && 0.95_f64.powi(179) >= 1e-4);
    assert_eq!(horizon(0.99999, 2000), 2000);
    assert_eq!((horizon(1.0, 50), horizon(0.0, 50)), (50, 1));
}

#[test]
fn an_escalation_climbs_while_something_fires() {
    let model = model();
    let mut agent = Escalation::new(&model, "use", &["mend", "use", "mend"], &["fine"], 2).unwrap();
    agent.begin();
    let mut did = |heard: &[usize]| -> Vec<usize> {
        let mut did = Vec::new();
        for &observation in heard {
            let action = agent.decide(0.0).action;
            assert!(agent.notice(action, observation));
            did.push(action);
        }
        did
    };
    // Two rattles to a rung; the last rung again and again; silence begins anew.
    let (fine, rattle) = (0, 1);
    assert_eq!(did(&[rattle; 9]), [0, 0, 1, 0, 0, 0, 1, 0, 1]);
    assert_eq!(
        did(&[fine, rattle, fine, rattle, rattle, fine, fine])[1..],
        [0, 0, 0, 0, 1, 0]
    );
    let refused = |usual, ladder: &[&str], quiet: &[&str], patience| {
        Escalation::new(&model, usual, ladder, quiet, patience).unwrap_err()
    };
    assert_eq!(
        refused("go", &["mend"], &[], 1),
        EscalationError::Action("go".into())
    );
    assert_eq!(
        refused("use", &["go"], &[], 1),
        EscalationError::Action("go".into())
    );
    assert_eq!(
        refused("use", &["mend"], &["x"], 1),
        EscalationError::Observation("x".into())
    );
    assert_eq!(refused("use", &[], &[], 1), EscalationError::Empty);
    assert_eq!(refused("use", &["mend"], &[], 0), EscalationError::Empty);
}

#[test]
fn what_the_believed_model_rules_out_is_counted_and_survived() {
    let world = model();
    // Believes that rattling is certain when worn, and silence when good.
    let sure = WEAR
        .replace("good 0.9 0.1", "good 1 0")
        .replace("worn 0.3 0.7", "worn 0 1");
    let sure = Pomdp::parse(&sure.replace("T: use : good 0.8 0.2", "T: use : good 1 0")).unwrap();
    let solution = mdp::solve(&sure).unwrap();
    let name: PolicyName = "qmdp".parse().unwrap();
    let decider = name.build(&sure, &solution, |i| Dual::new(i, 0.5)).unwrap();
    let mut agent = PolicyAgent::new(&sure, decider);
    let missions: Vec<_> = (0..200)
        .map(|e| {
            run(
                &world,
                &mut agent,
                &endless(60),
                Episode { seed: 2, number: e },
            )
        })
        .collect();
    assert!(missions.iter().map(|m| m.impossible).sum::<usize>() > 1000);
    assert!(
        missions
            .iter()
            .all(|m| m.steps == 60 && m.discounted.is_finite())
    );
    let sum: f64 = agent.belief().iter().sum();
    assert!((sum - 1.0).abs() < 1e-12);
}

#[test]
fn summaries_and_paired_tests_agree_with_printed_tables() {
    let mut values = [4.0, 1.0, 3.0, 2.0, 5.0];
    let summary = Summary::new(&mut values);
    assert_eq!(
        (summary.mean, summary.median, summary.worst_5_percent),
        (3.0, 3.0, 1.0)
    );
    // t(4, 0.975) = 2.776445, standard deviation sqrt(2.5).
    assert!((summary.half_width - 2.776_445 * (2.5_f64 / 5.0).sqrt()).abs() < 1e-5);
    let mut forty: Vec<f64> = (0..40).map(f64::from).collect();
    let summary = Summary::new(&mut forty);
    assert_eq!((summary.median, summary.worst_5_percent), (19.5, 1.0));
    // Sleep data of Student (1908), ten patients, two drugs: t = 4.0621, p = 0.002833.
    let first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0];
    let second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
    let paired = PairedDifference::new(&second, &first);
    assert!((paired.difference - 1.58).abs() < 1e-12);
    assert!((paired.p - 0.002_833).abs() < 1e-6, "{}", paired.p);
    assert!(
        (paired.half_width - 0.8799).abs() < 1e-4,
        "{}",
        paired.half_width
    );
    let same = PairedDifference::new(&first, &first);
    assert_eq!((same.difference, same.p), (0.0, 1.0));
    let shifted = PairedDifference::new(&[1.0, 2.0, 3.0], &[0.0, 1.0, 2.0]);
    assert_eq!((shifted.difference, shifted.p), (1.0, 0.0));
    assert!(Summary::new(&mut []).mean.is_nan());
}

//! Models in code are the models of their files.

use vigil_pomdp::{Pomdp, Process, ProcessError};

use crate::public::TIGER;

/// A model read, asked for its own numbers, with something changed.
struct Copied<'a> {
    model: &'a Pomdp,
    change: Change,
}

#[derive(Clone, Copy, PartialEq)]
enum Change {
    Nothing,
    Split,
    Discount,
    Name(&'static str),
    Start(f64),
    State(usize),
    Negative,
    Reward,
    NoObservations,
}

impl Process for Copied<'_> {
    fn discount(&self) -> f64 {
        match self.change {
            Change::Discount => f64::NAN,
            _ => self.model.discount(),
        }
    }

    fn states(&self) -> Vec<String> {
        self.model.states().to_vec()
    }

    fn actions(&self) -> Vec<String> {
        let mut names = self.model.actions().to_vec();
        if let Change::Name(name) = self.change {
            name.clone_into(&mut names[0]);
        }
        names
    }

    fn observations(&self) -> Vec<String> {
        match self.change {
            Change::NoObservations => Vec::new(),
            _ => self.model.observations().to_vec(),
        }
    }

    fn start(&self) -> Vec<(usize, f64)> {
        let mut start: Vec<(usize, f64)> = self.model.start().iter().copied().enumerate().collect();
        if let Change::Start(p) = self.change {
            start[0].1 = p;
        }
        start
    }

    fn transition(&self, state: usize, action: usize) -> Vec<(usize, f64)> {
        let row = self.model.successors(state, action);
        match self.change {
            Change::Split => row.iter().flat_map(|(to, p)| [(*to, p / 2.0); 2]).collect(),
            Change::State(to) => vec![(to, 1.0)],
            _ => row.to_vec(),
        }
    }

    fn observation(&self, action: usize, next: usize) -> Vec<(usize, f64)> {
        let of = |z| (z, self.model.likelihood(action, z)[next]);
        let mut row: Vec<(usize, f64)> = (0..self.model.observations().len()).map(of).collect();
        if self.change == Change::Negative {
            row[0].1 -= 1.5;
            row[1].1 += 1.5;
        }
        row
    }

    fn reward(&self, state: usize, action: usize) -> f64 {
        match self.change {
            Change::Reward => f64::INFINITY,
            _ => self.model.reward(state, action),
        }
    }
}

const MDP: &str = "discount: 0.9\nvalues: reward\nstates: a b\nactions: stay go\n\
    T: stay identity\nT: go\n0.25 0.75\n1 0\nR: go : a : * -1\n";

fn assert_same(found: &Pomdp, model: &Pomdp) {
    assert_eq!(found.states(), model.states());
    assert_eq!(found.start(), model.start());
    assert_eq!(found.is_mdp(), model.is_mdp());
    for a in 0..model.actions().len() {
        for s in 0..model.states().len() {
            assert_eq!(found.successors(s, a), model.successors(s, a));
            // What a file says of outcomes is summed, here it is given.
            let (one, other) = (found.reward(s, a), model.reward(s, a));
            assert!((one - other).abs() <= 1e-12 * other.abs(), "{one} {other}");
        }
        for z in 0..model.observations().len() {
            assert_eq!(found.likelihood(a, z), model.likelihood(a, z));
        }
    }
}

#[test]
fn a_model_in_code_is_that_of_its_file() {
    let shipped = include_str!("../models/rover.pomdp");
    for text in [TIGER, MDP, shipped] {
        let model = Pomdp::parse(text).unwrap();
        for change in [Change::Nothing, Change::Split] {
            let copied = Copied {
                model: &model,
                change,
            };
            let found = Pomdp::from_process(&copied).unwrap();
            assert_same(&found, &model);
        }
    }
}

#[test]
fn a_process_without_observations_is_an_mdp() {
    let model = Pomdp::parse(MDP).unwrap();
    let copied = Copied {
        model: &model,
        change: Change::NoObservations,
    };
    let found = Pomdp::from_process(&copied).unwrap();
    assert!(found.is_mdp());
    assert_same(&found, &model);
}

#[test]
fn a_process_that_is_no_model_is_refused_with_the_row() {
    let model = Pomdp::parse(TIGER).unwrap();
    let refused = |change| {
        let copied = Copied {
            model: &model,
            change,
        };
        Pomdp::from_process(&copied).unwrap_err()
    };
    assert!(matches!(
        refused(Change::Discount),
        ProcessError::Discount(_)
    ));
    for (change, wanted) in [
        (
            Change::Name("open-left"),
            "actions: 'open-left' appears twice",
        ),
        (Change::Name("7up"), "actions: '7up', allowed is a letter"),
        (
            Change::Name("uniform"),
            "actions: 'uniform', allowed is a letter",
        ),
        (Change::Start(0.25), "the start: sums to 0.75, not to 1"),
        (Change::Start(f64::NAN), "the start: NaN is no probability"),
        (Change::State(2), "T of listen in "),
        (Change::Negative, "Z of listen in "),
        (Change::Reward, "R("),
    ] {
        let message = refused(change).to_string();
        assert!(message.starts_with(wanted), "{message}");
    }
}

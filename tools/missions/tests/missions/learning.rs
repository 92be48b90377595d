//! Learning from recorded missions: against enumeration, and what must hold for any data.

use proptest::prelude::*;
use vigil_missions::learning::{
    Iteration, LearnError, LearnedModel, LearnedRow, Record, RecordError, Settings, Table, learn,
};
use vigil_pomdp::Pomdp;

use crate::recorded::missions;

/// Three states, one of them never seen by mistake; wear cannot be undone by use.
const WEAR: &str = include_str!("recorded/wear.pomdp");

fn model() -> Pomdp {
    Pomdp::parse(WEAR).unwrap()
}

fn settings(prior_strength: f64, iterations_max: usize) -> Settings {
    Settings {
        prior_strength,
        iterations_max,
        rise_min: 0.0,
        ..Settings::default()
    }
}

fn learned(prior: &Pomdp, records: &[Record], settings: &Settings) -> LearnedModel {
    learn(prior, records, settings, &mut |_| ()).unwrap()
}

/// [start, T by action and state, Z by action and state] with all columns, dense.
struct Counts {
    start: Vec<f64>,
    transition: Vec<Vec<Vec<f64>>>,
    observation: Vec<Vec<Vec<f64>>>,
}

/// Expected counts and log-likelihood by going through every path of states.
fn enumerated(model: &Pomdp, record: &Record) -> (Counts, f64) {
    let (n, k) = (model.states().len(), model.observations().len());
    let actions = model.actions().len();
    let mut counts = Counts {
        start: vec![0.0; n],
        transition: vec![vec![vec![0.0; n]; n]; actions],
        observation: vec![vec![vec![0.0; k]; n]; actions],
    };
    let steps = record.actions.len();
    let mut total = 0.0;
    for pass in 0..2 {
        for path in 0..n.pow(steps as u32 + 1) {
            let state = |t: usize| path / n.pow(t as u32) % n;
            let is_told = |t: usize| record.labels.get(t).copied().flatten();
            if (0..=steps).any(|t| is_told(t).is_some_and(|label| label as usize != state(t))) {
                continue;
            }
            let mut p = model.start()[state(0)];
            for t in 0..steps {
                let (a, z) = (record.actions[t] as usize, record.observations[t] as usize);
                let row = model.successors(state(t), a).iter();
                let to: f64 = row.filter(|e| e.0 == state(t + 1)).map(|e| e.1).sum();
                p *= to * model.likelihood(a, z)[state(t + 1)];
            }
            if pass == 0 {
                total += p;
                continue;
            }
            counts.start[state(0)] += p / total;
            for t in 0..steps {
                let (a, z) = (record.actions[t] as usize, record.observations[t] as usize);
                counts.transition[a][state(t)][state(t + 1)] += p / total;
                counts.observation[a][state(t + 1)][z] += p / total;
            }
        }
    }
    (counts, total.ln())
}

fn dense(row: &LearnedRow, size: usize, of: fn(f64, &LearnedRow) -> f64) -> Vec<f64> {
    let mut dense = vec![0.0; size];
    for entry in &row.entries {
        dense[entry.column] = of(entry.learned, row);
    }
    dense
}

#[test]
fn one_iteration_is_that_of_an_enumeration_of_all_paths() {
    let model = model();
    let strength = 3.0;
    for (labelled, forget) in [(false, 0), (true, 2)] {
        let mut records = missions(&model, 4, 6, 4, labelled);
        for label in records
            .iter_mut()
            .flat_map(|r| r.labels.iter_mut().step_by(2))
        {
            *label = if forget > 0 { None } else { *label };
        }
        let of: Vec<(Counts, f64)> = records.iter().map(|r| enumerated(&model, r)).collect();
        let found = learned(&model, &records, &settings(strength, 1));
        let likelihood: f64 = of.iter().map(|(_, l)| l).sum();
        assert!((found.iterations[0].log_likelihood - likelihood).abs() < 1e-10);
        let mut rows = 0;
        for row in found.rows() {
            let (a, s) = (row.row.action, row.row.state);
            let counts = |pick: &dyn Fn(&Counts) -> Vec<f64>| -> Vec<f64> {
                let each = of.iter().map(|(counts, _)| pick(counts));
                each.reduce(|a, b| a.iter().zip(b).map(|(a, b)| a + b).collect())
                    .unwrap()
            };
            let counts = match row.row.table {
                Table::Start => counts(&|c| c.start.clone()),
                Table::Transition => counts(&|c| c.transition[a][s].clone()),
                Table::Observation => counts(&|c| c.observation[a][s].clone()),
            };
            let sum: f64 = counts.iter().sum::<f64>() + strength;
            for entry in &row.entries {
                let expected = (counts[entry.column] + strength * entry.prior) / sum;
                assert!((entry.learned - expected).abs() < 1e-12, "{row:?}");
                rows += 1;
            }
            let learned: f64 = dense(&row, 3, |p, _| p).iter().sum();
            assert!((learned - 1.0).abs() < 1e-12);
        }
        assert_eq!(rows, 2 + 3 + 2 + 1 + 6 + 2 * 5 + 2 + 3);
    }
}

#[test]
fn with_all_states_told_frequencies_are_learned_and_count_in_full() {
    let model = model();
    let records = missions(&model, 9, 400, 30, true);
    let found = learned(&model, &records, &settings(0.0, 50));
    // No state is hidden: the second iteration changes nothing.
    assert!(found.iterations.len() <= 3);
    let mut used = [0.0; 3];
    let mut visits = 0.0;
    for record in &records {
        for (t, &action) in record.actions.iter().enumerate() {
            if action == 0 && record.labels[t] == Some(0) {
                used[record.labels[t + 1].unwrap() as usize] += 1.0;
                visits += 1.0;
            }
        }
    }
    let is_use_of_good = |row: &LearnedRow| {
        row.row.table == Table::Transition && (row.row.action, row.row.state) == (0, 0)
    };
    let row = found.rows().find(is_use_of_good).unwrap();
    assert!((row.visits - visits).abs() < 1e-6 && row.data_share() == 1.0);
    for entry in &row.entries {
        assert!((entry.learned - used[entry.column] / visits).abs() < 1e-12);
        let share = entry.effective_visits / visits;
        assert!((0.85..=1.0).contains(&share), "{share}");
        // The usual interval of a proportion.
        let p = entry.learned;
        let half = 1.96 * (p * (1.0 - p) / entry.effective_visits).sqrt();
        assert!((entry.interval[1] - entry.interval[0] - 2.0 * half).abs() < 0.05 * half);
    }
}

#[test]
fn a_hidden_model_is_found_and_its_numbers_lie_in_their_intervals() {
    let truth = model();
    let wrong = WEAR
        .replace("T: use : good 0.8 0.15 0.05", "T: use : good 0.6 0.3 0.1")
        .replace("O: * : worn 0.4 0.5 0.1", "O: * : worn 0.2 0.5 0.3");
    let prior = Pomdp::parse(&wrong).unwrap();
    let records = missions(&truth, 21, 1500, 30, false);
    let found = learned(&prior, &records, &settings(5.0, 300));
    let (mut inside, mut all) = (0, 0);
    for row in found.rows() {
        for entry in &row.entries {
            let true_p = row.row.p(&truth, entry.column);
            if entry.learned < 1.0 {
                assert!((entry.learned - true_p).abs() < 0.12, "{row:?} {true_p}");
                assert!(entry.effective_visits <= row.visits);
                let [low, high] = entry.interval;
                inside += usize::from((low..=high).contains(&true_p));
                all += 1;
            }
        }
    }
    // 26 of 28: as many as 95 % should hold, by chance.
    assert!(all > 20 && 20 * inside >= 17 * all, "{inside} of {all}");
}

#[test]
fn what_is_ruled_out_stays_so_and_what_is_not_visited_keeps_its_prior() {
    let model = model();
    let mut records = missions(&model, 2, 50, 20, false);
    records.retain_mut(|record| {
        // Nothing was ever mended.
        let until = record.actions.iter().position(|&action| action == 1);
        let until = until.unwrap_or(record.actions.len());
        record.actions.truncate(until);
        record.observations.truncate(until);
        record.rewards.truncate(until);
        until > 0
    });
    assert!(records.len() > 10);
    for strength in [0.0, 8.0] {
        let found = learned(&model, &records, &settings(strength, 30));
        assert_ne!(found.model, model);
        for s in 0..3 {
            for (left, right) in found
                .model
                .successors(s, 1)
                .iter()
                .zip(model.successors(s, 1))
            {
                assert!(left.0 == right.0 && (left.1 - right.1).abs() < 1e-15);
            }
            for z in 0..3 {
                let of = |m: &Pomdp| m.likelihood(1, z)[s];
                assert!((of(&found.model) - of(&model)).abs() < 1e-15);
                assert!(model.likelihood(0, z)[s] > 0.0 || found.model.likelihood(0, z)[s] == 0.0);
            }
            let to = |m: &Pomdp| m.successors(s, 0).iter().map(|e| e.0).collect::<Vec<_>>();
            assert!(to(&found.model).iter().all(|s| to(&model).contains(s)));
        }
        for row in found.rows().filter(|row| row.row.action == 1) {
            assert_eq!((row.visits, row.data_share()), (0.0, 0.0));
            assert!((row.prior - strength).abs() < 1e-12);
        }
        assert!(found.model.start()[2] == 0.0);
    }
}

#[test]
fn rare_faults_keep_their_pseudo_counts() {
    let text = WEAR.replace(
        "T: use : good 0.8 0.15 0.05",
        "T: use : good 0.8 0.1999999 1e-7",
    );
    let prior = Pomdp::parse(&text).unwrap();
    let never = WEAR.replace("T: use : good 0.8 0.15 0.05", "T: use : good 0.8 0.2 0");
    let records = missions(&Pomdp::parse(&never).unwrap(), 3, 100, 20, false);
    let found = learned(&prior, &records, &settings(50.0, 100));
    let row = found.model.successors(0, 0);
    let kept = row.iter().find(|e| e.0 == 2).unwrap().1;
    assert!((1e-9..1e-3).contains(&kept), "{kept}");
}

#[test]
fn of_several_starts_the_best_one_counts() {
    let model = model();
    let records = missions(&model, 5, 60, 20, false);
    let one = learned(&model, &records, &settings(1.0, 40));
    let four = Settings {
        starts: 4,
        ..settings(1.0, 40)
    };
    let several = learned(&model, &records, &four);
    let last = |of: &LearnedModel, start| {
        let mut own = of.iterations.iter().filter(|i| i.start == start);
        own.next_back().copied().unwrap().objective
    };
    assert_eq!(last(&one, 0), last(&several, 0));
    let best = (0..4).map(|s| last(&several, s)).fold(f64::MIN, f64::max);
    assert_eq!(last(&several, several.start), best);
    let firsts: Vec<f64> = several
        .iterations
        .iter()
        .filter(|i| i.iteration == 0)
        .map(|i| i.objective)
        .collect();
    assert!(firsts.windows(2).all(|two| two[0] != two[1]) && firsts.len() == 4);
    let again = learned(&model, &records, &four);
    assert_eq!(again.model, several.model);
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let model = model();
    let refusal = |records: &[Record], settings: &Settings| {
        learn(&model, records, settings, &mut |_| ()).unwrap_err()
    };
    let good = missions(&model, 1, 2, 5, true);
    assert_eq!(refusal(&[], &Settings::default()), LearnError::Empty);
    assert_eq!(
        refusal(&[Record::default()], &Settings::default()),
        LearnError::Empty
    );
    let strength = refusal(&good, &settings(-1.0, 5)).to_string();
    assert_eq!(strength, "prior strength -1: allowed is 0 or more");
    let mut wrong = good.clone();
    wrong[1].observations[3] = 7;
    let problem = RecordError::Index {
        step: 3,
        what: "observation",
        found: 7,
        count: 3,
    };
    let expected = LearnError::Record {
        mission: 1,
        problem,
    };
    assert_eq!(refusal(&wrong, &Settings::default()), expected);
    wrong[1].observations.pop();
    let message = refusal(&wrong, &Settings::default()).to_string();
    assert_eq!(
        message,
        "mission 1 (from 0): observations: 4 entries, allowed are 5 (5 actions)"
    );
    let mut impossible = good;
    // A robot that was mended does not break at once.
    impossible[1].labels = vec![None, Some(2), None, None, None, None];
    impossible[1].actions[0] = 1;
    let message = refusal(&impossible, &Settings::default()).to_string();
    assert!(message.starts_with("mission 1 (from 0): step 0 (from 0) has probability 0"));
}

fn row(size: usize) -> impl Strategy<Value = Vec<f64>> {
    // Zeros on purpose.
    let entry = prop_oneof![1 => Just(0.0), 4 => 0.02..1.0_f64];
    prop::collection::vec(entry, size)
        .prop_filter("a distribution", |row| row.iter().sum::<f64>() > 0.0)
        .prop_map(|row| {
            let sum: f64 = row.iter().sum();
            row.iter().map(|p| p / sum).collect()
        })
}

/// A model of 3 states, 2 actions, 3 observations.
fn any_model() -> impl Strategy<Value = Pomdp> {
    let tables = (row(3), prop::collection::vec(row(3), 12));
    tables.prop_map(|(start, rows)| {
        let numbers = |row: &Vec<f64>| {
            let words: Vec<String> = row.iter().map(f64::to_string).collect();
            words.join(" ")
        };
        let mut text =
            String::from("discount: 0.9 values: reward states: 3 actions: 2 observations: 3\n");
        text += &format!("start: {}\n", numbers(&start));
        for (index, row) in rows.iter().enumerate() {
            let table = if index < 6 { "T" } else { "O" };
            let (action, state) = (index / 3 % 2, index % 3);
            text += &format!("{table}: {action} : {state} {}\n", numbers(row));
        }
        Pomdp::parse(&text).unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn the_model_is_as_likely_as_the_last_iteration_whenever_that_comes(
        truth in any_model(), prior in any_model(), seed in 0_u64..1000,
    ) {
        let mut records = missions(&truth, seed, 10, 20, false);
        // What the prior rules out.
        let once = settings(0.0, 1);
        let one = |r: &Record| learn(&prior, std::slice::from_ref(r), &once, &mut |_| ());
        records.retain(|record| one(record).is_ok());
        for iterations in 1..12 {
            if records.is_empty() {
                break;
            }
            let found = learned(&prior, &records, &settings(0.0, iterations));
            let again = learned(&found.model, &records, &once);
            let last = found.iterations.last().unwrap().log_likelihood;
            let model = again.iterations[0].log_likelihood;
            let least = last - 1e-9 * last.abs().max(1.0);
            prop_assert!(model >= least, "{iterations}: {last} {model}");
        }
    }

    #[test]
    fn the_objective_never_falls_nor_the_likelihood_without_prior(
        model in any_model(), seed in 0_u64..1000, steps in 1_usize..25,
        strength in prop_oneof![Just(0.0), 0.1..40.0_f64], labelled: bool,
    ) {
        let mut records = missions(&model, seed, 8, steps, labelled);
        records.iter_mut().for_each(|record| {
            record.labels.iter_mut().skip(1).step_by(3).for_each(|label| *label = None);
        });
        let mut seen: Vec<Iteration> = Vec::new();
        let found = learn(&model, &records, &settings(strength, 25), &mut |i| seen.push(i));
        let found = found.unwrap();
        prop_assert_eq!(&seen, &found.iterations);
        prop_assert!(!seen.is_empty());
        for two in seen.windows(2) {
            let slack = 1e-10 * two[0].objective.abs().max(1.0);
            prop_assert!(two[1].objective >= two[0].objective - slack, "{:?}", two);
            if strength == 0.0 {
                prop_assert!(two[1].log_likelihood >= two[0].log_likelihood - slack);
            }
        }
        // The model is one: it reads back.
        prop_assert_eq!(Pomdp::parse(&found.model.to_cassandra()).unwrap(), found.model);
    }
}

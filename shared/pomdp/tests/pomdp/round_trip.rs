//! What is written reads back to the same model, bit by bit: public files and invented models.

use proptest::prelude::*;
use vigil_pomdp::Pomdp;

use crate::public;

/// Every number of two models, by bits.
fn assert_same(one: &Pomdp, other: &Pomdp) {
    let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
    assert_eq!(one, other);
    assert_eq!(one.hash(), other.hash());
    assert_eq!(one.discount().to_bits(), other.discount().to_bits());
    assert_eq!(bits(one.start()), bits(other.start()));
    let (n, k) = (one.states().len(), one.observations().len());
    for a in 0..one.actions().len() {
        for z in 0..k {
            assert_eq!(bits(one.likelihood(a, z)), bits(other.likelihood(a, z)));
        }
        for s in 0..n {
            let row = |model: &Pomdp| -> Vec<(usize, u64)> {
                let row = model.successors(s, a).iter();
                row.map(|(to, p)| (*to, p.to_bits())).collect()
            };
            assert_eq!(row(one), row(other));
            assert_eq!(one.reward(s, a).to_bits(), other.reward(s, a).to_bits());
            for outcome in 0..(n * k).min(100_000) {
                let r = |model: &Pomdp| model.reward_of(s, a, outcome / k, outcome % k).to_bits();
                assert_eq!(r(one), r(other));
            }
        }
    }
}

#[test]
fn public_files_survive_reading_and_writing() {
    let Some(folder) = public::folder() else {
        return;
    };
    let mut files = 0;
    for (_, model) in public::all(&folder) {
        let text = model.to_cassandra();
        assert_same(&model, &Pomdp::parse(&text).unwrap());
        // What was written once is written the same again.
        assert_eq!(text, Pomdp::parse(&text).unwrap().to_cassandra());
        files += 1;
    }
    assert!(files >= 16, "{files} files");
}

/// A row of weights as probabilities, some of them 0, one of them tiny.
fn row(weights: &[u32]) -> Vec<f64> {
    let mut row: Vec<f64> = weights.iter().map(|w| f64::from(w % 7)).collect();
    row[0] += 1e-12;
    let sum: f64 = row.iter().sum();
    row.iter().map(|w| w / sum).collect()
}

fn numbers(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
    words.join(" ")
}

/// Sizes of a model, and enough numbers to fill it.
type Drawn = (usize, usize, usize, Vec<u32>, Vec<i32>, [bool; 3]);

fn drawn() -> impl Strategy<Value = Drawn> {
    let numbers = prop::collection::vec(any::<u32>(), 64);
    let rewards = prop::collection::vec(-3..4, 64);
    (
        1..5_usize,
        1..4_usize,
        1..4_usize,
        numbers,
        rewards,
        any::<[bool; 3]>(),
    )
}

/// A text in all forms of the grammar.
fn text((n, actions, k, weights, rewards, [is_cost, is_mdp, is_named]): &Drawn) -> String {
    let (n, actions, k) = (*n, *actions, if *is_mdp { 1 } else { *k });
    let weight = |at: usize, width: usize| -> Vec<f64> {
        let of: Vec<u32> = (at..at + width).map(|i| weights[i * 7 % 64]).collect();
        row(&of)
    };
    let reward = |at: usize| 0.1 * f64::from(rewards[at % 64]);
    let values = if *is_cost { "cost" } else { "reward" };
    let mut text = format!("discount: 0.9\nvalues: {values}\nactions: {actions}\n");
    let list: Vec<String> = (0..n).map(|i| format!("s-{i}")).collect();
    let states = if *is_named {
        list.join(" ")
    } else {
        n.to_string()
    };
    text += &format!("states: {states}\n");
    if !is_mdp {
        text += &format!("observations: {k}\n");
    }
    text += &format!(
        "start: {}\n",
        if n > 1 {
            numbers(&weight(3, n))
        } else {
            "uniform".into()
        }
    );
    for a in 0..actions {
        match weights[a] % 4 {
            0 => text += &format!("T: {a} identity\n"),
            1 => text += &format!("T: {a} uniform\n"),
            _ => {
                for s in 0..n {
                    text += &format!("T: {a} : {s} {}\n", numbers(&weight(a * 5 + s, n)));
                }
            }
        }
        if weights[a + 8] % 3 == 0 {
            text += &format!("T: {a} : 0 reset\n");
        }
        for s in (0..n).filter(|_| !is_mdp) {
            text += &format!("O: {a} : {s} {}\n", numbers(&weight(a * 3 + s, k)));
        }
        for s in 0..n {
            let at = a * 17 + s * 5;
            match rewards[at % 64] {
                -3 => text += &format!("R: {a} : {s} : * : * {}\n", reward(at + 1)),
                -2 => text += &format!("R: {a} : * : {s} : * {}\n", reward(at + 2)),
                -1 => text += &format!("R: * : {s} : * : 0 {}\n", reward(at + 3)),
                0 => {
                    let row: Vec<f64> = (0..k).map(|z| reward(at + z)).collect();
                    text += &format!("R: {a} : {s} : * {}\n", numbers(&row));
                }
                1 => {
                    let matrix: Vec<f64> = (0..n * k).map(|i| reward(at + i)).collect();
                    text += &format!("R: {a} : {s} {}\n", numbers(&matrix));
                }
                _ => text += &format!("R: {a} : {s} : 0 : * {}\n", reward(at + 4)),
            }
        }
    }
    text
}

proptest! {
    #[test]
    fn invented_models_survive_reading_and_writing(drawn in drawn()) {
        let model = Pomdp::parse(&text(&drawn)).unwrap();
        let written = model.to_cassandra();
        assert_same(&model, &Pomdp::parse(&written).unwrap());
        prop_assert_eq!(&written, &Pomdp::parse(&written).unwrap().to_cassandra());
    }
}

#[test]
fn what_is_written_is_readable() {
    let text = "discount: 0.95 values: cost states: left right actions: listen open\n\
        observations: hear-left hear-right\nstart: left\nT: listen identity T: open uniform\n\
        O: listen 0.85 0.15 0.15 0.85 O: open uniform\n\
        R: listen : * : * : * 1 R: open : left : * : * 1e-12 R: open : * : * : hear-right -3";
    let written = Pomdp::parse(text).unwrap().to_cassandra();
    assert_eq!(
        written,
        "discount: 0.95\nvalues: cost\nstates: left right\nactions: listen open\n\
         observations: hear-left hear-right\n\nstart include: left\n\n\
         T: listen identity\nT: open uniform\n\n\
         O: listen : left : hear-left 0.85\nO: listen : left : hear-right 0.15\n\
         O: listen : right : hear-left 0.15\nO: listen : right : hear-right 0.85\n\
         O: open uniform\n\n\
         R: listen : * : * : * 1\nR: open : left : * : * -3\n\
         R: open : left : * : hear-left 1e-12\n\
         R: open : right : * : hear-right -3\n"
    );
}

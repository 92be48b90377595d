//! The tree's groups, splits and merges, and raised draws.

use super::*;
use crate::hybrid::Modes;

/// Nominal and three faults, of which 1 and 2 look alike; nothing moves.
#[derive(Debug, Clone)]
struct Alike;

impl Modes for Alike {
    fn modes(&self) -> usize {
        4
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        match from {
            0 => [0.7, 0.1, 0.1, 0.1][to],
            _ => f64::from(u8::from(from == to)),
        }
    }
}

impl Sampled for Alike {
    type State = ();
    type Observation = [f64; 4];

    fn draw(&self, _mode: usize, _rng: &mut Pcg64Mcg) {}

    fn propagate(&self, _mode: usize, _state: &(), _rng: &mut Pcg64Mcg) {}

    fn log_likelihood(&self, mode: usize, _state: &(), z: &[f64; 4]) -> f64 {
        z[mode].ln()
    }
}

fn filter(nodes: &[Vec<usize>]) -> Hierarchical<Alike> {
    Hierarchical::new(Alike, nodes, Resampling::default(), 1000, 1).unwrap()
}

#[test]
#[should_panic(expected = "shares of a particle and weights of all each sum to one")]
fn shares_that_do_not_sum_to_one_are_caught() {
    let mut filter = filter(&[vec![1, 2]]);
    filter.shares.fill(0.3);
    filter.sum_modes();
}

#[test]
fn a_node_is_split_once_its_leaves_are_distinguished_and_merged_when_empty() {
    let mut filter = filter(&[vec![1, 2]]);
    let merged = |filter: &Hierarchical<Alike>| filter.nodes[0].merged;
    assert!(merged(&filter));
    filter.step(&[0.1, 1.0, 1.0, 0.1]);
    assert!(merged(&filter), "alike");
    for _ in 0..8 {
        filter.step(&[0.05, 1.0, 0.1, 0.05]);
    }
    assert!(!merged(&filter), "{:?}", filter.posterior());
    for _ in 0..12 {
        filter.step(&[1.0, 1e-3, 1e-3, 1e-3]);
    }
    assert!(merged(&filter), "{:?}", filter.posterior());
}

#[test]
fn a_mode_is_tracked_as_the_highest_merged_node_above_it() {
    let mut filter = filter(&[vec![1, 2], vec![2, 1, 3]]);
    assert_eq!([0, 1, 2, 3].map(|k| filter.group(k)), [0, 2, 2, 2]);
    filter.nodes[1].merged = false;
    assert_eq!([0, 1, 2, 3].map(|k| filter.group(k)), [0, 1, 1, 3]);
    filter.nodes[0].merged = false;
    assert_eq!([0, 1, 2, 3].map(|k| filter.group(k)), [0, 1, 2, 3]);
    let [below, top] = &filter.nodes[..] else {
        panic!("two nodes");
    };
    assert_eq!(
        (&below.nodes_below[..], &below.leaves_below[..]),
        (&[][..], &[1, 2][..])
    );
    assert_eq!(
        (&top.nodes_below[..], &top.leaves_below[..]),
        (&[0][..], &[3][..])
    );
}

#[test]
fn a_limit_holds_from_the_next_step_on() {
    let mut filter = filter(&[vec![1, 2]]);
    for (limit, count) in [(10, 10), (0, 1), (5000, 1000)] {
        filter.limit(limit);
        filter.step(&[1.0; 4]);
        assert_eq!(filter.particles().count(), count);
    }
}

#[test]
fn an_index_is_drawn_by_its_probability_and_never_an_impossible_one() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut counts = [0; 4];
    for _ in 0..10_000 {
        counts[draw(&[0.0, 0.2, 0.8, 0.0], &mut rng)] += 1;
    }
    assert_eq!((counts[0], counts[3]), (0, 0));
    assert!((1_800..2_200).contains(&counts[1]), "{counts:?}");
    assert_eq!(draw(&[0.0; 4], &mut rng), 0);
}

#[test]
fn raised_draws_leave_as_often_as_asked_and_are_paid_for() {
    let mut filter = filter(&[]).with_raised_proposals(0.6);
    filter.mass.copy_from_slice(&[0.7, 0.0, 0.1, 0.2]);
    let mut counts = [0; 4];
    for _ in 0..10_000 {
        counts[filter.propose(0)] += 1;
    }
    assert_eq!(filter.proposed, [0.4, 0.0, 0.3, 0.3]);
    assert_eq!(counts[1], 0);
    assert!((3_800..4_200).contains(&counts[0]), "{counts:?}");
    // A particle whose own mode has no mass must leave.
    filter.mass.copy_from_slice(&[0.0, 0.0, 0.1, 0.2]);
    filter.propose(0);
    assert_eq!(filter.proposed, [0.0, 0.0, 0.5, 0.5]);
    // One that can reach no other stays.
    filter.mass.copy_from_slice(&[0.7, 0.0, 0.0, 0.0]);
    assert_eq!(filter.propose(0), 0);
}

#[test]
fn a_split_moves_each_particle_to_one_leaf_by_its_shares() {
    let mut filter = filter(&[vec![1, 2]]);
    for row in filter.shares.chunks_exact_mut(4) {
        row.copy_from_slice(&[0.0, 0.75, 0.25, 0.0]);
    }
    filter.nodes[0].merged = false;
    filter.split(0);
    let rows = || filter.shares.chunks_exact(4);
    let first = rows().filter(|row| **row == [0.0, 1.0, 0.0, 0.0]).count();
    let second = rows().filter(|row| **row == [0.0, 0.0, 1.0, 0.0]).count();
    assert_eq!(first + second, 1000);
    assert!((700..800).contains(&first), "{first}");
}

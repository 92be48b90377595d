//! The graph of a policy.

use vigil_pomdp::policy::{Base, Decider};
use vigil_pomdp::policy_graph::{Limits, PolicyGraph};
use vigil_pomdp::{Pomdp, Tracker, mdp};

use crate::public::TIGER;

fn graph(nodes_max: usize) -> (Pomdp, PolicyGraph) {
    let model = Pomdp::parse(TIGER).unwrap();
    let solution = mdp::solve(&model).unwrap();
    let policy = Base::QMdp.build(&model, &solution);
    let mut decider = Decider::new(policy.unwrap(), &model, &solution);
    let limits = Limits {
        nodes_max,
        tolerance: 1e-9,
    };
    let graph = PolicyGraph::new(&model, &mut decider, limits);
    (model, graph)
}

#[test]
fn the_tiger_needs_five_nodes_and_returns_to_the_start() {
    let (model, graph) = graph(20);
    // Listen at one half; after one cry listen on; after two alike open the other door.
    let mut actions: Vec<usize> = graph.nodes.iter().map(|n| n.action).collect();
    actions.sort_unstable();
    assert_eq!(actions, [0, 0, 0, 1, 2]);
    assert_eq!(graph.folded_max(), 0.0);
    assert_eq!(graph.nodes[0].belief, [0.5, 0.5]);
    for node in 0..5 {
        let own = graph.edges.iter().filter(|e| e.from == node);
        let sum: f64 = own.map(|e| e.probability()).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
    for (index, node) in graph.nodes.iter().enumerate().filter(|(_, n)| n.action > 0) {
        let own: Vec<_> = graph.edges.iter().filter(|e| e.from == index).collect();
        assert!(own.len() == 1 && own[0].to == 0 && own[0].observations.len() == 2);
        let certain = node.belief.iter().copied().fold(0.0, f64::max);
        assert!((certain - 0.969_798_657_718).abs() < 1e-9);
    }
    // Along every edge the belief is the tracker's.
    let mut tracker = Tracker::new(&model);
    for edge in &graph.edges {
        for &(observation, _) in &edge.observations {
            let from = &graph.nodes[edge.from];
            tracker.anchor(&from.belief);
            tracker.update(&model, from.action, observation);
            let to = &graph.nodes[edge.to].belief;
            assert!(
                tracker
                    .belief()
                    .iter()
                    .zip(to)
                    .all(|(a, b)| (a - b).abs() < 1e-9)
            );
        }
    }
}

#[test]
fn with_too_few_nodes_edges_are_folded_and_say_so() {
    let (_, graph) = graph(3);
    assert_eq!(graph.nodes.len(), 3);
    assert!(graph.edges.iter().any(|e| e.is_folded) && graph.folded_max() > 0.5);
    for node in 0..3 {
        let own = graph.edges.iter().filter(|e| e.from == node);
        assert!((own.map(|e| e.probability()).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

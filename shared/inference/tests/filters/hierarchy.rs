//! The hierarchical filter's tree: which are refused, and when its nodes are split.

use std::path::PathBuf;

use crate::cases::{HiddenMarkov, Planar};
use rand::SeedableRng;
use vigil_inference::filter::Filter;
use vigil_inference::hierarchical::Hierarchical;
use vigil_inference::hybrid::Sampled;
use vigil_inference::resample::Resampling;

fn data() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/filters")
}

/// Thirteen modes.
fn model() -> HiddenMarkov {
    HiddenMarkov::read(&data().join("case1_hmm13.json")).unwrap()
}

#[test]
fn what_is_no_hierarchy_is_refused() {
    use vigil_inference::hierarchical::HierarchyError::{Mode, Node, Overlap};
    let build = |nodes: &[Vec<usize>]| {
        let resampling = Resampling::default();
        Hierarchical::new(model(), nodes, resampling, 10, 1)
            .map(|_| ())
            .unwrap_err()
    };
    assert_eq!(build(&[vec![0, 1]]), Node(0));
    assert_eq!(build(&[vec![1, 2], vec![3]]), Node(1));
    assert_eq!(build(&[vec![1, 13]]), Mode { node: 0, mode: 13 });
    assert_eq!(build(&[vec![1, 2, 3], vec![3, 4]]), Overlap(0, 1));
    assert_eq!(build(&[vec![1, 2], vec![2, 1]]), Overlap(0, 1));
}

/// Share of simulated faults whose leaf a hierarchical filter names by the pose alone, with the
/// nodes tracked as the rule says, always merged, always split.
#[test]
fn the_rule_is_about_as_good_as_the_best_fixed_resolution() {
    const RUNS: u64 = 60;
    let folder = data();
    let (planar, _) = Planar::read(&folder).unwrap();
    let model = planar.with_rates(1e-3, 0.01);
    let nodes = [vec![1, 2, 3], vec![4, 5, 6]];
    let right = |fixed: Option<bool>| {
        let named = |seed: u64| {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
            let fault = 1 + (seed % 6) as usize;
            let resampling = Resampling::default();
            let filter = Hierarchical::new(model.clone(), &nodes, resampling, 100, seed);
            let mut filter = filter.unwrap().with_raised_proposals(0.5);
            if let Some(merged) = fixed {
                filter = filter.with_fixed_resolution(merged);
            }
            let mut pose = model.draw(0, &mut rng);
            for t in 0..120 {
                let mode = if t < 20 { 0 } else { fault };
                pose = model.propagate(mode, &pose, &mut rng);
                filter.step(&model.measure(mode, &pose, false, &mut rng));
            }
            let p = filter.posterior();
            (0..p.len()).max_by(|&a, &b| p[a].total_cmp(&p[b])) == Some(fault)
        };
        (0..RUNS).filter(|&seed| named(seed)).count()
    };
    let (rule, merged, split) = (right(None), right(Some(true)), right(Some(false)));
    // Three runs are five points: what 60 runs can resolve.
    assert!(
        rule + 3 >= merged.max(split),
        "rule {rule}, merged {merged}, split {split}"
    );
    assert!(rule * 2 > RUNS as usize, "{rule} of {RUNS}");
}

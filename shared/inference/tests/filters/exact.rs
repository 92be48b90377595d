//! Every filter against the cases with exact answers (tests/data/filters).

use std::path::PathBuf;

use crate::cases::{HiddenMarkov, JumpLinear, Linear, PoseAndWheels};
use crate::oracles::Forward;
use crate::oracles::Sequences;
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use vigil_inference::adaptive::Adaptive;
use vigil_inference::bootstrap::ParticleFilter;
use vigil_inference::filter::Filter;
use vigil_inference::hierarchical::Hierarchical;
use vigil_inference::hybrid::{Conditional, Modes};
use vigil_inference::look_ahead::LookAhead;
use vigil_inference::merged::Merged;
use vigil_inference::proposal::Proposal;
use vigil_inference::resample::Resampling;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data/filters")
        .join(name)
}

fn hidden_markov() -> HiddenMarkov {
    HiddenMarkov::read(&path("case1_hmm13.json")).unwrap()
}

fn linear() -> Linear {
    Linear::read(&path("case2_lgss3.json")).unwrap()
}

fn jump_linear() -> JumpLinear {
    JumpLinear::read(&path("case3_jmls3_full.json")).unwrap()
}

/// `Σ |p - q|`.
fn distance(p: &[f64], q: &[f64]) -> f64 {
    assert_eq!(p.len(), q.len());
    p.iter().zip(q).map(|(p, q)| (p - q).abs()).sum()
}

/// Mean distance of a filter's beliefs from the exact ones, and its log-evidence.
fn run<F: Filter>(
    filter: &mut F,
    observations: impl Iterator<Item: std::borrow::Borrow<F::Observation>>,
    exact: &[impl AsRef<[f64]>],
) -> (f64, f64) {
    use std::borrow::Borrow;
    let (mut sum, mut log_evidence) = (0.0, 0.0);
    for (z, exact) in observations.zip(exact) {
        log_evidence += filter.step(z.borrow()).log_evidence;
        sum += distance(filter.posterior(), exact.as_ref());
    }
    (sum / exact.len() as f64, log_evidence)
}

/// Mean over seeds of the distance and of the error of the log-evidence.
fn mean_of(seeds: u64, exact: f64, mut run: impl FnMut(u64) -> (f64, f64)) -> (f64, f64) {
    let (mut distance, mut bias) = (0.0, 0.0);
    for seed in 0..seeds {
        let (d, log_evidence) = run(seed);
        (distance, bias) = (distance + d, bias + log_evidence - exact);
    }
    (distance / seeds as f64, bias / seeds as f64)
}

#[test]
fn thirteen_modes_are_filtered_exactly() {
    let case = hidden_markov();
    let (mut filter, mut sum) = (Forward::<13>::at(0), 0.0);
    for (t, z) in case.observations.iter().enumerate() {
        filter.predict(case.transitions());
        let log_l = std::array::from_fn(|mode| case.log_density(mode, z));
        sum += filter.update(&log_l).unwrap();
        let found = filter.log_p().map(f64::exp);
        assert!(distance(&found, &case.filter[t]) < 1e-9, "step {t}");
        assert!(
            (sum - case.log_evidence[t]).abs() < 1e-9 * (1.0 + sum.abs()),
            "step {t}"
        );
    }
    // Without a continuous state nothing is merged: this filter is exact too.
    let (found, log_evidence) = run(
        &mut Merged::<_, 0>::new(case.clone()).unwrap(),
        case.observations.iter(),
        &case.filter,
    );
    assert!(found < 1e-9 && (log_evidence - sum).abs() < 1e-9 * sum.abs());
}

#[test]
fn a_linear_gaussian_state_is_filtered_exactly() {
    let case = linear();
    let (mut state, mut sum) = (case.prior(0), 0.0);
    for (t, z) in case.observations.iter().enumerate() {
        case.predict(0, &mut state);
        sum += case.update(0, &mut state, z).unwrap();
        let covariance = Matrix3::from_fn(|i, j| case.covariance[t][i][j]);
        assert!(
            (state.mean - Vector3::from(case.mean[t])).abs().max() < 1e-9,
            "step {t}"
        );
        assert!(
            (state.covariance - covariance).abs().max() < 1e-9,
            "step {t}"
        );
        assert!(
            (sum - case.log_evidence[t]).abs() < 1e-9 * (1.0 + sum.abs()),
            "step {t}"
        );
    }
}

#[test]
fn all_sequences_of_modes_are_filtered_exactly() {
    let case = jump_linear();
    let mut filter = Sequences::<_, 3>::new(case.clone(), 177_147);
    let mut sum = 0.0;
    for (t, z) in case.observations().enumerate() {
        sum += filter.step(&z).log_evidence;
        assert!(
            distance(filter.posterior(), &case.filter[t]) < 1e-9,
            "step {t}"
        );
        let (mean, variance) = filter.state();
        assert!(
            (mean - Vector3::from(case.mean[t])).abs().max() < 1e-9,
            "step {t}"
        );
        assert!(
            (variance - Vector3::from(case.variance[t])).abs().max() < 1e-9,
            "step {t}"
        );
        assert!(
            (sum - case.log_evidence[t]).abs() < 1e-9 * (1.0 + sum.abs()),
            "step {t}"
        );
    }
    assert_eq!(filter.log_dropped(), f64::NEG_INFINITY);
}

#[test]
fn dropping_the_least_likely_sequences_costs_little_and_is_told() {
    let case = jump_linear();
    let mut filter = Sequences::<_, 3>::new(case.clone(), 100);
    let (found, _) = run(&mut filter, case.observations(), &case.filter);
    assert!(found < 5e-3, "{found}");
    assert!(filter.log_dropped() > -20.0 && filter.log_dropped() < -3.0);
}

#[test]
fn three_merged_filters_are_close_to_all_sequences() {
    let case = jump_linear();
    let mut filter = Merged::<_, 3>::new(case.clone()).unwrap();
    let (found, log_evidence) = run(&mut filter, case.observations(), &case.filter);
    let exact = *case.log_evidence.last().unwrap();
    let error = (log_evidence - exact).abs();
    assert!(
        found < 0.0103 && error < 0.2,
        "{found}, evidence off by {error}"
    );
}

fn bootstrap<M: vigil_inference::hybrid::Sampled + Clone>(
    model: &M,
    resampling: Resampling,
    count: usize,
    seed: u64,
) -> ParticleFilter<M> {
    ParticleFilter::new(
        model.clone(),
        Proposal::prior(model).unwrap(),
        resampling,
        count,
        seed,
    )
    .unwrap()
}

#[test]
fn the_bootstrap_filter_approaches_the_exact_belief_of_thirteen_modes() {
    let case = hidden_markov();
    let exact = *case.log_evidence.last().unwrap();
    for (count, bound) in [(1_000, 0.035), (10_000, 0.010)] {
        let (found, bias) = mean_of(20, exact, |seed| {
            let mut filter = bootstrap(&case, Resampling::EVERY_STEP, count, seed);
            run(&mut filter, case.observations.iter(), &case.filter)
        });
        assert!(found < bound, "{count}: {found}");
        assert!(count < 10_000 || bias.abs() < 0.6, "{count}: bias {bias}");
    }
}

#[test]
fn the_bootstrap_filter_approaches_the_kalman_filter() {
    let case = linear();
    let exact = *case.log_evidence.last().unwrap();
    let (mut square, mut bias, runs) = (0.0, 0.0, 20);
    for seed in 0..runs {
        let mut filter = bootstrap(&case, Resampling::EVERY_STEP, 10_000, seed);
        for (t, z) in case.observations.iter().enumerate() {
            bias += filter.step(z).log_evidence;
            // After resampling the weights are equal.
            let sum: Vector3<f64> = filter.particles().map(|(_, state, w)| state * w).sum();
            for i in 0..3 {
                square += (sum[i] - case.mean[t][i]).powi(2) / case.covariance[t][i][i];
            }
        }
        bias -= exact;
    }
    let rmse = (square / (runs as f64 * 3.0 * case.mean.len() as f64)).sqrt();
    assert!(rmse < 0.05, "{rmse}");
    assert!((bias / runs as f64).abs() < 0.6, "{bias}");
}

#[test]
fn look_ahead_with_a_thousand_particles_beats_ten_thousand_of_the_bootstrap_filter() {
    let case = jump_linear();
    let exact = *case.log_evidence.last().unwrap();
    let (plain, plain_bias) = mean_of(20, exact, |seed| {
        let mut filter = bootstrap(&case, Resampling::EVERY_STEP, 10_000, seed);
        run(&mut filter, case.observations(), &case.filter)
    });
    assert!(
        plain < 0.035 && plain_bias.abs() < 0.6,
        "{plain}, {plain_bias}"
    );
    let (ahead, bias) = mean_of(20, exact, |seed| {
        let mut filter = LookAhead::<_, 3>::new(case.clone(), 1_000, seed).unwrap();
        run(&mut filter, case.observations(), &case.filter)
    });
    assert!(ahead * 1.5 < plain, "{ahead} against {plain}");
    assert!(bias.abs() < 0.1, "{bias}");
}

#[test]
fn the_evidence_is_right_whether_or_not_the_particles_are_resampled() {
    let case = jump_linear();
    let exact = *case.log_evidence.last().unwrap();
    for threshold in [0.5, 1.0, 0.2] {
        let resampling = Resampling { threshold };
        let (found, bias) = mean_of(20, exact, |seed| {
            let mut filter = bootstrap(&case, resampling, 10_000, seed);
            run(&mut filter, case.observations(), &case.filter)
        });
        assert!(
            found < 0.04 && bias.abs() < 0.3,
            "{resampling:?}: {found}, bias {bias}"
        );
    }
}

#[test]
fn better_proposals_keep_belief_and_evidence_and_need_fewer_particles() {
    let case = hidden_markov();
    let exact = *case.log_evidence.last().unwrap();
    let mut risk = [8.0; 13];
    risk[0] = 1.0;
    let proposals = [
        Proposal::prior(&case).unwrap(),
        Proposal::raised(&case, 0.5).unwrap(),
        Proposal::risk_raised(&case, 0.5, &risk).unwrap(),
    ];
    let at = |proposal: &Proposal, count| {
        mean_of(20, exact, |seed| {
            let resampling = Resampling::default();
            let mut filter =
                ParticleFilter::new(case.clone(), proposal.clone(), resampling, count, seed)
                    .unwrap();
            run(&mut filter, case.observations.iter(), &case.filter)
        })
    };
    let [prior, raised, both] = proposals.each_ref().map(|proposal| at(proposal, 300));
    assert!(
        raised.0 < 0.7 * prior.0,
        "raised {raised:?}, prior {prior:?}"
    );
    assert!(both.0 < 0.7 * prior.0, "both {both:?}, prior {prior:?}");
    for proposal in &proposals {
        let (found, bias) = at(proposal, 10_000);
        assert!(found < 0.015 && bias.abs() < 0.3, "{found}, bias {bias}");
    }
}

#[test]
fn a_tree_of_several_levels_is_as_right_as_a_flat_one() {
    let case = hidden_markov();
    let flat = [vec![1, 2, 3], vec![4, 5, 6], (7..13).collect::<Vec<_>>()];
    let mut deep = vec![(1..7).collect::<Vec<_>>(), (1..13).collect()];
    deep.extend(flat.clone());
    let exact = case.log_evidence[case.log_evidence.len() - 1];
    let both = [flat.to_vec(), deep].map(|nodes| {
        mean_of(20, exact, |seed| {
            let resampling = Resampling::default();
            let filter = Hierarchical::new(case.clone(), &nodes, resampling, 1_000, seed);
            let mut filter = filter.unwrap().with_raised_proposals(0.5);
            run(&mut filter, case.observations.iter(), &case.filter)
        })
    });
    for (distance, bias) in both {
        assert!(distance < 0.035 && bias.abs() < 1.0, "{both:?}");
    }
}

#[test]
fn the_hierarchy_keeps_belief_and_evidence_and_needs_fewer_particles() {
    let case = hidden_markov();
    let exact = *case.log_evidence.last().unwrap();
    // Left and right wheels stuck, broken encoders.
    let nodes = [vec![1, 2, 3], vec![4, 5, 6], (7..13).collect()];
    let at = |count, leave: Option<f64>| {
        mean_of(20, exact, |seed| {
            let resampling = Resampling::default();
            let filter = Hierarchical::new(case.clone(), &nodes, resampling, count, seed);
            let mut filter = filter.unwrap();
            if let Some(leave) = leave {
                filter = filter.with_raised_proposals(leave);
            }
            run(&mut filter, case.observations.iter(), &case.filter)
        })
    };
    let (flat, _) = mean_of(20, exact, |seed| {
        let mut filter = bootstrap(&case, Resampling::default(), 300, seed);
        run(&mut filter, case.observations.iter(), &case.filter)
    });
    for leave in [None, Some(0.5)] {
        let (few, _) = at(300, leave);
        assert!(few < 0.8 * flat, "{few}, flat {flat}");
        let (many, bias) = at(10_000, leave);
        assert!(many < 0.015 && bias.abs() < 0.3, "{many}, bias {bias}");
    }

    let case = jump_linear();
    let exact = *case.log_evidence.last().unwrap();
    let (found, bias) = mean_of(20, exact, |seed| {
        let resampling = Resampling::default();
        let filter = Hierarchical::new(case.clone(), &[vec![1, 2]], resampling, 10_000, seed);
        run(&mut filter.unwrap(), case.observations(), &case.filter)
    });
    assert!(found < 0.04 && bias.abs() < 0.3, "{found}, bias {bias}");
}

#[test]
fn nothing_measured_is_nothing_learned_by_raised_proposals() {
    let case = jump_linear();
    let observations: Vec<_> = case.observations().take(4).collect();
    let nothing = PoseAndWheels {
        pose: [f64::NAN; 3],
        wheels: [f64::NAN; 2],
    };
    let resampling = Resampling::default();
    let raised = Proposal::raised(&case, 0.5).unwrap();
    let hierarchical = Hierarchical::new(case.clone(), &[vec![1, 2]], resampling, 20_000, 1);
    let filters: [Box<dyn Filter<Observation = PoseAndWheels>>; 2] = [
        Box::new(ParticleFilter::new(case.clone(), raised, resampling, 20_000, 1).unwrap()),
        Box::new(hierarchical.unwrap().with_raised_proposals(0.5)),
    ];
    for mut filter in filters {
        for z in &observations {
            filter.step(z);
        }
        let before = filter.posterior().to_vec();
        assert!(filter.step(&nothing).event.is_some());
        let chain = |to: usize| -> f64 {
            let from = before.iter().enumerate();
            from.map(|(from, p)| p * case.transition(from, to)).sum()
        };
        let expected = [0, 1, 2].map(chain);
        let found = filter.posterior();
        assert!(
            distance(found, &expected) < 0.02,
            "{found:?}, not {expected:?}"
        );
    }
}

fn is_sound(p: &[f64]) -> bool {
    p.iter().all(|p| (0.0..=1.0).contains(p)) && (p.iter().sum::<f64>() - 1.0).abs() < 1e-9
}

fn small_filters(case: &JumpLinear) -> Vec<Box<dyn Filter<Observation = PoseAndWheels>>> {
    let resampling = Resampling::default();
    let hierarchical = Hierarchical::new(case.clone(), &[vec![1, 2]], resampling, 30, 1).unwrap();
    let sampled =
        |proposal| ParticleFilter::new(case.clone(), proposal, resampling, 30, 1).unwrap();
    let raised = || Proposal::raised(case, 0.5).unwrap();
    let risk = Proposal::risk_raised(case, 0.5, &[1.0, 9.0, 3.0]).unwrap();
    let adaptive = Adaptive::new(0.05, 2.33, 10, 30);
    vec![
        Box::new(bootstrap(case, resampling, 30, 1)),
        Box::new(sampled(raised())),
        Box::new(sampled(risk)),
        Box::new(sampled(raised()).with_adaptive_count(adaptive)),
        Box::new(hierarchical.clone()),
        Box::new(hierarchical.with_raised_proposals(0.5)),
        Box::new(LookAhead::<_, 3>::new(case.clone(), 10, 1).unwrap()),
        Box::new(Merged::<_, 3>::new(case.clone()).unwrap()),
        Box::new(Sequences::<_, 3>::new(case.clone(), 30)),
    ]
}

proptest! {
    #[test]
    fn no_observation_breaks_a_filter(
        steps in prop::collection::vec(prop::array::uniform5(prop::num::f64::ANY), 1..25)
    ) {
        let case = jump_linear();
        let good = case.observations().next().unwrap();
        for mut filter in small_filters(&case) {
            for z in &steps {
                let bad = PoseAndWheels { pose: [z[0], z[1], z[2]], wheels: [z[3], z[4]] };
                for z in [bad, good] {
                    let step = filter.step(&z);
                    prop_assert!(is_sound(filter.posterior()), "{:?}", filter.posterior());
                    prop_assert!(step.log_evidence.is_finite());
                    prop_assert!(step.effective_sample_size.is_finite());
                }
            }
            filter.reset();
            prop_assert!(is_sound(filter.posterior()));
        }
    }
}

#[test]
fn equal_seeds_give_equal_bits_and_other_seeds_others() {
    let case = jump_linear();
    let beliefs = |seed| {
        let mut filter = bootstrap(&case, Resampling::default(), 500, seed);
        case.observations()
            .map(|z| {
                filter.step(&z);
                filter.posterior().to_vec()
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(beliefs(7), beliefs(7));
    assert_ne!(beliefs(7), beliefs(8));
}

//! The filter against a Kalman filter, against all sequences of modes, level against level, and
//! with hostile input.
#![allow(clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::super::tests::processors;
use super::super::{Level, ModelError};
use super::{LaneLookAhead, LinearModel, LinearParameters, Observation};
use crate::filter::{Event, Filter};
use crate::hybrid::Conditional;
use crate::look_ahead::LookAhead;
use crate::sequences::Sequences;

type Parameters = LinearParameters<3, 2, 2>;
type Model = LinearModel<3, 2, 2>;
type Seen = Observation<2, 2>;

/// A position, its rate and a bias, all coupled; of the modes one pushes, one shifts a sensor, one
/// changes both and a rate.
fn parameters() -> Parameters {
    LinearParameters {
        initial: vec![0.7, 0.3, 0.0, 0.0],
        transition: vec![
            vec![0.9, 0.04, 0.03, 0.03],
            vec![0.1, 0.85, 0.05, 0.0],
            vec![0.1, 0.05, 0.85, 0.0],
            vec![0.0, 0.0, 0.05, 0.95],
        ],
        motion: SMatrix::from([[1.0, 0.0, 0.02], [0.1, 0.9, 0.0], [0.0, -0.1, 0.97]]),
        shift: vec![
            [0.02, 0.1, 0.0],
            [0.02, -0.1, 0.0],
            [0.02, 0.1, 0.0],
            [0.0, 0.3, 0.1],
        ],
        motion_noise: SMatrix::from([[4e-4, 1e-4, 0.0], [1e-4, 9e-4, 0.0], [0.0, 0.0, 1e-4]]),
        observe: SMatrix::from([[1.0, 0.0], [0.1, 1.0], [0.0, 1.0]]),
        offset: vec![[0.5, 0.0], [0.5, 0.0], [0.5, 0.15], [0.4, -0.1]],
        sensor_noise: SMatrix::from([[4e-3, 1e-3], [1e-3, 6e-3]]),
        rates: vec![[1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [0.7, 1.0]],
        rate_sd: [0.2, 0.3],
        start: [1000.0, 0.0, 0.2],
        start_covariance: SMatrix::identity() * 1e-3,
    }
}

fn model() -> Model {
    LinearModel::new(parameters()).unwrap()
}

/// Observations of a simulated run; noises that are correlated are drawn as if they were not.
fn drive(p: &Parameters, steps: usize, seed: u64) -> Vec<Seen> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (mut mode, mut state) = (0, SVector::from(p.start));
    let mut run = Vec::new();
    for _ in 0..steps {
        let mut left: f64 = rng.random();
        let next = p.transition[mode].iter().position(|p| {
            left -= p;
            left < 0.0
        });
        mode = next.unwrap();
        let mut normal = |variance: f64| variance.sqrt() * rng.sample::<f64, _>(StandardNormal);
        state = p.motion * state + SVector::from(p.shift[mode]);
        state += SVector::from_fn(|i, _| normal(p.motion_noise[(i, i)]));
        let seen = p.observe * state + SVector::from(p.offset[mode]);
        run.push(Observation {
            state: std::array::from_fn(|i| seen[i] + normal(p.sensor_noise[(i, i)])),
            rates: std::array::from_fn(|w| p.rates[mode][w] + normal(p.rate_sd[w].powi(2))),
        });
    }
    run
}

/// A run with everything in it: missing channels, a jump, something absurd.
fn eventful() -> Vec<Seen> {
    let mut run = drive(&parameters(), 60, 8);
    run[10].state[1] = f64::NAN;
    run[12].rates[0] = f64::INFINITY;
    run[20].state[0] += 1e4;
    run[30].state[0] = 1e200;
    run[40] = Observation::MISSING;
    run
}

fn assert_sound(filter: &LaneLookAhead<3, 2, 2>) {
    let p = filter.posterior();
    assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{p:?}");
    assert!(p.iter().all(|p| (0.0..=1.0).contains(p)), "{p:?}");
    let state = filter.state();
    assert!(
        state
            .mean
            .iter()
            .chain(&state.covariance)
            .all(|x| x.is_finite())
    );
}

/// Everything that a filter says, bit by bit.
fn bits(mut filter: LaneLookAhead<3, 2, 2>, run: &[Seen]) -> Vec<u64> {
    let mut bits = Vec::new();
    for z in run {
        let step = filter.step(z);
        bits.push(step.log_evidence.to_bits());
        bits.push(step.effective_sample_size.to_bits());
        bits.extend(filter.posterior().iter().map(|p| p.to_bits()));
        bits.extend(filter.state().mean.iter().map(|x| x.to_bits()));
    }
    bits
}

#[test]
fn levels_with_fused_operations_agree_in_every_bit() {
    for count in [16, 100, 3000] {
        let found = processors().into_iter().filter(|(_, is_fused)| *is_fused);
        let found: Vec<_> = found
            .map(|(processor, _)| {
                let filter = LaneLookAhead::new(model(), count, 6).on(processor);
                bits(filter, &eventful())
            })
            .collect();
        assert!(found.iter().all(|other| found[0] == *other), "{count}");
    }
}

#[test]
fn equal_seeds_give_equal_bits_and_others_do_not() {
    for level in Level::ALL.into_iter().filter(|level| level.is_available()) {
        let filter = |seed| {
            let filter = LaneLookAhead::new(model(), 32, seed);
            filter.at_level(level).unwrap()
        };
        assert_eq!((filter(1).level(), filter(1).count()), (level, 32));
        assert!(bits(filter(1), &eventful()) == bits(filter(1), &eventful()));
        assert!(bits(filter(1), &eventful()) != bits(filter(2), &eventful()));
    }
}

/// With all modes alike, a single Kalman filter is exact.
#[test]
fn modes_that_are_alike_follow_the_kalman_filter() {
    let mut p = parameters();
    p.shift = vec![[0.02, 0.1, 0.0]; 4];
    p.offset = vec![[0.5, -0.1]; 4];
    p.rates = vec![[1.0, 0.8]; 4];
    let run = drive(&p, 200, 3);
    let model = LinearModel::new(p).unwrap();
    let mut exact = model.prior(0);
    let mut filter = LaneLookAhead::new(model.clone(), 16, 1);
    for z in &run {
        model.predict(0, &mut exact);
        let log_evidence = model.update(0, &mut exact, z).unwrap();
        let step = filter.step(z);
        assert_eq!((step.event, filter.left_out()), (None, 0));
        assert!((step.log_evidence - log_evidence).abs() < 1e-5);
        let state = filter.state();
        assert!((state.mean - exact.mean).amax() < 1e-9);
        assert!((state.covariance - exact.covariance).amax() < 1e-12);
    }
}

/// What is left out must change nothing but what is known: the same as a model without it.
#[test]
fn a_channel_that_is_left_out_is_as_if_it_did_not_exist() {
    let p = parameters();
    let without = LinearModel::new(LinearParameters::<3, 1, 1> {
        initial: p.initial.clone(),
        transition: p.transition.clone(),
        motion: p.motion,
        shift: p.shift.clone(),
        motion_noise: p.motion_noise,
        observe: p.observe.fixed_rows::<1>(0).into_owned(),
        offset: p.offset.iter().map(|h| [h[0]]).collect(),
        sensor_noise: p.sensor_noise.fixed_view::<1, 1>(0, 0).into_owned(),
        rates: p.rates.iter().map(|mu| [mu[1]]).collect(),
        rate_sd: [p.rate_sd[1]],
        start: p.start,
        start_covariance: p.start_covariance,
    });
    let mut without = LaneLookAhead::new(without.unwrap(), 64, 5);
    let mut filter = LaneLookAhead::new(model(), 64, 5);
    for (t, mut z) in drive(&p, 100, 4).into_iter().enumerate() {
        z.state[1] = [f64::NAN, f64::INFINITY][t % 2];
        z.rates[0] = f64::NEG_INFINITY;
        let step = filter.step(&z);
        let other = without.step(&Observation {
            state: [z.state[0]],
            rates: [z.rates[1]],
        });
        assert_eq!((step.event, filter.left_out()), (None, 2));
        assert!((step.log_evidence - other.log_evidence).abs() < 1e-4);
        for (p, q) in filter.posterior().iter().zip(without.posterior()) {
            assert!((p - q).abs() < 1e-4, "{t}");
        }
    }
}

#[test]
fn beliefs_and_evidence_are_close_to_those_of_all_sequences() {
    let run = drive(&parameters(), 10, 7);
    let mut exact = Sequences::<_, 3>::new(model(), 300_000);
    let expected: Vec<_> = run
        .iter()
        .map(|z| (exact.step(z), exact.posterior().to_vec(), exact.state().0))
        .collect();
    assert_eq!(exact.log_dropped(), f64::NEG_INFINITY);
    for (processor, _) in processors() {
        let (mut l1, mut bias, seeds) = (0.0, 0.0, 10);
        for seed in 0..seeds {
            let mut filter = LaneLookAhead::new(model(), 2000, seed).on(processor);
            for (z, (step, posterior, mean)) in run.iter().zip(&expected) {
                bias += filter.step(z).log_evidence - step.log_evidence;
                let pairs = filter.posterior().iter().zip(posterior);
                l1 += pairs.map(|(p, q)| (p - q).abs()).sum::<f64>() / run.len() as f64;
                assert!((filter.state().mean - mean).amax() < 0.02);
            }
        }
        let (l1, bias) = (l1 / seeds as f64, bias / seeds as f64);
        assert!(
            l1 < 5e-3 && bias.abs() < 0.02,
            "{processor:?}: {l1}, {bias}"
        );
    }
}

#[test]
fn each_mode_has_its_share_of_the_children_within_one() {
    let mut filter = LaneLookAhead::new(model(), 160, 2);
    for z in eventful() {
        filter.step(&z);
        let mut counts = [0_u32; 4];
        for (mode, _) in filter.particles() {
            counts[mode] += 1;
        }
        for (count, p) in counts.iter().zip(filter.posterior()) {
            assert!((f64::from(*count) - 160.0 * p).abs() <= 1.0 + 1e-3);
        }
    }
}

#[test]
fn what_is_impossible_stays_impossible() {
    let mut p = parameters();
    for (from, row) in p.transition.iter_mut().enumerate() {
        row.fill(0.0);
        row[from] = 1.0;
    }
    let model = LinearModel::new(p.clone()).unwrap();
    let mut filter = LaneLookAhead::new(model, 1600, 1);
    for mut z in drive(&p, 300, 2) {
        // As the last mode would have it.
        z.rates[0] = 0.0;
        filter.step(&z);
        assert_eq!(filter.posterior()[2..], [0.0; 2]);
        assert!(filter.particles().all(|(mode, _)| mode < 2));
    }
}

#[test]
fn nothing_measured_predicts_the_modes_exactly() {
    let p = parameters();
    let mut filter = LaneLookAhead::new(model(), 1600, 1);
    let mut exact = p.initial.clone();
    for _ in 0..10 {
        let step = filter.step(&Observation::MISSING);
        assert_eq!((step.event, step.log_evidence), (Some(Event::Coasted), 0.0));
        assert!((step.effective_sample_size / 1600.0 - 1.0).abs() < 1e-5);
        assert_eq!(filter.left_out(), 4);
        let next = |to| {
            (0..4)
                .map(|from| exact[from] * p.transition[from][to])
                .sum()
        };
        exact = (0..4).map(next).collect();
        for (p, exact) in filter.posterior().iter().zip(&exact) {
            // Each draw is off by at most one particle in each mode.
            assert!((p - exact).abs() < 0.02, "{p} {exact}");
        }
    }
}

/// Far away every filter that counts in logarithms goes along.
#[test]
fn a_jump_is_followed_as_in_double_precision() {
    let mut run = drive(&parameters(), 12, 5);
    for z in &mut run[6..] {
        z.state[0] += 500.0;
    }
    let mut exact = LookAhead::<_, 3>::new(model(), 2000, 1);
    let mut filter = LaneLookAhead::new(model(), 2000, 2);
    for z in &run {
        let (found, expected) = (filter.step(z), exact.step(z));
        assert_eq!(found.event, None);
        let error = (found.log_evidence - expected.log_evidence).abs();
        assert!(error < 0.1 + 1e-3 * expected.log_evidence.abs(), "{error}");
    }
    assert_sound(&filter);
}

#[test]
fn what_grows_beyond_all_numbers_begins_anew() {
    let mut p = parameters();
    // The second dimension doubles and is not seen.
    p.motion = SMatrix::from([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]]);
    p.observe = SMatrix::from([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]);
    let mut filter = LaneLookAhead::new(LinearModel::new(p).unwrap(), 32, 1);
    let mut restarts = 0;
    for z in drive(&parameters(), 3000, 1) {
        let step = filter.step(&z);
        restarts += u32::from(step.event == Some(Event::Restarted));
        assert!(step.log_evidence.is_finite());
        assert_sound(&filter);
    }
    assert!((3..30).contains(&restarts), "{restarts}");
}

/// Numbers below the normal ones would make a quiet drive slower than any other.
#[test]
fn distances_that_shrink_never_become_subnormal() {
    let mut p = parameters();
    p.rate_sd = [0.03; 2];
    // Only the last mode lasts.
    for row in &mut p.transition {
        row.copy_from_slice(&[0.0, 0.0, 0.1, 0.9]);
    }
    p.transition[3] = vec![0.0, 0.0, 0.0, 1.0];
    for (processor, _) in processors() {
        let filter = LaneLookAhead::new(LinearModel::new(p.clone()).unwrap(), 64, 3);
        let mut filter = filter.on(processor);
        for z in drive(&p, 2000, 3) {
            filter.step(&z);
            let least = f32::EPSILON / (1_u64 << 42) as f32;
            assert!(filter.distances().all(|x| x == 0.0 || x.abs() > least));
        }
        // Rounding may keep a few units.
        assert!(filter.distances().all(|x| x.abs() < 1e-17));
    }
}

fn refused(change: impl Fn(&mut Parameters)) -> ModelError {
    let mut parameters = parameters();
    change(&mut parameters);
    LinearModel::new(parameters).unwrap_err()
}

#[test]
fn models_are_checked() {
    use ModelError::{Covariance, Distribution, Length, Modes};
    assert_eq!(refused(|p| p.initial.clear()), Modes { found: 0 });
    assert_eq!(refused(|p| p.initial = vec![0.05; 20]), Modes { found: 20 });
    let length = |table| Length {
        table,
        found: 3,
        wanted: 4,
    };
    assert_eq!(refused(|p| p.shift.truncate(3)), length("shift"));
    assert_eq!(
        refused(|p| p.transition[1].truncate(3)),
        length("transition")
    );
    assert_eq!(
        refused(|p| p.transition[2][0] = f64::NAN),
        Distribution {
            table: "transition",
            row: 2
        }
    );
    let infinite = refused(|p| p.motion[(1, 1)] = f64::INFINITY);
    assert!(matches!(
        infinite,
        ModelError::Range {
            table: "motion",
            ..
        }
    ));
    let silent = refused(|p| p.rate_sd[1] = 0.0);
    assert!(matches!(
        silent,
        ModelError::Range {
            table: "rate_sd",
            ..
        }
    ));
    let table = "sensor_noise";
    assert_eq!(
        refused(|p| p.sensor_noise[(0, 1)] = 0.0),
        Covariance { table }
    );
    assert_eq!(
        refused(|p| p.sensor_noise[(1, 1)] = 0.0),
        Covariance { table }
    );
    let table = "motion_noise";
    assert_eq!(
        refused(|p| p.motion_noise[(0, 0)] = 1e-9),
        Covariance { table }
    );
    let still = LinearModel::new(Parameters {
        motion_noise: SMatrix::zeros(),
        ..parameters()
    });
    assert!(still.is_ok());
}

proptest! {
    #[test]
    fn no_observation_breaks_the_filter(
        steps in prop::collection::vec(prop::array::uniform4(prop::num::f64::ANY), 1..25)
    ) {
        let good = drive(&parameters(), 1, 1)[0];
        for (processor, _) in processors() {
            let mut filter = LaneLookAhead::new(model(), 10, 1).on(processor);
            for z in &steps {
                let bad = Observation { state: [z[0], z[1]], rates: [z[2], z[3]] };
                for z in [bad, good] {
                    let step = filter.step(&z);
                    prop_assert!(step.log_evidence.is_finite());
                    prop_assert!(step.effective_sample_size.is_finite());
                    assert_sound(&filter);
                }
            }
            filter.reset();
            prop_assert!((filter.posterior()[0] - 0.7).abs() < 0.07);
        }
    }
}

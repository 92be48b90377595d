//! The filter against one track per onset, and on ground that changes.

use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const VARIANCE: [f64; 3] = [2.5e-5; 3];
const BIRTH: f64 = 1e-4;
const SUSPECTED: Suspicion = Suspicion {
    variance: [2.5e-7; 3],
    ends: 1e-3,
};

fn noise(offset: f64, deviation: f64) -> MotionNoise {
    MotionNoise {
        offset: Matrix3::identity() * offset * offset,
        deviation: Matrix3::identity() * deviation * deviation,
        length_m: 0.3,
        white: Vector3::repeat(1e-8),
        drift: Vector3::zeros(),
        bound: Vector3::repeat(f64::INFINITY),
        changes_1_m: 0.0,
    }
}

const STEP: Displacement = Displacement {
    per_metre: [0.5, 1.0, 0.0],
    travel_m: 0.01,
    extra: [0.0; 3],
};

fn kinds() -> [Kind; 2] {
    let anything = Kind {
        share: 0.6,
        step: STEP,
        noise: noise(0.25, 0.03),
        is_unknown: false,
    };
    let slower = Kind {
        share: 0.4,
        step: Displacement {
            per_metre: [0.5, 0.9, 0.0],
            ..STEP
        },
        noise: noise(0.05, 0.03),
        is_unknown: false,
    };
    [anything, slower]
}

/// Poses measured on a path that turns by `excess` rad/m more from step `onset` on.
fn poses(excess: f64, onset: usize, steps: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut at = [0.0_f64; 3];
    let drive = |step: usize| {
        let turn = (0.5 + if step < onset { 0.0 } else { excess }) * 0.01;
        let middle = at[2] + 0.5 * turn;
        at = [
            at[0] + 0.01 * middle.cos(),
            at[1] + 0.01 * middle.sin(),
            at[2] + turn,
        ];
        std::array::from_fn(|i| at[i] + 0.005 * rng.sample::<f64, _>(StandardNormal))
    };
    (0..steps).map(drive).collect()
}

fn filter() -> Departure<2> {
    let mut filter = Departure::new(noise(0.001, 0.001));
    filter.start([0.0; 3], [1e-4; 3]);
    filter
}

#[test]
fn a_usual_pose_keeps_its_variance_and_a_far_one_is_trusted_less() {
    let rates = [1e-3; 3];
    assert_eq!(
        filter().trusted([0.01, 0.0, 0.0], VARIANCE, rates),
        VARIANCE
    );
    let far = filter().trusted([5.0, 0.0, 0.0], VARIANCE, rates);
    assert!(far[0] > 100.0 * VARIANCE[0], "{far:?}");
}

/// The log-odds from one track per onset and kind, none merged.
fn every_onset(poses: &[[f64; 3]]) -> f64 {
    let mut nominal = filter().track;
    let mut all: Vec<(usize, f64, Track)> = Vec::new();
    for pose in poses {
        for (kind, its) in kinds().iter().enumerate() {
            all.push((
                kind,
                (BIRTH * its.share).ln(),
                nominal.enter(&nominal.context(), &its.noise),
            ));
        }
        nominal.predict(&STEP, &noise(0.001, 0.001));
        let healthy = nominal.update(*pose, VARIANCE).unwrap();
        for (kind, log_weight, track) in &mut all {
            track.predict(&kinds()[*kind].step, &kinds()[*kind].noise);
            *log_weight += track.update(*pose, VARIANCE).unwrap() - healthy;
        }
    }
    let log_weights = all.iter().map(|(_, log_weight, _)| *log_weight);
    log_weights.fold(f64::NEG_INFINITY, log_add)
}

#[test]
fn sharing_components_between_onsets_costs_little_against_every_onset() {
    for (apart, onset, steps) in [(0.0, 0, 150), (0.2, 60, 68), (-0.1, 60, 71), (0.05, 20, 40)] {
        let poses = poses(apart, onset, steps, 7);
        let mut filter = filter();
        for pose in &poses {
            filter.predict(&STEP, &kinds(), BIRTH, None);
            filter.update(*pose, VARIANCE, true).unwrap();
        }
        let expected = every_onset(&poses);
        assert!(expected < LOG_ODDS_MAX - 5.0, "{apart}: {expected}");
        let found = filter.log_odds();
        assert!(
            (found - expected).abs() < 0.7,
            "{apart}: {found}, {expected}"
        );
    }
}

#[test]
fn a_departure_is_seen_and_its_end_too() {
    let mut filter = filter();
    let (there, back) = (poses(0.2, 100, 300, 3), poses(0.0, 0, 300, 4));
    let mut seen = None;
    for (step, pose) in there.iter().enumerate() {
        let follow = seen.map(|_| SUSPECTED);
        filter.predict(&STEP, &kinds(), BIRTH, follow);
        filter.update(*pose, VARIANCE, true).unwrap();
        if seen.is_none() && filter.log_odds() > 3.0 {
            seen = Some(step);
        }
    }
    assert!((103..130).contains(&seen.unwrap()), "{seen:?}");
    filter.anchor(back[0], VARIANCE);
    for pose in &back[1..] {
        filter.predict(&STEP, &kinds(), BIRTH, Some(SUSPECTED));
        filter.update(*pose, VARIANCE, true).unwrap();
    }
    assert!(filter.log_odds() < -3.0, "{}", filter.log_odds());
}

#[test]
fn what_does_not_count_is_no_evidence() {
    let mut filter = filter();
    for pose in poses(0.3, 0, 100, 5) {
        filter.predict(&STEP, &kinds(), 0.0, None);
        filter.update(pose, VARIANCE, false).unwrap();
    }
    assert_eq!(filter.log_odds(), f64::NEG_INFINITY);
}

/// Healthy motion within a bound, on ground that changes suddenly so often.
fn on_ground(changes_1_m: f64) -> Departure<1> {
    let nominal = MotionNoise {
        drift: Vector3::repeat(1e-6),
        bound: Vector3::new(0.016, 0.08, 0.04),
        length_m: 8.0,
        changes_1_m,
        ..noise(0.006, 0.006)
    };
    let mut filter = Departure::new(nominal);
    filter.start([0.0; 3], [1e-4; 3]);
    filter
}

fn unknown() -> [Kind; 1] {
    [Kind {
        share: 1.0,
        step: STEP,
        noise: noise(0.1, 0.01),
        is_unknown: true,
    }]
}

/// Largest log-odds of a robot that turns by so much more (rad/m) in one stretch after another.
fn highest(mut filter: Departure<1>, stretches: &[f64], seed: u64) -> f64 {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (mut at, mut highest) = ([0.0_f64; 3], f64::NEG_INFINITY);
    for &apart in stretches {
        for _ in 0..600 {
            let turn = (0.5 + apart) * 0.01;
            let middle = at[2] + 0.5 * turn;
            at[0] += 0.01 * middle.cos();
            at[1] += 0.01 * middle.sin();
            at[2] += turn;
            let pose = at.map(|at| at + 0.005 * rng.sample::<f64, _>(StandardNormal));
            filter.predict(&STEP, &unknown(), BIRTH, None);
            filter.update(pose, VARIANCE, true).unwrap();
            highest = highest.max(filter.log_odds());
        }
    }
    highest
}

#[test]
fn ground_that_changes_within_the_bound_is_no_fault_and_a_departure_beyond_it_is() {
    let changing = [0.013, -0.013, 0.013, -0.013, 0.013];
    for seed in 0..5 {
        let taken_for_a_fault = highest(on_ground(0.0), &changing, seed);
        let followed = highest(on_ground(0.0125), &changing, seed);
        assert!(followed < 0.0, "{seed}: {followed}");
        assert!(
            followed + 1.0 < taken_for_a_fault,
            "{seed}: {taken_for_a_fault}"
        );
        let beyond = highest(on_ground(0.0125), &[0.0, 0.05], seed);
        assert!(beyond > 10.0, "{seed}: {beyond}");
    }
}

#[test]
fn nothing_is_forgotten_of_the_ground_with_what_speaks_for_a_fault() {
    let mut filter = on_ground(0.0125);
    let drive = poses(0.01, 0, 300, 9);
    for pose in &drive {
        filter.predict(&STEP, &unknown(), BIRTH, None);
        filter.update(*pose, VARIANCE, true).unwrap();
    }
    assert!(filter.changed.iter().next().is_some());
    let before = *filter.track();
    filter.forget();
    assert_eq!(*filter.track(), before);
    filter.start([7.0, 8.0, 0.5], [1e-4; 3]);
    assert_eq!(filter.track().pose(), Vector3::new(7.0, 8.0, 0.5));
}

#[test]
#[should_panic(expected = "the log-odds of a departure are a number")]
fn a_weight_that_is_no_number_is_caught() {
    let mut filter = filter();
    filter.predict(&STEP, &kinds(), BIRTH, None);
    filter.all_mut().next().unwrap().log_weight = f64::NAN;
    let _ = filter.log_odds();
}

#[test]
fn the_first_pose_is_the_marginal_likelihood_ratio() {
    let mut filter = filter();
    let pose = [0.02, 0.01, 0.0];
    filter.predict(&STEP, &kinds(), BIRTH, None);
    let evidence = filter.update(pose, VARIANCE, true).unwrap();
    let expected = every_onset(&[pose]);
    assert!((filter.log_odds() - expected).abs() < 1e-9);
    // With no fault before the pose, the gain is that of all newborns.
    assert!((filter.gain() - (expected - BIRTH.ln())).abs() < 1e-9);
    // The whitened residual has the density's exponent, whatever the frame.
    let mut nominal = Track::new(
        Vector3::zeros(),
        Matrix3::identity() * 1e-4,
        &filter.nominal,
    );
    nominal.predict(&STEP, &filter.nominal);
    let (_, spread) = nominal.innovation(pose, VARIANCE);
    let peak = -0.5 * spread.determinant().ln() - 1.5 * std::f64::consts::TAU.ln();
    let exponent = -0.5 * evidence.residual.norm_squared();
    assert!((evidence.log_density - peak - exponent).abs() < 1e-9);
}

#[test]
fn weights_end_at_their_bound_and_the_improbable_is_dropped() {
    let mut filter = filter();
    for pose in poses(0.5, 0, 300, 11) {
        filter.predict(&STEP, &kinds(), BIRTH, None);
        filter.update(pose, VARIANCE, true).unwrap();
    }
    let highest = filter.faults.iter().filter_map(best);
    let highest = highest.map(|it| it.log_weight).fold(0.0, f64::max);
    assert!((highest - LOG_ODDS_MAX).abs() < 1e-9, "{highest}");
    let mut all = filter.faults.iter().flat_map(Onsets::iter);
    assert!(all.all(|fault| fault.log_weight > LOG_ODDS_MIN));
}

proptest! {
    #[test]
    fn no_input_breaks_the_filter(
        steps in prop::collection::vec(any::<([f64; 3], [f64; 3], f64, f64)>(), 1..20)
    ) {
        let mut filter = on_ground(0.0125);
        for (i, (pose, per_metre, travel_m, p)) in steps.into_iter().enumerate() {
            let step = Displacement { per_metre, travel_m, ..STEP };
            let suspected = (i % 3 == 0).then_some(Suspicion { ends: p, ..SUSPECTED });
            filter.predict(&step, &unknown(), p, suspected);
            let variance = filter.trusted(pose, per_metre, [p; 3]);
            filter.update(pose, variance, true);
            let _ = filter.log_odds();
            filter.predict(&STEP, &unknown(), BIRTH, None);
            filter.update(pose, VARIANCE, true);
            let _ = filter.log_odds();
        }
    }

    #[test]
    fn no_pose_breaks_the_filter(values in prop::collection::vec(any::<[f64; 3]>(), 1..40)) {
        let mut filter = filter();
        for pose in values {
            filter.predict(&STEP, &kinds(), BIRTH, None);
            filter.update(pose, VARIANCE, true);
            prop_assert!(!filter.log_odds().is_nan() && filter.log_odds() < 1e3);
            prop_assert!(filter.track().pose().iter().all(|value| value.is_finite()));
        }
    }
}

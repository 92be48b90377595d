use nalgebra::{DMatrix, DVector};

use super::super::channel::{Channel, Regressor, Scales, Term, commands};
use super::super::observation::{History, Observation};
use super::super::window::Suspects;
use super::super::{AXES, law::BLOCK_S};
use super::*;

const N: usize = 3;

/// Log density of a Student law of so many variables, by its full covariance, without the terms
/// that depend on their number alone.
fn log_student(covariance: &DMatrix<f64>, x: &DVector<f64>, freedom: f64) -> f64 {
    let root = covariance.clone().cholesky().unwrap();
    let square = x.dot(&root.solve(x));
    let size = x.len() as f64;
    -0.5 * (freedom + size) * (square / freedom).ln_1p() - 0.5 * covariance.determinant().ln()
}

/// Weights of two directions of a law without a change, and the covariances of both laws.
fn laws() -> (Vec<StepDirection>, DMatrix<f64>, DMatrix<f64>) {
    let mix = DMatrix::from_row_slice(N, N, &[1.0, 0.2, -0.1, 0.4, 2.0, 0.3, 0.0, -0.5, 0.7]);
    let without = &mix * mix.transpose();
    // In the coordinates in which the law is white, variances of 9 and 4 with a change.
    let white = mix.clone().try_inverse().unwrap();
    let larger = DMatrix::from_diagonal(&DVector::from_column_slice(&[9.0, 4.0, 1.0]));
    let with = &mix * larger * mix.transpose();
    let direction = |i: usize, ratio: f64| StepDirection {
        weights: white.row(i).iter().copied().collect(),
        ratio,
    };
    (vec![direction(0, 9.0), direction(1, 4.0)], without, with)
}

fn step(values: [f64; N]) -> Step {
    let mut step = [0.0; CHANNELS_MAX];
    step[..N].copy_from_slice(&values);
    step
}

const SEEN: [[f64; N]; 4] = [
    [0.0, 0.0, 0.0],
    [1.5, -0.3, 0.2],
    [-7.0, 3.0, 1.0],
    [40.0, 90.0, -20.0],
];

#[test]
fn the_ratio_is_that_of_two_student_laws_of_the_steps_along_the_directions() {
    let (direction, without, with) = laws();
    let weights = DMatrix::from_fn(2, N, |i, j| direction[i].weights[j]);
    let age = ChangeAge { direction };
    for seen in SEEN {
        let along = &weights * DVector::from_column_slice(&seen);
        let of = |law: &DMatrix<f64>| {
            let law = &weights * law * weights.transpose();
            log_student(&law, &along, FREEDOM)
        };
        let expected = of(&with) - of(&without);
        let found = age.log_ratio(&step(seen));
        assert!(
            (found - expected).abs() < 1e-9,
            "{seen:?}: {found} {expected}"
        );
    }
    assert!(ChangeAge::default().log_ratio(&step(SEEN[2])).abs() < 1e-12);
}

#[test]
fn small_steps_have_the_ratio_of_gaussian_laws_and_large_ones_less() {
    let (direction, without, with) = laws();
    let age = ChangeAge { direction };
    let gaussian = |seen: [f64; N]| {
        let x = DVector::from_column_slice(&seen);
        let of = |law: &DMatrix<f64>| {
            let square = x.dot(&law.clone().cholesky().unwrap().solve(&x));
            -0.5 * square - 0.5 * law.determinant().ln()
        };
        of(&with) - of(&without)
    };
    let found = SEEN.map(|seen| age.log_ratio(&step(seen)));
    assert!((found[0] - gaussian(SEEN[0])).abs() < 1e-9);
    // 10 % heavier in the middle: (20 + 2) / 20.
    let grown = [found[1] - found[0], gaussian(SEEN[1]) - gaussian(SEEN[0])];
    assert!((grown[0] / grown[1] - 1.1).abs() < 0.1, "{grown:?}");
    assert!(found[3] < 30.0 && gaussian(SEEN[3]) > 500.0, "{found:?}");
}

#[test]
fn ages_count_alike_and_the_most_probable_one_dates_the_change() {
    let (direction, ..) = laws();
    let age = |ratio: f64| ChangeAge {
        direction: vec![StepDirection {
            ratio,
            ..direction[0].clone()
        }],
    };
    let change = ContextChange {
        context: "ground".to_owned(),
        runs: 9,
        threshold: 5.0,
        age: vec![age(4.0), age(9.0), age(9.0), age(2.0)],
    };
    let seen = [step(SEEN[1]), step(SEEN[2])];
    let steps = [Some(seen[0]), Some(seen[1]), None, None];
    let (found, blocks) = change.log_ratio(&steps).unwrap();
    let single = [0, 1].map(|i| change.age[i].log_ratio(&seen[i]).exp());
    // Ages that are not seen yet take their part of the prior.
    let expected = (0.25 * (single[0] + single[1])).ln();
    assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    assert_eq!(blocks, 2);
    assert_eq!(change.log_ratio(&[None; AGES]), None);
}

#[test]
fn an_odd_file_does_not_fit() {
    let of = |weights: usize, ratio: f64, threshold: f64| ContextChanges {
        change: vec![ContextChange {
            context: "ground".to_owned(),
            runs: 9,
            threshold,
            age: vec![
                ChangeAge {
                    direction: vec![StepDirection {
                        weights: vec![0.5; weights],
                        ratio,
                    }],
                };
                AGES
            ],
        }],
    };
    assert!(of(2, 3.0, 5.0).fits(2) && ContextChanges::default().fits(2));
    assert!(!of(2, 3.0, 5.0).fits(3) && !of(2, 0.9, 5.0).fits(2) && !of(2, 3.0, -1.0).fits(2));
    for wrong in [f64::NAN, f64::INFINITY] {
        assert!(!of(2, wrong, 5.0).fits(2) && !of(2, 3.0, wrong).fits(2));
        let mut changes = of(2, 3.0, 5.0);
        changes.change[0].age[3].direction[0].weights[1] = wrong;
        assert!(!changes.fits(2));
    }
    let mut changes = of(2, 3.0, 5.0);
    changes.change[0].age.pop();
    assert!(!changes.fits(2), "too few ages");
    let mut changes = of(2, 3.0, 5.0);
    let direction = changes.change[0].age[0].direction[0].clone();
    changes.change[0].age[0].direction = vec![direction; DIRECTIONS_MAX + 1];
    assert!(!changes.fits(2), "too many directions");
    let mut changes = of(2, 3.0, 5.0);
    changes.change = vec![changes.change[0].clone(); CONTEXTS_MAX + 1];
    assert!(!changes.fits(2), "too many changes");
}

/// A window of one block an observation over channels that are predicted to read these, after
/// readings beyond that.
fn window<const C: usize>(predicted: [f64; C], readings: &[[Option<f64>; C]]) -> Window {
    let channel = |predicted: f64| Channel {
        name: String::new(),
        period: None,
        drifts: false,
        terms: vec![Term {
            of: Regressor::Constant,
            index: 0,
            lag: 0,
            powers: [0; AXES],
        }],
        weights: vec![predicted],
        variance: [1.0, 0.0, 0.0],
        context_sd: [0.0; 2],
        usual: 0.0,
        silence_s: 0.0,
        held_out_ratio: 1.0,
    };
    let channels = predicted.map(channel).into_iter().enumerate().collect();
    let scales = Scales::new([1.0; AXES], Vec::new(), BLOCK_S);
    let mut window = Window::new(channels, scales, BLOCK_S);
    let mut history = History::default();
    for row in readings {
        let mut values = [None; CHANNELS_MAX];
        for ((slot, value), predicted) in values.iter_mut().zip(row).zip(predicted) {
            *slot = value.map(|value| predicted + value);
        }
        history.push(Observation {
            dt_s: BLOCK_S,
            values,
            moving: true,
            ..Observation::default()
        });
        window.push(&history, &commands(&history), (1.0, Suspects::default()));
    }
    window
}

#[test]
fn a_step_is_the_mean_of_the_newest_blocks_less_that_of_those_before() {
    let rows = [
        [Some(1.0), None],
        [Some(0.0), None],
        [Some(2.0), None],
        [Some(1.0), None],
        [Some(5.0), Some(1.0)],
        [Some(3.0), Some(2.0)],
    ];
    let seen = StepChannels {
        channels: 2,
        has_pose: false,
    };
    let found = steps(&window([0.0; 2], &rows), seen);
    // Six blocks: the oldest ages have fewer than two before them, the second channel one alone.
    let unit = |newest: f64, before: f64| 1.0 / (1.0 / newest + 1.0 / before).sqrt();
    let second = [unit(1.0, 1.0), 0.0, 0.0, 0.0];
    let means = [(3.0, 9.0 / 5.0), (4.0, 1.0), (3.0, 1.0), (11.0 / 4.0, 0.5)];
    for (age, (newer, older)) in means.into_iter().enumerate() {
        let (newest, before) = ((age + 1) as f64, (5 - age) as f64);
        let step = found[age].unwrap();
        let expected = unit(newest, before) * (newer - older);
        assert!((step[0] - expected).abs() < 1e-12, "{age}: {}", step[0]);
        assert!((step[1] - second[age]).abs() < 1e-12, "{age}: {}", step[1]);
    }
    let found = steps(&window([0.0; 2], &rows[..4]), seen);
    let there = found.map(|step| step.is_some());
    assert_eq!(there, [true, true, false, false]);
    assert_eq!(steps(&window([0.0; 2], &rows[..2]), seen), [None; AGES]);
}

#[test]
fn the_velocity_of_a_pose_steps_along_and_across_its_way() {
    let rows = [[Some(0.0); 2], [Some(0.0); 2], [Some(1.0), Some(2.0)]];
    let seen = StepChannels {
        channels: 2,
        has_pose: true,
    };
    let unit = 1.0 / 1.5_f64.sqrt();
    for (way, expected) in [
        ([10.0, 0.0], [1.0, 2.0]),
        ([0.0, 10.0], [2.0, -1.0]),
        ([-10.0, 0.0], [-1.0, -2.0]),
        // Hardly moving: as it is.
        ([0.0, 0.5], [1.0, 2.0]),
    ] {
        let step = steps(&window(way, &rows), seen)[0].unwrap();
        for (found, expected) in step.into_iter().zip(expected) {
            assert!((found - unit * expected).abs() < 1e-9, "{way:?}: {step:?}");
        }
    }
}

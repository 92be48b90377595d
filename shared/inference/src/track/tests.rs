//! Tests of the track.

use super::*;

fn noise() -> MotionNoise {
    MotionNoise {
        offset: Matrix3::new(4e-4, -1e-4, 0.0, -1e-4, 1e-4, 0.0, 0.0, 0.0, 1e-6),
        deviation: Matrix3::new(2e-3, -9e-4, 0.0, -9e-4, 6e-4, 0.0, 0.0, 0.0, 3e-6),
        length_m: 0.2,
        white: Vector3::new(1e-5, 2e-5, 1e-6),
        drift: Vector3::new(1e-4, 2e-4, 0.0),
        bound: Vector3::repeat(f64::INFINITY),
        changes_1_m: 0.0,
    }
}

fn motion(state: &SVector<f64, N>, step: &Displacement) -> SVector<f64, N> {
    let (travel, f) = (step.travel_m, step.per_metre);
    let turn = (f[0] * (1.0 + state[4]) + state[3] + state[6]) * travel;
    let forward = (f[1] + state[4] + state[7]) * travel;
    let lateral = (f[2] + state[5] + state[8]) * travel;
    let (sin, cos) = (state[2] + 0.5 * turn).sin_cos();
    let mut out = *state;
    out[0] += forward * cos - lateral * sin;
    out[1] += forward * sin + lateral * cos;
    out[2] += turn;
    for i in 6..N {
        out[i] *= (-travel / noise().length_m).exp();
    }
    out
}

#[test]
fn a_slope_turns_round_with_the_direction_of_travel_and_an_offset_does_not() {
    let noise = noise();
    let step = |travel_m| Displacement {
        per_metre: [0.5, 0.9, 0.02],
        travel_m,
        extra: [0.0; 3],
    };
    let mut track = Track::new(Vector3::zeros(), Matrix3::identity() * 1e-4, &noise);
    track.predict(&step(0.05), &noise);
    for (i, value) in [0.03, 0.02, 0.01, 0.06, 0.05, 0.04].into_iter().enumerate() {
        track.mean[3 + i] = value;
    }
    let (before, mut context) = (track, track.context());
    track.predict(&step(0.0), &noise);
    assert_eq!(track.mean, before.mean);
    track.predict(&step(-1e-12), &noise);
    context.fade(-1e-12, &noise);
    let signs = [1.0, 1.0, 1.0, 1.0, -1.0, -1.0];
    for (i, sign) in signs.into_iter().enumerate() {
        let difference = track.mean[3 + i] - sign * before.mean[3 + i];
        assert!(difference.abs() < 1e-9, "{i}");
        let difference = track.covariance[(3, 3 + i)] - sign * before.covariance[(3, 3 + i)];
        assert!(difference.abs() < 1e-9, "{i}");
    }
    let difference = track.covariance[(7, 8)] - before.covariance[(7, 8)];
    assert!(difference.abs() < 1e-9);
    assert!((context.mean[1] + before.context().mean[1]).abs() < 1e-9);
}

#[test]
fn the_track_equals_a_plain_extended_kalman_filter() {
    let noise = noise();
    let start = Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 3e-4));
    let mut track = Track::new(Vector3::new(1.0, 2.0, 0.5), start, &noise);
    let mut plain = Gaussian {
        mean: track.mean,
        covariance: track.covariance,
    };
    let step = Displacement {
        per_metre: [0.5, 0.9, 0.02],
        travel_m: 0.05,
        extra: [1e-6, 0.0, 0.0],
    };
    for k in 0..40 {
        let jacobian = SMatrix::<f64, N, N>::from_fn(|i, j| {
            let (mut up, mut down) = (plain.mean, plain.mean);
            up[j] += 1e-6;
            down[j] -= 1e-6;
            (motion(&up, &step)[i] - motion(&down, &step)[i]) / 2e-6
        });
        let turn = (0.5 * (1.0 + plain.mean[4]) + plain.mean[3] + plain.mean[6]) * 0.05;
        let (sin, cos) = (plain.mean[2] + 0.5 * turn).sin_cos();
        let shift = motion(&plain.mean, &step) - jacobian * plain.mean;
        let moved = motion(&plain.mean, &step) - plain.mean;
        let body = Matrix3::new(
            -0.5 * moved[1],
            cos,
            -sin,
            0.5 * moved[0],
            sin,
            cos,
            1.0,
            0.0,
            0.0,
        );
        let white = Matrix3::from_diagonal(&(noise.white * 0.05 + Vector3::from(step.extra)));
        let mut q = SMatrix::<f64, N, N>::zeros();
        q.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(body * white * body.transpose()));
        let fading = (-0.05_f64 / 0.2).exp();
        let fresh = noise.deviation * (1.0 - fading * fading);
        q.fixed_view_mut::<3, 3>(6, 6).copy_from(&fresh);
        q.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&Matrix3::from_diagonal(&(noise.drift * 0.05)));
        plain.predict(&jacobian, &shift, &q);
        track.predict(&step, &noise);
        let z = [1.0 + 0.04 * f64::from(k), 2.0, 0.5 + 0.03 * f64::from(k)];
        let (innovation, _) = track.innovation(z, [2.5e-5; 3]);
        let observe = SMatrix::<f64, 3, N>::identity();
        let r = Matrix3::identity() * 2.5e-5;
        let expected = plain.update(&innovation, &observe, &r).unwrap();
        let found = track.update(z, [2.5e-5; 3]).unwrap();
        assert!(
            (expected - found).abs() < 1e-5 * (1.0 + expected.abs()),
            "{k}"
        );
    }
    assert!((plain.mean - track.mean).abs().max() < 1e-6);
    assert!((plain.covariance - track.covariance).abs().max() < 1e-8);
}

#[test]
fn a_mixture_keeps_the_first_two_moments() {
    let one = Track::new(Vector3::new(1.0, 0.0, 0.2), Matrix3::identity(), &noise());
    let other = Track::new(
        Vector3::new(2.0, 0.5, 0.0),
        Matrix3::identity() * 3.0,
        &noise(),
    );
    let mixed = one.mixed(&other, 0.25);
    assert!((mixed.pose() - Vector3::new(1.75, 0.375, 0.05)).abs().max() < 1e-12);
    // E[x²] - E[x]²: .25 (1 + 1) + .75 (3 + 4) - 1.75².
    assert!((mixed.pose_covariance()[(0, 0)] - (0.5 + 5.25 - 3.0625)).abs() < 1e-12);
    let mut wider = one;
    wider.diffuse([0.5, 0.0, 0.0]);
    assert!((wider.pose_covariance()[(0, 0)] - 1.5).abs() < 1e-12);
}

#[test]
fn impossible_measurements_change_nothing() {
    let before = Track::new(Vector3::zeros(), Matrix3::identity(), &noise());
    for bad in [f64::NAN, f64::INFINITY, 1e308] {
        let mut track = before;
        assert!(track.update([bad, 0.0, 0.0], [1e-4; 3]).is_none());
        assert_eq!(track, before);
    }
}

#[test]
#[should_panic(expected = "the shares of a mixture are probabilities")]
fn a_share_above_one_is_caught() {
    let track = Track::new(Vector3::zeros(), Matrix3::identity(), &noise());
    let _ = track.mixed(&track, 1.5);
}

#[test]
fn a_mean_beyond_its_bound_is_projected_onto_it_along_its_correlations() {
    let mut track = Track::new(Vector3::zeros(), Matrix3::zeros(), &noise());
    track.mean[4] = 0.3;
    track.mean[7] = 0.2;
    track.covariance.fill(0.0);
    // Offset 3, deviation 1, and x correlated with both.
    (track.covariance[(4, 4)], track.covariance[(7, 7)]) = (3.0, 1.0);
    (track.covariance[(0, 4)], track.covariance[(0, 7)]) = (0.5, 0.3);
    let bound = Vector3::new(1.0, 0.1, 1.0);
    track.saturate(&bound);
    // Beyond by 0.4: three quarters of it come from the offset, x moves by 0.8 / 4 of it.
    assert!((track.mean[4] - 0.0).abs() < 1e-12 && (track.mean[7] - 0.1).abs() < 1e-12);
    assert!((track.mean[0] + 0.08).abs() < 1e-12);
    let before = track;
    track.saturate(&bound);
    assert!((track.mean - before.mean).abs().max() < 1e-12);
    track.mean[4] = -0.5;
    track.saturate(&bound);
    assert!((track.deviation()[1] + 0.1).abs() < 1e-12);
    for bad in [-1.0, f64::NAN] {
        track.saturate(&Vector3::repeat(bad));
    }
}

#[test]
fn the_material_probability_is_that_of_the_tails() {
    let mut track = Track::new(Vector3::zeros(), Matrix3::zeros(), &noise());
    track.covariance.fill(0.0);
    // Variances of offset and deviation add up to 4; the other axes are certain.
    (track.covariance[(3, 3)], track.covariance[(6, 6)]) = (3.0, 1.0);
    track.mean[3] = 1.0;
    // Beyond 3: above by one deviation, below by two.
    let expected: f64 = 0.158_655_253_931_457_05 + 0.022_750_131_948_179_21;
    let bound = Vector3::new(3.0, 1.0, 1.0);
    assert!((track.log_material(&bound) - expected.ln()).abs() < 1e-9);
    // Two independent axes: one minus the product of both within.
    (track.covariance[(4, 4)], track.mean[4]) = (4.0, -1.0);
    let both = 1.0 - (1.0 - expected) * (1.0 - expected);
    let bound = Vector3::new(3.0, 3.0, 1.0);
    assert!((track.log_material(&bound) - both.ln()).abs() < 1e-9);
}

#[test]
fn a_context_becomes_deviations_in_a_nominal_mode_and_offsets_in_a_fault() {
    let (mean, covariance) = (Vector3::new(0.1, 0.2, 0.3), Matrix3::identity() * 0.5);
    let context = Context::new(mean, covariance);
    let track = Track::new(Vector3::zeros(), Matrix3::identity(), &noise());
    let fault = track.enter(&context, &noise());
    assert_eq!(fault.mean.fixed_rows::<3>(3), mean);
    assert_eq!(fault.mean.fixed_rows::<3>(6), Vector3::zeros());
    assert!((fault.covariance[(3, 3)] - 0.5 - noise().offset[(0, 0)]).abs() < 1e-15);
    assert_eq!(fault.covariance[(6, 6)], noise().deviation[(0, 0)]);
    let bounded = MotionNoise {
        bound: Vector3::repeat(1.0),
        ..noise()
    };
    let nominal = track.enter(&context, &bounded);
    assert_eq!(nominal.mean.fixed_rows::<3>(3), Vector3::zeros());
    assert_eq!(nominal.mean.fixed_rows::<3>(6), mean);
    assert_eq!(nominal.covariance[(6, 6)], 0.5);
    assert_eq!(nominal.covariance[(3, 3)], noise().offset[(0, 0)]);
}

#[test]
fn a_context_fades_to_its_stationary_covariance() {
    let noise = noise();
    let mut context = Context::new(Vector3::repeat(0.1), Matrix3::zeros());
    context.fade(0.2, &noise);
    let fading = (-1.0_f64).exp();
    assert!((context.mean[0] - 0.1 * fading).abs() < 1e-15);
    let stationary = noise.offset[(0, 0)] + noise.deviation[(0, 0)];
    let expected = stationary * (1.0 - fading * fading);
    assert!((context.covariance[(0, 0)] - expected).abs() < 1e-15);
    assert_eq!(context.direction(), 1.0);
    assert_eq!(context.facing(-1.0).direction(), -1.0);
}

#[test]
fn a_turn_is_that_of_the_prediction() {
    let noise = noise();
    let mut track = Track::new(Vector3::new(0.0, 0.0, 0.3), Matrix3::identity(), &noise);
    (track.mean[3], track.mean[4], track.mean[6]) = (0.02, -0.1, 0.03);
    let step = Displacement {
        per_metre: [0.5, 0.9, 0.02],
        travel_m: 0.4,
        extra: [0.0; 3],
    };
    let turn = track.turn(&step);
    assert!((turn - (0.5 + 0.02 + 0.03 - 0.05) * 0.4).abs() < 1e-15);
    let before = track.pose()[2];
    track.predict(&step, &noise);
    assert!((track.pose()[2] - before - turn).abs() < 1e-15);
}

#[test]
fn an_anchor_moves_the_pose_and_keeps_the_deviations() {
    let noise = noise();
    let mut track = Track::new(Vector3::zeros(), Matrix3::identity(), &noise);
    let step = Displacement {
        per_metre: [0.5, 0.9, 0.02],
        travel_m: 0.4,
        extra: [0.0; 3],
    };
    track.predict(&step, &noise);
    track.update([0.4, 0.1, 0.3], [1e-4; 3]).unwrap();
    let before = track;
    track.anchor([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]);
    assert_eq!(track.pose(), Vector3::new(1.0, 2.0, 3.0));
    let expected = Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.3));
    assert_eq!(track.pose_covariance(), expected);
    assert_eq!(track.deviation(), before.deviation());
    for (i, j) in (0..3).flat_map(|i| (3..N).map(move |j| (i, j))) {
        assert_eq!(
            (track.covariance[(i, j)], track.covariance[(j, i)]),
            (0.0, 0.0)
        );
    }
    let kept = track.covariance.fixed_view::<6, 6>(3, 3);
    assert_eq!(kept, before.covariance.fixed_view::<6, 6>(3, 3));
}

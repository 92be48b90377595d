//! Cases with an exact answer.

use super::super::{Event, LaneFilter, Observation, PlanarModel};
use super::rover::{MODES, Rover, WHEELS, parameters};
use crate::angle::wrap;
use crate::forward::Forward;
use crate::logspace::log_normal;

/// Motion that does not depend on the mode, and no noise in it: the pose says nothing about the
/// modes, and its likelihood is known. Every fault has wheel rates of its own: between modes that
/// look alike, resampling would let the shares drift.
fn on_rails() -> Rover {
    let mut parameters = parameters();
    parameters.motion = vec![[0.05, 0.01, 0.3]; MODES];
    (parameters.motion_sd, parameters.start_sd) = ([0.0; 3], [0.0; 3]);
    for (wheel, rates) in parameters.wheel_rates[1 + WHEELS..].iter_mut().enumerate() {
        rates[wheel] = 0.5;
    }
    Rover(parameters)
}

/// Mean L1 distance of the mode posteriors from the exact ones, and difference of the evidence of
/// the whole run, where the pose is known.
fn gap(share: f64, pose_is_measured: bool) -> (f64, f64) {
    let rover = on_rails();
    let parameters = &rover.0;
    let model = PlanarModel::new(parameters).unwrap();
    let mut filter = LaneFilter::new(model, 100_000, 3).resampling_below(share);
    let transition: [[f64; MODES]; MODES] =
        std::array::from_fn(|i| std::array::from_fn(|j| parameters.transition[i][j]));
    let mut exact = Forward::<MODES>::at(0);
    let (mut l1, mut evidence) = (0.0, 0.0);
    let mut at = [0.0_f64; 3];
    let run = rover.drive(100, 11);
    for mut z in run.iter().copied() {
        let (sin, cos) = at[2].sin_cos();
        at[0] += cos * 0.05 - sin * 0.01;
        at[1] += sin * 0.05 + cos * 0.01;
        at[2] += 0.3;
        let mut known = 0.0;
        if pose_is_measured {
            let apart = [
                z.pose[0] - at[0],
                z.pose[1] - at[1],
                wrap(z.pose[2] - at[2]),
            ];
            known = apart.iter().map(|d| log_normal(*d, 1e-4)).sum();
        } else {
            z.pose = [f64::NAN; 3];
        }
        exact.predict(&transition);
        let wheels = std::array::from_fn(|mode| {
            let means = parameters.wheel_rates[mode].iter().zip(z.wheel_rates);
            means
                .map(|(mean, z)| log_normal(z - mean, 0.09))
                .sum::<f64>()
        });
        let log_evidence = exact.update(&wheels).unwrap() + known;
        let step = filter.step(&z);
        assert_eq!(step.event, (!pose_is_measured).then_some(Event::NotFinite));
        evidence += step.log_evidence - log_evidence;
        let pairs = filter.posterior().iter().zip(exact.log_p());
        l1 += pairs.map(|(p, log)| (p - log.exp()).abs()).sum::<f64>() / run.len() as f64;
        for (found, at) in filter.pose().iter().zip(at) {
            assert!(wrap(found - at).abs() < 2e-4, "{found} {at}");
        }
    }
    (l1, evidence.abs())
}

#[test]
fn modes_follow_the_exact_forward_filter() {
    for pose_is_measured in [true, false] {
        // Weights that outlive a step must count once: never, sometimes, always resampled.
        for share in [1.0, 0.5, 0.05] {
            let (l1, evidence) = gap(share, pose_is_measured);
            assert!(l1 < 0.01, "{share}: {l1}");
            assert!(evidence < 0.15, "{share}: {evidence}");
        }
    }
}

/// Three random walks: a Kalman filter for each is exact.
#[test]
fn a_single_mode_follows_the_kalman_filter() {
    let mut parameters = parameters();
    parameters.initial = vec![1.0];
    parameters.transition = vec![vec![1.0]];
    parameters.motion = vec![[0.0; 3]];
    parameters.wheel_rates = vec![Vec::new()];
    parameters.start = [1.0, -2.0, 3.0];
    parameters.start_sd = [0.02; 3];
    let rover = Rover(parameters.clone());
    let model = PlanarModel::new(&parameters).unwrap();
    for share in [1.0, 0.5] {
        let mut filter = LaneFilter::new(model.clone(), 50_000, 2).resampling_below(share);
        let (mut mean, mut variance) = (parameters.start, [4e-4; 3]);
        let mut evidence = 0.0;
        for z in rover.drive(60, 4) {
            let step = filter.step(&z);
            assert_eq!(step.event, None);
            evidence += step.log_evidence;
            for axis in 0..3 {
                variance[axis] += parameters.motion_sd[axis].powi(2);
                let (apart, total) = (wrap(z.pose[axis] - mean[axis]), variance[axis] + 1e-4);
                evidence -= log_normal(apart, total);
                mean[axis] += variance[axis] / total * apart;
                variance[axis] *= 1e-4 / total;
                let off = wrap(filter.pose()[axis] - mean[axis]);
                assert!(off.abs() < 0.15 * variance[axis].sqrt(), "{off}");
            }
        }
        assert!(evidence.abs() < 0.5, "{evidence}");
    }
}

#[test]
fn the_wheels_of_the_model_are_counted() {
    let model = PlanarModel::new(&parameters()).unwrap();
    assert_eq!((model.modes(), model.wheels()), (MODES, WHEELS));
    let mut filter = LaneFilter::new(model, 1000, 1);
    assert_eq!(filter.count(), 1024);
    // Two rates behind the model's are not missed.
    let mut z = Observation::MISSING;
    z.pose = [0.05, 0.0, 0.0083];
    z.wheel_rates[..WHEELS].copy_from_slice(&[0.92, 0.92, 0.92, 1.08, 1.08, 1.08]);
    assert_eq!(filter.step(&z).event, None);
    assert!(filter.posterior()[0] > 0.98);
}

//! The grids of sizes, and readings in the unknown.

use super::*;
use crate::Sensors;
use crate::rover::Rover;

#[test]
fn the_ways_of_a_leaf_add_up() {
    let mut fusion = Fusion::neutral();
    for (node, p) in [(4, 0.1), (7, 0.2), (4, 0.3)] {
        fusion.add(node, p);
    }
    assert_eq!(
        (fusion.count, fusion.nodes[0].0, fusion.nodes[1]),
        (2, 4, (7, 0.2))
    );
    assert!((fusion.nodes[0].1 - 0.4).abs() < 1e-15);
}

#[test]
fn sizes_are_as_far_apart_as_their_grids() {
    assert_eq!(cell(SizeKind::TorqueShareLost, 0.5), 0.17);
    assert_eq!(cell(SizeKind::Gain, -1.0), 0.5);
    assert_eq!(cell(SizeKind::CurrentOffsetA, -2.0), 1.4);
    assert_eq!(cell(SizeKind::RateBiasRadS, 2.0), 1.4);
    assert_eq!(cell(SizeKind::Frozen, 2.0), 0.0);
}

fn filter() -> FurtherFilter {
    let rover = Rover::with_all_faults();
    let leaves = rover.leaves(Sensors::All);
    FurtherFilter::new(&rover.model, &rover.robot, &leaves, 0.01).unwrap()
}

#[test]
#[should_panic(expected = "probabilities of all alternatives sum to one")]
fn states_that_do_not_sum_to_one_end_the_process() {
    let mut filter = filter();
    let mut step = |residuals| {
        filter.step(&Observation::default(), &Further::default(), &residuals);
        filter.p[1] = f64::INFINITY;
    };
    step(Residuals::default());
    step(Residuals::default());
}

#[test]
fn faults_that_are_read_come_and_go_at_their_rates_and_the_others_are_held() {
    let mut filter = filter();
    let mut further = Further::default();
    further.yaw_rate.push(0.1, None);
    let observation = Observation {
        dt_s: 0.5,
        ..Observation::default()
    };
    let all = filter.prior.len();
    filter.prior.fill(0.2 / (all - 1) as f64);
    filter.prior[0] = 0.8;
    let before = filter.prior.clone();
    filter.step(&observation, &further, &Residuals::default());
    let (born, mended) = (filter.rates.suspected_1_s, filter.rates.mended_1_s);
    assert!(born > 0.0 && mended > 0.0);
    for (at, &held) in before.iter().enumerate().skip(1) {
        let gained = 0.5 * (0.8 * born * filter.shares[at] - held * mended);
        let gained = if filter.states[at].is_read(&further) {
            gained
        } else {
            0.0
        };
        assert!((filter.prior[at] - held - gained).abs() < 1e-15, "{at}");
    }
    let total: f64 = filter.prior.iter().sum();
    assert!((total - 1.0).abs() < 1e-12, "{total}");
}

#[test]
fn a_stuck_wheel_is_told_again_after_readings_that_look_like_a_noisy_sensor() {
    let mut filter = filter();
    let observation = Observation {
        dt_s: 0.05,
        moving: true,
        command: [0.3, 0.2],
        ..Observation::default()
    };
    let mut further = Further::default();
    for reading in &mut further.currents {
        reading.push(1.0, None);
    }
    let expected = 0.2;
    let by = filter.effect(STUCK, 4, &observation, expected);
    assert!(
        by[4] > 5.0,
        "a wheel that stands draws many amperes: {by:?}"
    );
    let stuck = filter
        .states
        .iter()
        .position(|it| *it == FurtherState::Stuck(4));
    let stuck = stuck.unwrap();
    // While a robot stops and starts again, the current is less and then as much.
    for (share, count) in [(1.0, 10), (0.35, 4), (1.0, 20)] {
        for _ in 0..count {
            let residual = |wheel: usize| Residual {
                apart: share * by[wheel],
                variance: 0.0125,
                expected,
                outlier_rate: 0.0,
            };
            let mut residuals = Residuals::default();
            residuals.currents[..6].copy_from_slice(&std::array::from_fn::<_, 6, _>(|wheel| {
                Some(residual(wheel))
            }));
            filter.step(&observation, &further, &residuals);
        }
        let is_told = filter.p[stuck] > 0.5;
        assert_eq!(is_told, share == 1.0, "{share}: {}", filter.p[stuck]);
    }
}

#[test]
fn in_the_unknown_each_channel_is_healthy_or_reads_anything() {
    let filter = filter();
    let residual = |apart: f64, variance: f64| Residual {
        apart,
        variance,
        expected: 0.0,
        outlier_rate: 0.0,
    };
    let mut residuals = Residuals::default();
    assert_eq!(
        filter.log_ratio_unknown(&residuals, &residuals.currents),
        0.0
    );
    (residuals.currents[0], residuals.yaw_rate) =
        (Some(residual(0.3, 0.01)), Some(residual(-0.2, 0.0004)));
    let found = filter.log_ratio_unknown(&residuals, &residuals.currents);
    let normal = |apart: f64, variance: f64| {
        (-0.5 * apart * apart / variance).exp() / (std::f64::consts::TAU * variance).sqrt()
    };
    // An outlier of one in a thousand has ten times the deviation.
    let density =
        |apart, variance| normal(apart, variance) + 1e-3 * normal(apart, 100.0 * variance);
    let ratio = |apart: f64, variance: f64, sd: f64| {
        let wide = density(apart, variance + sd * sd);
        0.7 + 0.3 * wide / density(apart, variance)
    };
    let (noise, limits) = (Rover::new().robot.noise, Rover::new().robot.limits);
    let turn_rad_s = 0.5 * limits.curvature_1_m * limits.speed_m_s;
    let current = ratio(0.3, 0.01, 10.0 * noise.current_a);
    let expected = current.ln() + ratio(-0.2, 0.0004, turn_rad_s).ln();
    assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
}

#[test]
fn a_fusion_is_the_odds_of_each_state_over_those_without_evidence() {
    let mut filter = filter();
    filter.p.fill(0.0);
    filter.prior.fill(0.0);
    (filter.p[0], filter.prior[0]) = (0.5, 0.8);
    let mut set = |is_it: &dyn Fn(&FurtherState) -> bool, p: f64, prior: f64| {
        let at = filter.states.iter().position(is_it).unwrap();
        (filter.p[at], filter.prior[at]) = (p, prior);
        filter.nodes[at]
    };
    set(&|state| matches!(state, FurtherState::Unknown), 0.1, 0.05);
    set(&|state| matches!(state, FurtherState::Stuck(2)), 0.2, 0.1);
    let motor = set(
        &|state| matches!(state, FurtherState::Torque(0, 0)),
        0.05,
        0.02,
    );
    set(
        &|state| matches!(state, FurtherState::Torque(0, 1)),
        0.05,
        0.03,
    );
    let fusion = filter.fusion();
    let is = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    };
    // Odds 0.4 where 0.125 are expected.
    is(fusion.stuck[2], 3.2);
    is(fusion.stuck[1], 1.0);
    is(fusion.unknown.0, 0.5 + 0.5 * 3.2);
    is(fusion.unknown.1, 0.2);
    // Odds of 0.2 of any load, where 0.0625 are expected.
    is(fusion.askew, 0.5 + 0.5 * 3.2);
    let nodes = &fusion.nodes[..fusion.count];
    let odds = |node| nodes.iter().find(|it| Some(it.0) == node).unwrap().1;
    is(odds(motor), 0.2);
    is(nodes.iter().map(|it| it.1).sum(), 0.2);
}

#[test]
fn a_size_is_the_mean_of_the_most_probable_kind_with_the_width_of_its_cell() {
    let mut filter = filter();
    filter.p.fill(0.0);
    let noise_a = Rover::new().robot.noise.current_a;
    let mut node = None;
    for (at, state) in filter.states.iter().enumerate() {
        let p = match *state {
            FurtherState::CurrentOffset(1, offset) if offset == 8.0 * noise_a => 0.3,
            FurtherState::CurrentOffset(1, offset) if offset == 16.0 * noise_a => 0.1,
            FurtherState::CurrentDead(1) => 0.35,
            _ => continue,
        };
        (filter.p[at], node) = (p, filter.nodes[at]);
    }
    let (node, mut belief) = (node.unwrap(), FaultBelief::default());
    filter.sizes(&mut belief);
    assert_eq!(belief.size_kind, FaultBelief::default().size_kind);
    belief.p[node] = SIZE_P_MIN;
    filter.sizes(&mut belief);
    assert_eq!(belief.size_kind[node], SizeKind::CurrentOffsetA as u32);
    let (mean, square) = (10.0 * noise_a, 112.0 * noise_a * noise_a);
    let cell = 0.7 * mean;
    let sd = (square - mean * mean + cell * cell / 12.0).sqrt();
    assert!((belief.size[node] - mean).abs() < 1e-12);
    assert!((belief.size_sd[node] - sd).abs() < 1e-12);
}

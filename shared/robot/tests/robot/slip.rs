//! The slip model against its reference values, its symmetries and its convergence.

use vigil_robot::slip::{Condition, Situation, SlipError, SlipModel, Soil, Solution};

use crate::rover::rover;

const LM: usize = 1;
/// Left and right wheels exchanged, front to rear kept.
const MIRROR: [usize; 6] = [3, 4, 5, 0, 1, 2];

fn model() -> SlipModel {
    SlipModel::new(&rover()).unwrap()
}

fn situation(curvature_1_m: f64, speed_m_s: f64, stuck: &[usize]) -> Situation {
    Situation {
        curvature_1_m,
        speed_m_s,
        stuck: std::array::from_fn(|i| stuck.contains(&i)),
        soil: Soil::uniform(0.65, 0.2),
        condition: Condition::default(),
    }
}

fn solve(curvature_1_m: f64, speed_m_s: f64, stuck: &[usize]) -> Solution {
    let asked = situation(curvature_1_m, speed_m_s, stuck);
    model().solve(&asked, None).unwrap()
}

/// Agreement at the printed precision: half a unit of the last decimal, and a little.
fn close(found: f64, expected: f64, decimals: i32, what: &str) {
    let tolerance = 0.51 * 10_f64.powi(-decimals);
    let off = (found - expected).abs();
    assert!(off <= tolerance, "{what}: {found}, expected {expected}");
}

/// Stuck wheels; velocity; decimals of its first number; wheel rates.
type Row = (&'static [usize], [f64; 3], i32, [f64; 6]);

#[test]
fn a_left_turn_with_each_wheel_stuck_gives_the_reference_motion() {
    // kappa 0.5, speed 0.2; forward, lateral, yaw rate, wheel rates; and decimals printed.
    let table: [Row; 7] = [
        (
            &[],
            [0.19907, 0.0, 0.09959],
            5,
            [2.159, 2.115, 2.159, 2.895, 2.862, 2.895],
        ),
        (
            &[0],
            [0.1799, -0.00121, 0.12235],
            4,
            [0.0, 2.059, 2.079, 2.865, 2.827, 2.859],
        ),
        (
            &[1],
            [0.1781, -0.00019, 0.13202],
            4,
            [2.076, 0.0, 2.096, 2.870, 2.830, 2.865],
        ),
        (
            &[2],
            [0.1895, 0.00080, 0.11092],
            4,
            [2.118, 2.060, 0.0, 2.879, 2.843, 2.877],
        ),
        (
            &[3],
            [0.1734, -0.00535, 0.04904],
            4,
            [2.115, 2.078, 2.109, 0.0, 2.803, 2.780],
        ),
        (
            &[4],
            [0.1753, -0.00033, 0.05927],
            4,
            [2.114, 2.074, 2.103, 2.801, 0.0, 2.827],
        ),
        (
            &[5],
            [0.1871, 0.00182, 0.07591],
            4,
            [2.137, 2.096, 2.133, 2.839, 2.798, 0.0],
        ),
    ];
    for (stuck, velocity, decimals, rates) in table {
        let found = solve(0.5, 0.2, stuck);
        let what = format!("stuck {stuck:?}");
        close(found.velocity[0], velocity[0], decimals, &what);
        close(found.velocity[1], velocity[1], 5, &what);
        close(found.velocity[2], velocity[2], 5, &what);
        for (wheel, expected) in rates.into_iter().enumerate() {
            close(found.wheel_rate_rad_s[wheel], expected, 3, &what);
        }
    }
}

#[test]
fn straight_driving_turns_toward_a_stuck_left_wheel() {
    for (wheel, expected) in [(0, 0.0385), (1, 0.0364), (2, 0.0185)] {
        let what = format!("stuck wheel {wheel}");
        close(solve(0.0, 0.2, &[wheel]).velocity[2], expected, 4, &what);
        let mirrored = solve(0.0, 0.2, &[MIRROR[wheel]]).velocity[2];
        close(mirrored, -expected, 4, &what);
    }
    let nominal = solve(0.0, 0.2, &[]);
    assert!(nominal.velocity[1].abs() < 1e-12 && nominal.velocity[2].abs() < 1e-12);
}

#[test]
fn mirroring_the_situation_mirrors_the_motion() {
    for stuck in [&[][..], &[0], &[1], &[2], &[0, 1], &[2, 3], &[0, 4, 5]] {
        for curvature in [-0.9, -0.2, 0.0, 0.35, 1.0] {
            let here = solve(curvature, 0.2, stuck);
            let mirrored: Vec<usize> = stuck.iter().map(|&i| MIRROR[i]).collect();
            let there = solve(-curvature, 0.2, &mirrored);
            let signs = [1.0, -1.0, -1.0];
            for (axis, sign) in signs.into_iter().enumerate() {
                let off = (here.velocity[axis] - sign * there.velocity[axis]).abs();
                assert!(off < 1e-7, "{stuck:?} {curvature} axis {axis}: {off}");
            }
            for (i, other) in MIRROR.into_iter().enumerate() {
                let (rate, load) = (there.wheel_rate_rad_s[other], there.load_n[other]);
                assert!((here.wheel_rate_rad_s[i] - rate).abs() < 1e-6);
                assert!((here.load_n[i] - load).abs() < 1e-5);
            }
        }
    }
}

#[test]
fn motor_torques_lie_in_the_reference_ranges() {
    for torque in solve(0.5, 0.2, &[]).torque_n_m {
        assert!((0.055..=0.085).contains(&torque), "nominal torque {torque}");
    }
    let stuck = solve(0.5, 0.2, &[LM]);
    for (wheel, torque) in stuck.torque_n_m.into_iter().enumerate() {
        if wheel == LM {
            assert_eq!(torque, 6.0, "a locked motor pushes at its limit");
        } else {
            assert!((0.225..=0.565).contains(&torque), "wheel {wheel}: {torque}");
        }
    }
}

#[test]
fn heading_rates_match_the_reference_table_over_the_radius() {
    // Change against nominal in percent, left turn, by radius; LF LM LR RF RM RR.
    let table = [
        (1.0, [2.5, 14.5, 1.2, -30.0, -22.6, -14.1]),
        (2.0, [22.9, 32.6, 11.4, -50.8, -40.5, -23.8]),
        (4.0, [62.0, 69.0, 31.0, -90.0, -77.0, -43.0]),
        (6.0, [101.0, 106.0, 49.0, -129.0, -114.0, -62.0]),
        (10.0, [179.0, 179.0, 87.0, -207.0, -187.0, -99.0]),
    ];
    for (radius, row) in table {
        let nominal = solve(1.0 / radius, 0.2, &[]).velocity[2];
        for (wheel, expected) in row.into_iter().enumerate() {
            let turned = solve(1.0 / radius, 0.2, &[wheel]).velocity[2];
            let change = 100.0 * (turned / nominal - 1.0);
            let tolerance = (0.03 * f64::abs(expected)).max(1.5);
            assert!(
                (change - expected).abs() <= tolerance,
                "radius {radius}, wheel {wheel}: {change} %, expected {expected} %"
            );
        }
    }
}

#[test]
fn a_stuck_wheel_adds_yaw_toward_its_own_side_at_every_radius() {
    for curvature in [-1.0, -0.5, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0] {
        for speed in [0.1, 0.2, 0.3] {
            let nominal = solve(curvature, speed, &[]).velocity[2];
            for wheel in 0..6 {
                let added = solve(curvature, speed, &[wheel]).velocity[2] - nominal;
                let side = if wheel < 3 { 1.0 } else { -1.0 };
                assert!(
                    added * side > 0.0,
                    "{curvature} {speed} wheel {wheel}: {added}"
                );
            }
        }
    }
}

#[test]
fn at_rest_every_wheel_bears_a_sixth_of_the_weight() {
    let rest = solve(0.5, 0.0, &[LM]);
    assert_eq!(rest.velocity, [0.0; 3]);
    assert_eq!(rest.wheel_rate_rad_s, [0.0; 6]);
    for load in rest.load_n {
        assert!((load - 14.2 * 9.81 / 6.0).abs() < 1e-9, "{load}");
    }
}

#[test]
fn moving_forces_and_loads_add_up() {
    // Traction of free wheels pays for the dragged one; each side bears half of the weight.
    for stuck in [&[][..], &[0], &[4], &[2, 5]] {
        let found = solve(0.4, 0.2, stuck);
        let half = 0.5 * 14.2 * 9.81;
        for side in [[0, 1, 2], [3, 4, 5]] {
            let sum: f64 = side.iter().map(|&i| found.load_n[i]).sum();
            assert!((sum - half).abs() < 1e-9, "{stuck:?}: {sum}");
        }
    }
}

fn sets_up_to(size: u32) -> impl Iterator<Item = Vec<usize>> {
    (0_u32..64)
        .filter(move |mask| mask.count_ones() <= size)
        .map(|mask| (0..6).filter(|i| mask >> i & 1 == 1).collect())
}

#[test]
fn every_set_of_up_to_three_stuck_wheels_converges() {
    let model = model();
    for stuck in sets_up_to(3) {
        for step in -12..=12 {
            for speed in [0.02, 0.1, 0.2, 0.3, 0.5] {
                let asked = situation(f64::from(step) * 0.1, speed, &stuck);
                let found = model.solve(&asked, None);
                let found = found.unwrap_or_else(|e| panic!("{asked:?}: {e}"));
                let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
                assert!(finite(&found.velocity) && finite(&found.wheel_rate_rad_s));
                for &wheel in &stuck {
                    assert_eq!(found.wheel_rate_rad_s[wheel], 0.0);
                }
            }
        }
    }
}

#[test]
fn up_to_two_stuck_wheels_converge_on_every_allowed_soil() {
    let model = model();
    for stuck in sets_up_to(2) {
        for curvature in [-1.2, -0.5, 0.0, 0.3, 1.0] {
            for (friction, modulus) in [
                (0.1, 0.2),
                (0.4, 0.05),
                (0.65, 0.02),
                (0.9, 0.4),
                (2.0, 0.2),
                (2.0, 2.0),
            ] {
                let mut asked = situation(curvature, 0.2, &stuck);
                asked.soil = Soil::uniform(friction, modulus);
                let found = model.solve(&asked, None);
                assert!(found.is_ok(), "{asked:?}: {found:?}");
            }
        }
    }
}

proptest::proptest! {
    #[test]
    fn patchy_soil_under_up_to_three_stuck_wheels_converges(
        friction in proptest::array::uniform6(0.3_f64..1.0),
        shear_modulus in 0.08_f64..0.6,
        curvature in -1.2_f64..1.2,
        speed in 0.01_f64..0.5,
        stuck in proptest::sample::subsequence(vec![0, 1, 2, 3, 4, 5], 0..=3),
    ) {
        let mut asked = situation(curvature, speed, &stuck);
        asked.soil = Soil { friction, shear_modulus };
        let found = model().solve(&asked, None);
        proptest::prop_assert!(found.is_ok(), "{found:?}");
    }
}

#[test]
fn a_warm_start_reaches_the_same_equilibrium_sooner() {
    let model = model();
    let before = model.solve(&situation(0.50, 0.2, &[LM]), None).unwrap();
    let asked = situation(0.51, 0.2, &[LM]);
    let cold = model.solve(&asked, None).unwrap();
    let warm = model.solve(&asked, Some(&before.unknowns())).unwrap();
    assert!(warm.iterations < cold.iterations, "{warm:?} {cold:?}");
    for axis in 0..3 {
        assert!((warm.velocity[axis] - cold.velocity[axis]).abs() < 1e-9);
    }
    let garbage = before.unknowns() * f64::NAN;
    let found = model.solve(&asked, Some(&garbage)).unwrap();
    assert_eq!(found.velocity, cold.velocity);
}

#[test]
fn four_stuck_wheels_hold_the_rover_while_the_others_spin() {
    let found = solve(0.5, 0.2, &[0, 1, 2, 3]);
    assert_eq!(found.velocity, [0.0; 3]);
    let commanded = model().kinematics().targets(0.5, 0.2).rate_rad_s;
    for wheel in [4, 5] {
        let rate = found.wheel_rate_rad_s[wheel];
        assert!(
            rate > 0.9 * commanded[wheel] && rate < commanded[wheel],
            "{rate}"
        );
        // Shear at full slip, times load and radius, plus the bearing: what the motor must give.
        let load = 14.2 * 9.81 / 6.0;
        let shear = 0.65 * (1.0 - (-5.0_f64).exp()) * load * 0.08;
        let expected = shear + 0.02 + 0.02 * rate;
        assert!((found.torque_n_m[wheel] - expected).abs() < 1e-9);
    }
}

#[test]
fn impossible_input_is_refused_by_name() {
    let model = model();
    for value in [f64::NAN, f64::INFINITY] {
        let found = model.solve(&situation(value, 0.2, &[]), None);
        assert_eq!(found, Err(SlipError::Input("curvature_1_m")));
        let found = model.solve(&situation(0.1, value, &[]), None);
        assert_eq!(found, Err(SlipError::Input("speed_m_s")));
    }
    let mut asked = situation(0.1, 0.2, &[]);
    asked.soil.friction[3] = 0.0;
    assert_eq!(model.solve(&asked, None), Err(SlipError::Input("friction")));
}

#[test]
fn other_robots_are_refused_with_a_reason() {
    let mut five = rover();
    five.wheels.pop();
    let error = SlipModel::new(&five).unwrap_err().to_string();
    assert!(error.contains("5 wheels"), "{error}");
    let mut one_sided = rover();
    one_sided.wheels[0].y = -0.3;
    let error = SlipModel::new(&one_sided).unwrap_err().to_string();
    assert!(
        error.contains("2 wheels with y above 0 and 4 below"),
        "{error}"
    );
    let mut short = rover();
    short.wheels[2].x = -0.1;
    let error = SlipModel::new(&short).unwrap_err().to_string();
    assert!(
        error.contains("left") && error.contains("-0.175"),
        "{error}"
    );
    let mut high = rover();
    high.linkage.as_mut().unwrap().bogie_z_m = 0.25;
    let error = SlipModel::new(&high).unwrap_err().to_string();
    assert!(error.contains("0.25 m (bogie)"), "{error}");
    let mut motorless = rover();
    motorless.motor = None;
    let error = SlipModel::new(&motorless).unwrap_err().to_string();
    assert!(error.contains("no table [motor]"), "{error}");
    let mut weak = rover();
    weak.motor.as_mut().unwrap().torque_max_n_m = 0.0;
    let error = SlipModel::new(&weak).unwrap_err().to_string();
    assert!(error.contains("motor.torque_max_n_m is 0"), "{error}");
    let mut weightless = rover();
    weightless.mass_kg = f64::NAN;
    let error = SlipModel::new(&weightless).unwrap_err().to_string();
    assert!(error.contains("mass_kg"), "{error}");
}

//! How far a loss of torque moves the motors' currents, against what hides it.
//!
//! The equilibrium of forces gives the six currents of a rover with one weak motor, and how they
//! scatter with the soil; the current sensors' noise is the description's. From both follows the
//! noncentrality of the best test there is: of one that knows the wheel, the share lost and the
//! instant. No filter notices what this test does not.

use nalgebra::{SMatrix, SVector};
use vigil_robot::Description;
use vigil_robot::slip::{Condition, Situation, SlipModel, Soil};

/// Of the simulated motors, A/(N m).
const CURRENT_PER_TORQUE: f64 = 2.0;
/// Time in which a loss is to be noticed, s.
const WITHIN_S: f64 = 2.0;
/// Scatter of the soil's friction, relative, and its correlation length, m.
const SCATTER: f64 = 0.08;
const SCATTER_LENGTH_M: f64 = 0.2;

type Currents = SVector<f64, 6>;

fn currents(
    slip: &SlipModel,
    (curvature_1_m, speed_m_s): (f64, f64),
    soil: Soil,
    (wheel, lost): (usize, f64),
) -> Currents {
    let mut condition = Condition::default();
    condition.wheels[wheel].torque_share = 1.0 - lost;
    let situation = Situation {
        curvature_1_m,
        speed_m_s,
        stuck: [false; 6],
        soil,
        condition,
    };
    let solution = slip.solve(&situation, None).unwrap();
    Currents::from(solution.torque_n_m) * CURRENT_PER_TORQUE
}

/// Covariance of the currents by the soil at one instant.
fn of_soil(slip: &SlipModel, drive: (f64, f64)) -> SMatrix<f64, 6, 6> {
    let mut sum = SMatrix::zeros();
    for wheel in 0..6 {
        let with = |factor: f64| {
            let mut soil = Soil::uniform(0.65, 0.2);
            soil.friction[wheel] *= factor;
            currents(slip, drive, soil, (0, 0.0))
        };
        let slope = (with(1.04) - with(0.96)) / 0.08;
        sum += slope * slope.transpose() * (SCATTER * SCATTER);
    }
    sum
}

#[test]
fn the_best_test_sees_half_a_motors_torque_by_three_to_four_deviations_in_two_seconds() {
    let text = include_str!("../../../../config/robots/rover.toml");
    let robot: Description = toml::from_str(text).unwrap();
    let slip = SlipModel::new(&robot).unwrap();
    let sample = robot.noise.current_a;
    let samples = robot.noise.reference_rate_hz * WITHIN_S;
    let mut found = [
        (0.3, 1.3..1.9),
        (0.5, 2.7..4.1),
        (0.7, 4.5..8.3),
        (1.0, 9.0..36.0),
    ];
    for (lost, expected) in &mut found {
        for speed in [0.1, 0.2, 0.3] {
            for curvature in [-1.0, -0.5, 0.0, 0.5, 1.0] {
                let drive = (curvature, speed);
                let soil = of_soil(&slip, drive);
                // The ground of one friction or another is a tenth of a sensor's noise over 2 s.
                assert!(soil.diagonal().max().sqrt() < 0.1 * sample / samples.sqrt());
                // Of the mean over a path of so many correlation lengths.
                let lengths = speed * WITHIN_S / SCATTER_LENGTH_M;
                let kept = 2.0 / lengths * (1.0 - (1.0 - (-lengths).exp()) / lengths);
                let noise = SMatrix::<f64, 6, 6>::identity() * (sample * sample / samples);
                let inverse = (soil * kept + noise).try_inverse().unwrap();
                let healthy = currents(&slip, drive, Soil::uniform(0.65, 0.2), (0, 0.0));
                for wheel in 0..6 {
                    let weak = currents(&slip, drive, Soil::uniform(0.65, 0.2), (wheel, *lost));
                    let moved = weak - healthy;
                    // The others carry most of what it does not, in tight turns least.
                    assert!(moved.sum().abs() < 0.5 * moved[wheel].abs());
                    let deviations = moved.dot(&(inverse * moved)).sqrt();
                    assert!(
                        expected.contains(&deviations),
                        "{lost} of wheel {wheel} at {drive:?}: {deviations}"
                    );
                }
            }
        }
    }
}

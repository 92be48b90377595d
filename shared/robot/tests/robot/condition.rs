//! The slip model on a rover that is not as built: forces and moments recomputed from the solution.

use vigil_robot::slip::shear::{Contact, Heading, HubVelocity};
use vigil_robot::slip::{Condition, Situation, SlipModel, Soil, WheelCondition};

use crate::rover::rover;

const X: [f64; 6] = [0.35, 0.0, -0.35, 0.35, 0.0, -0.35];
const Y: [f64; 6] = [0.30, 0.30, 0.30, -0.30, -0.30, -0.30];
const WEIGHT_N: f64 = 14.2 * 9.81;

fn situation(condition: Condition) -> Situation {
    Situation {
        curvature_1_m: 0.5,
        speed_m_s: 0.2,
        stuck: [false; 6],
        soil: Soil::uniform(0.65, 0.2),
        condition,
    }
}

/// A condition with everything in it, more of each the larger `scale`.
fn everything(scale: f64) -> Condition {
    let mut wheels = [WheelCondition::default(); 6];
    wheels[0].steer_offset_rad = 0.2 * scale;
    wheels[1].torque_share = 1.0 - 0.7 * scale;
    wheels[2].radius_share = 1.0 - 0.2 * scale;
    wheels[3].resistance = 0.3 * scale;
    wheels[4].drag_n = 20.0 * scale;
    Condition {
        wheels,
        force_n: [-10.0 * scale, 5.0 * scale],
        slope_rad: 0.1 * scale,
        side_slope_rad: -0.1 * scale,
        mass_offset_m: [0.05 * scale, -0.1 * scale],
    }
}

#[test]
fn forces_moments_and_torques_balance_on_a_rover_that_is_not_as_built() {
    let model = SlipModel::new(&rover()).unwrap();
    for scale in [0.0, 0.3, 1.0, -0.0] {
        let asked = situation(everything(scale));
        let found = model.solve(&asked, None).unwrap();
        let [vx, vy, omega] = found.velocity;
        let condition = &asked.condition;
        let (ahead, left) = (condition.slope_rad.sin(), condition.side_slope_rad.sin());
        let gravity = [-WEIGHT_N * ahead, -WEIGHT_N * left];
        let [mx, my] = condition.mass_offset_m;
        let mut sum = [
            gravity[0] + condition.force_n[0],
            gravity[1] + condition.force_n[1],
            mx * gravity[1] - my * gravity[0],
        ];
        let targets = model.kinematics().targets(0.5, 0.2);
        for i in 0..6 {
            let wheel = condition.wheels[i];
            let hub = HubVelocity {
                forward_m_s: vx - omega * Y[i],
                left_m_s: vy + omega * X[i],
            };
            let (sin, cos) = (targets.steer_rad[i] + wheel.steer_offset_rad).sin_cos();
            let radius_m = 0.08 * wheel.radius_share;
            let rate = found.wheel_rate_rad_s[i];
            let shear = Contact {
                heading: Heading { cos, sin },
                radius_m,
                friction: 0.65,
                shear_modulus: 0.2,
                resistance: 0.0,
            }
            .shear(hub, rate);
            let load_n = found.load_n[i];
            let along = hub.forward_m_s * cos + hub.left_m_s * sin;
            let ploughing = -wheel.resistance * load_n * (along / 0.01).tanh();
            let speed = (hub.forward_m_s.powi(2) + hub.left_m_s.powi(2) + 1e-4).sqrt();
            let fx = load_n * shear.x + ploughing * cos - wheel.drag_n * hub.forward_m_s / speed;
            let fy = load_n * shear.y + ploughing * sin - wheel.drag_n * hub.left_m_s / speed;
            sum[0] += fx;
            sum[1] += fy;
            sum[2] += X[i] * fy - Y[i] * fx;
            let bearing = 0.02 * rate + 0.02 * (rate / 0.01).tanh();
            let motor = wheel.torque_share * 6.0 * (targets.rate_rad_s[i] - rate);
            let torque = motor - bearing - load_n * shear.along * radius_m;
            assert!(torque.abs() < 1e-7, "{scale}: wheel {i}: {torque}");
            assert!((motor - found.torque_n_m[i]).abs() < 1e-12);
        }
        assert!(
            sum.iter().all(|value| value.abs() < 1e-6),
            "{scale}: {sum:?}"
        );
    }
}

#[test]
fn static_loads_carry_the_weight_where_it_is() {
    let model = SlipModel::new(&rover()).unwrap();
    for condition in [
        Condition::default(),
        Condition {
            mass_offset_m: [0.06, -0.1],
            ..Condition::default()
        },
        Condition {
            side_slope_rad: 0.2,
            force_n: [0.0, 7.0],
            ..Condition::default()
        },
    ] {
        let mut asked = situation(condition);
        asked.speed_m_s = 0.0;
        let load_n = model.solve(&asked, None).unwrap().load_n;
        let moment = |arm: &[f64; 6]| load_n.iter().zip(arm).map(|(n, a)| n * a).sum::<f64>();
        let slope = condition.side_slope_rad;
        let normal = WEIGHT_N * slope.cos();
        let sideways = condition.force_n[1] - WEIGHT_N * slope.sin();
        assert!((load_n.iter().sum::<f64>() - normal).abs() < 1e-9);
        assert!((moment(&X) - normal * condition.mass_offset_m[0]).abs() < 1e-9);
        let expected = normal * condition.mass_offset_m[1] + sideways * 0.28;
        assert!((moment(&Y) - expected).abs() < 1e-9);
    }
}

#[test]
fn impossible_conditions_are_refused() {
    let model = SlipModel::new(&rover()).unwrap();
    let spoils: [fn(&mut Condition); 4] = [
        |c| c.force_n[1] = f64::NAN,
        |c| c.wheels[2].torque_share = 1.1,
        |c| c.wheels[0].radius_share = 0.0,
        |c| c.slope_rad = f64::INFINITY,
    ];
    for spoil in spoils {
        let mut condition = Condition::default();
        spoil(&mut condition);
        let refused = model.solve(&situation(condition), None).unwrap_err();
        assert!(
            refused.to_string().starts_with("condition is impossible"),
            "{refused}"
        );
    }
}

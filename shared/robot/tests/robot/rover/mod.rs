//! The six-wheel rover, as built.

use vigil_robot::Description;
use vigil_robot::chassis::{Ground, Motor, RockerBogie};
use vigil_robot::description::{Kinematics, Limits, SensorNoise, Wheel};

/// Its description.
pub fn rover() -> Description {
    let places = [
        ("LF", 0.35, 0.30),
        ("LM", 0.0, 0.30),
        ("LR", -0.35, 0.30),
        ("RF", 0.35, -0.30),
        ("RM", 0.0, -0.30),
        ("RR", -0.35, -0.30),
    ];
    Description {
        name: "rover".into(),
        kinematics: Kinematics::Ackermann6,
        wheel_radius_m: 0.08,
        mass_kg: 14.2,
        command: Vec::new(),
        channel: Vec::new(),
        fault: Vec::new(),
        context: Vec::new(),
        warm_up_s: 0.0,
        measured: vigil_robot::description::MeasuredChannels::default(),
        polynomial_order: 4,
        interval_s: 0.1,
        wheels: places
            .iter()
            .map(|&(name, x, y)| Wheel {
                name: name.into(),
                x,
                y,
                steered: x != 0.0,
            })
            .collect(),
        noise: SensorNoise {
            reference_rate_hz: 20.0,
            position_m: 0.005,
            yaw_rad: 0.005,
            yaw_rate_rad_s: 0.01,
            wheel_rate_rad_s: 0.05,
            steer_rad: 0.003,
            current_a: 0.05,
        },
        tolerance: None,
        motor: Some(Motor {
            gain_n_m_s: 6.0,
            torque_max_n_m: 6.0,
            dry_friction_n_m: 0.02,
            viscous_friction_n_m_s: 0.02,
        }),
        linkage: Some(RockerBogie {
            rocker_x_m: 0.0,
            rocker_z_m: 0.28,
            bogie_x_m: -0.175,
            bogie_z_m: 0.18,
        }),
        ground: Some(Ground {
            friction: 0.65,
            shear_modulus: 0.2,
        }),
        body: vigil_robot::Body::default(),
        fault_prior: vigil_robot::FaultPrior::default(),
        limits: Limits {
            curvature_1_m: 1.2,
            speed_m_s: 0.5,
            yaw_rate_rad_s: 2.0,
            wheel_rate_rad_s: 40.0,
        },
    }
}

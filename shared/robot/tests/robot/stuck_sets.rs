//! Several stuck wheels, of which nothing was learned together, on soils that they do not know.

use vigil_robot::learned::{Mover, motion_modes};
use vigil_robot::slip::{Condition, Situation, SlipModel, Soil};

use crate::learned::{model, robot};

#[test]
fn the_motion_of_every_set_lies_within_what_its_mode_expects() {
    const SPEED_M_S: f64 = 0.2;
    const SOILS: [(f64, f64); 5] = [
        (0.65, 0.2),
        (0.6, 0.18),
        (0.7, 0.22),
        (0.5, 0.25),
        (0.8, 0.15),
    ];
    let (robot, model) = (robot(), model());
    let slip = SlipModel::new(&robot).unwrap();
    let modes = motion_modes(&model, &robot, 0b11_1111, false, true);
    let several = modes.iter().filter(|mode| match mode.moved {
        Mover::Stuck(wheels) => wheels.count_ones() > 1,
        _ => false,
    });
    let (mut count, mut squares, mut far) = (0_u32, 0.0_f64, Vec::new());
    for mode in several {
        let stuck = std::array::from_fn(|wheel| mode.moved.is_stuck(wheel));
        let turns = [-1.0, -0.5, -1.0 / 6.0, 0.0, 1.0 / 6.0, 0.5, 1.0];
        for (curvature, soil) in turns.iter().flat_map(|&k| SOILS.map(|soil| (k, soil))) {
            let (friction, modulus) = soil;
            let situation = Situation {
                curvature_1_m: curvature,
                speed_m_s: SPEED_M_S,
                stuck,
                soil: Soil::uniform(friction, modulus),
                condition: Condition::default(),
            };
            let [forward, _, yaw] = slip.solve(&situation, None).unwrap().velocity;
            let expected = mode.motion.per_metre(curvature, SPEED_M_S, 1.0);
            let noise = mode.noise_at(&model, curvature, SPEED_M_S).offset;
            let apart = [
                yaw / SPEED_M_S - expected[0],
                forward / SPEED_M_S - expected[1],
            ];
            for (axis, apart) in apart.into_iter().enumerate() {
                count += 1;
                let sd = noise[(axis, axis)].sqrt();
                squares += (apart / sd).powi(2);
                if apart.abs() > 2.0 * sd {
                    far.push((mode.moved, curvature, axis, apart / sd));
                }
            }
        }
    }
    assert_eq!(count, (64 - 1 - 6) * 7 * 5 * 2);
    assert!(far.len() * 20 <= count as usize, "{far:?}");
    // Nor is the mode so wide that anything would fit, though wide: the soil is unknown, and four
    // stuck wheels and more stand exactly here.
    let rms = (squares / f64::from(count)).sqrt();
    assert!(rms > 0.15, "{rms}");
    assert!(far.iter().all(|(.., far)| far.abs() < 4.0), "{far:?}");
}

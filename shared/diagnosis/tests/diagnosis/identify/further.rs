//! What gyro and currents say of faults, on readings of which the answer is known.

use std::path::Path;

use vigil_blocks::WHEELS;
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify::LeafMap;
use vigil_diagnosis::identify::further::{FurtherFilter, Fusion};
use vigil_robot::Description;
use vigil_robot::FaultTree;
use vigil_robot::learned::current_effects::{CurrentEffects, SHARES, STUCK};
use vigil_robot::learned::further_watch::{Residual, Residuals};
use vigil_robot::learned::{Further, Model, Observation, Reading};

/// Sensor noise of a current, A, and of the gyro, rad/s.
const NOISE_A: f64 = 0.05;
const NOISE_RAD_S: f64 = 0.01;
const DRIVE: [f64; 2] = [0.3, 0.2];

struct Rover {
    model: Model,
    robot: Description,
    tree: FaultTree,
}

impl Rover {
    fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        let robot = vigil_setup::load_robot(&root.join("robots/rover.toml")).unwrap();
        let model = vigil_setup::load_model(&root.join("models/rover.toml"), Some(&robot)).unwrap();
        Self {
            model: model.with_faults().unwrap(),
            robot,
            tree: vigil_setup::load_tree(&root.join("trees/rover-all.toml")).unwrap(),
        }
    }

    fn filter(&self) -> FurtherFilter {
        let leaves = LeafMap::new(&self.tree, &self.model, &self.robot, Sensors::All).unwrap();
        FurtherFilter::new(&self.model, &self.robot, &leaves, 0.01).unwrap()
    }

    /// Current that a healthy wheel carries, A.
    fn carried(&self, wheel: usize) -> f64 {
        let rolling =
            vigil_robot::learned::wheels::rolling_rate(&self.robot, wheel, DRIVE[0], DRIVE[1]);
        let further = self.model.further.as_ref().unwrap();
        further.currents.as_ref().unwrap().wheels[wheel].current_a(rolling, DRIVE[0])
    }

    /// Odds of a leaf over none.
    fn odds(&self, fusion: &Fusion, leaf: &str) -> f64 {
        let node = self.tree.index(leaf).unwrap();
        let known = fusion.nodes[..fusion.count].iter();
        known.filter(|it| it.0 == node).map(|it| it.1).sum()
    }

    /// After so many seconds in which the currents depart by these and the yaw rate by that.
    fn after(&self, seconds: f64, currents: [f64; WHEELS], yaw_rate: f64) -> Fusion {
        self.changing(seconds, |_| (currents, yaw_rate))
    }

    /// The same where they change from observation to observation.
    fn changing(&self, seconds: f64, apart: impl Fn(usize) -> ([f64; WHEELS], f64)) -> Fusion {
        let mut filter = self.filter();
        let observation = Observation {
            dt_s: 0.05,
            command: DRIVE,
            moving: true,
            ..Observation::default()
        };
        let read = Reading {
            plain: 1,
            ..Reading::default()
        };
        let further = Further {
            yaw_rate: read,
            currents: [read; WHEELS],
        };
        let residual = |apart: f64, sd: f64, expected: f64| Residual {
            apart,
            variance: sd * sd,
            expected,
            outlier_rate: 1e-10,
        };
        for k in 0..(seconds / 0.05) as usize {
            let (currents, yaw_rate) = apart(k);
            let residuals = Residuals {
                currents: std::array::from_fn(|wheel| {
                    (wheel < 6).then(|| residual(currents[wheel], NOISE_A, self.carried(wheel)))
                }),
                yaw_rate: Some(residual(yaw_rate, NOISE_RAD_S, 0.06)),
            };
            filter.step(&observation, &further, &residuals);
        }
        filter.fusion()
    }

    fn effect(&self, kind: usize, wheel: usize) -> [f64; WHEELS] {
        let effects = CurrentEffects::new(&self.model, &self.robot).unwrap();
        let carried = self.carried(wheel);
        effects
            .at(kind, wheel, DRIVE[0], DRIVE[1])
            .map(|it| it * carried)
    }
}

#[test]
fn channels_that_are_not_read_move_no_odds() {
    let rover = Rover::read();
    let mut filter = rover.filter();
    let observation = Observation {
        dt_s: 0.05,
        command: DRIVE,
        moving: true,
        ..Observation::default()
    };
    for _ in 0..2000 {
        filter.step(&observation, &Further::default(), &Residuals::default());
    }
    let fusion = filter.fusion();
    for factor in fusion.stuck[..6].iter().chain([&fusion.unknown.0]) {
        assert!((factor - 1.0).abs() < 1e-6, "{factor}");
    }
    // No leaf becomes likely while nothing shows it; a channel that is read shows its own alone.
    let zero = Residual {
        apart: 0.0,
        variance: 1.0,
        expected: 0.0,
        outlier_rate: 1e-10,
    };
    let read = Reading {
        plain: 1,
        ..Reading::default()
    };
    for (further, hidden) in [
        (Further::default(), ["LM_TORQUE", "GYRO"].as_slice()),
        (
            Further {
                yaw_rate: read,
                ..Further::default()
            },
            &["LM_TORQUE", "LM_CURRENT"],
        ),
        (
            Further {
                currents: [read; WHEELS],
                ..Further::default()
            },
            &["GYRO"],
        ),
    ] {
        let mut filter = rover.filter();
        let residuals = Residuals {
            currents: further.currents.map(|it| (it.plain > 0).then_some(zero)),
            yaw_rate: (further.yaw_rate.plain > 0).then_some(zero),
        };
        (0..2000).for_each(|_| filter.step(&observation, &further, &residuals));
        for leaf in hidden {
            let odds = rover.odds(&filter.fusion(), leaf);
            assert!(odds < 1e-6, "{leaf}: {odds}");
        }
    }
}

#[test]
fn a_weak_motor_a_broken_sensor_and_a_stuck_wheel_are_told_apart() {
    let rover = Rover::read();
    for wheel in 0..6 {
        let name = &rover.robot.wheels[wheel].name;
        let leaf = |kind: &str| format!("{name}_{kind}");
        // All torque lost: the others carry it.
        let lost = rover.effect(SHARES.len() - 1, wheel);
        assert!((lost[wheel] + rover.carried(wheel)).abs() < 0.01);
        assert!(lost.iter().sum::<f64>().abs() < 0.15 * rover.carried(wheel));
        let fusion = rover.after(2.0, lost, 0.0);
        let torque = rover.odds(&fusion, &leaf("TORQUE"));
        assert!(torque > 1e3 && torque > 10.0 * rover.odds(&fusion, &leaf("CURRENT")));
        // A sensor: they do not.
        let mut off = [0.0; WHEELS];
        off[wheel] = 0.15;
        let fusion = rover.after(2.0, off, 0.0);
        let current = rover.odds(&fusion, &leaf("CURRENT"));
        assert!(current > 1e3 && current > 10.0 * rover.odds(&fusion, &leaf("TORQUE")));
        // A stuck wheel's motor strains; a dead encoder's carries its usual current.
        let strained = rover.after(0.2, rover.effect(STUCK, wheel), 0.0);
        let usual = rover.after(0.2, [0.0; WHEELS], 0.0);
        assert!(strained.stuck[wheel] > 1e6 && usual.stuck[wheel] < 1e-3);
    }
    let fusion = rover.after(1.0, [0.0; WHEELS], 0.05);
    assert!(rover.odds(&fusion, "GYRO") > 1e3);
}

#[test]
fn a_gyro_that_reads_half_or_is_noisy_and_a_noisy_current_sensor_are_named() {
    let rover = Rover::read();
    // It turns at 0.06 rad/s.
    for gain in [0.5, 2.0, -1.0] {
        let fusion = rover.after(2.0, [0.0; WHEELS], (gain - 1.0) * 0.06);
        assert!(rover.odds(&fusion, "GYRO") > 1e3, "{gain}");
    }
    let noise = |k: usize, sd: f64| 20.0 * sd * [1.0, -1.0, -0.2, 0.4][k % 4];
    let fusion = rover.changing(2.0, |k| ([0.0; WHEELS], noise(k, NOISE_RAD_S)));
    assert!(rover.odds(&fusion, "GYRO") > 1e3);
    let fusion = rover.changing(2.0, |k| {
        let mut currents = [0.0; WHEELS];
        currents[1] = noise(k, NOISE_A);
        (currents, 0.0)
    });
    assert!(rover.odds(&fusion, "LM_CURRENT") > 1e3);
    for other in ["GYRO", "LM_TORQUE", "RM_CURRENT"] {
        assert!(rover.odds(&fusion, other) < 0.05, "{other}");
    }
}

#[test]
fn what_slopes_add_to_all_currents_is_no_fault() {
    let rover = Rover::read();
    let fusion = rover.after(5.0, [0.2; WHEELS], 0.0);
    for wheel in &rover.robot.wheels {
        for kind in ["TORQUE", "CURRENT"] {
            let odds = rover.odds(&fusion, &format!("{}_{kind}", wheel.name));
            assert!(odds < 0.05, "{} {kind}: {odds}", wheel.name);
        }
    }
}

//! Learning from the recorded rover runs.

use vigil_learning::learning::{LearnError, Options, learn};
use vigil_learning::split::split;
use vigil_recording::frames::{self, Run};
use vigil_recording::labels::{self, Label};
use vigil_robot::Description;
use vigil_robot::learned::Model;

use crate::rover::{path, robot};

fn data(robot: &Description) -> (Vec<Run>, Vec<Label>) {
    let root = path("tests/data/rover");
    let runs = frames::read(&root.join("learn_frames.csv.gz"), robot).unwrap();
    (
        runs,
        labels::read(&root.join("learn_runs.csv"), robot).unwrap(),
    )
}

/// Few evaluations: the noise models are rough, the polynomials are not.
fn quick() -> Options {
    Options {
        evaluations: 40,
        ..Options::default()
    }
}

#[test]
fn polynomials_match_an_independent_fit_and_held_out_runs_take_no_part() {
    let robot = robot();
    let (mut runs, labels) = data(&robot);
    let held_out = split(&labels, 0.333, 1);
    let (model, report) = learn(&runs, &labels, &held_out, &robot, &quick()).unwrap();
    // Yaw at κ^0 and κ^1 and forward at κ^0 of a least-squares fit to all runs, made elsewhere.
    let expected = [
        (0.1795, 0.8770, 0.888),
        (0.1945, 0.9499, 0.876),
        (0.0985, 0.9300, 0.937),
        (-0.1840, 0.8610, 0.884),
        (-0.2006, 0.9505, 0.872),
        (-0.0991, 0.9277, 0.937),
    ];
    wheels_yield_by_the_same_at_every_speed(&model);
    for (stuck, (yaw, slope, forward)) in model.stuck.iter().zip(expected) {
        let motion = &stuck.motion;
        assert!(
            (motion.yaw.curvature[0] - yaw).abs() < 0.012,
            "{}: {motion:?}",
            stuck.wheel
        );
        assert!(
            (motion.yaw.curvature[1] - slope).abs() < 0.04,
            "{}: {motion:?}",
            stuck.wheel
        );
        assert!(
            (motion.forward.curvature[0] - forward).abs() < 0.012,
            "{}",
            stuck.wheel
        );
    }
    let nominal = &model.nominal.motion;
    assert!(nominal.yaw.curvature[0].abs() < 0.002);
    assert!((nominal.yaw.curvature[1] - 0.9961).abs() < 0.004);
    assert!((nominal.forward.curvature[0] - 0.995).abs() < 0.002);
    assert!((model.noise.position_m - 0.005).abs() < 2e-4);
    assert!((model.noise.wheel_rate_rad_s - 0.05).abs() < 2e-3);
    assert_eq!(report.modes.len(), 7);
    for mode in &report.modes {
        assert!(
            mode.position_to_floor < 1.1 && mode.yaw_to_floor < 1.15,
            "{mode:?}"
        );
    }
    for run in runs.iter_mut().filter(|run| held_out.contains(&run.id)) {
        run.frames
            .iter_mut()
            .for_each(|frame| frame.channel[..3].fill(0.0));
    }
    let (again, _) = learn(&runs, &labels, &held_out, &robot, &quick()).unwrap();
    assert_eq!(again, model);
}

/// Means of recorded rates less rolling, rad/s, at 0.1, 0.2 and 0.3 m/s on curvatures up to
/// 0.35 /m, taken from the runs elsewhere: stuck wheel, turning wheel.
fn wheels_yield_by_the_same_at_every_speed(model: &Model) {
    let expected = [
        (0, 2, [-0.102, -0.107, -0.115]),
        (1, 0, [-0.099, -0.100, -0.103]),
        (2, 3, [-0.027, -0.028, -0.032]),
        (3, 5, [-0.111, -0.105, -0.115]),
        (4, 4, [0.0; 3]),
        (5, 4, [-0.068, -0.077, -0.081]),
    ];
    for (stuck, wheel, less) in expected {
        for (rolling, less) in [1.25, 2.5, 3.75].into_iter().zip(less) {
            let (rate, _) = model.stuck[stuck].rates[wheel].rate(rolling, 0.0);
            // A stuck wheel stands at any speed.
            let found = if stuck == wheel { rate } else { rate - rolling };
            assert!(
                (found - less).abs() < 0.015,
                "{stuck} {wheel} at {rolling}: {found} {less}"
            );
        }
    }
}

#[test]
fn data_that_cannot_support_a_fit_is_refused_by_what_is_missing() {
    let robot = robot();
    let (runs, labels) = data(&robot);
    let all = |keep: &dyn Fn(&Label) -> bool| -> String {
        let held_out: Vec<u32> = labels.iter().filter(|l| !keep(l)).map(|l| l.run).collect();
        learn(&runs, &labels, &held_out, &robot, &quick())
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        all(&|l| l.mode != "ND"),
        "0 runs of ND to learn from, at least 3 are needed"
    );
    assert_eq!(
        all(&|l| l.mode != "LM_STUCK"),
        "0 runs of LM_STUCK to learn from, at least 3 are needed"
    );
    let few = |l: &Label| {
        l.mode != "LM_STUCK" && l.mode != "RM_STUCK" || l.command_curvature_1_m.abs() > 0.9
    };
    assert_eq!(
        all(&few),
        "runs of LM_STUCK have 2 different curvatures, at least 5 are needed"
    );
    let error = learn(&runs[..1], &[], &[], &robot, &quick()).unwrap_err();
    assert_eq!(error, LearnError::Label(runs[0].id));
}

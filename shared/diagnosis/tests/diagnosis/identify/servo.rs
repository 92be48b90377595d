//! A steering servo that does not do as it is told, and a pose that is wrong, on a recorded healthy
//! run whose readings are changed.

use vigil_blocks::{Entry, FaultBelief, ParticleBlock, SensorFrame, SizeKind};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify;
use vigil_diagnosis::identify::{Identifier, Input, Models};

use super::alarm;
use crate::recorded;

/// When it breaks, s after the first frame.
const ONSET_S: f64 = 3.0;
/// Place of its channel.
const STEER_RF: usize = 11;
/// A healthy run in which the rover turns left, after 8 s right.
const RUN: u32 = 0;

fn time_s(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

/// The belief at the end of the run when `change` has acted on each frame from the onset on; the
/// alarm rises a third of a second later.
fn belief(mut change: impl FnMut(&mut SensorFrame)) -> (FaultBelief, [usize; 2]) {
    let robot = recorded::robot();
    let mut frames = recorded::healthy(RUN);
    let start_s = time_s(&frames[0]);
    let tree = vigil_setup::load_tree(&recorded::path("config/trees/rover-all.toml")).unwrap();
    let model = recorded::model();
    let models = Models {
        model: &model,
        robot: &robot,
        tree: &tree,
        risks: None,
    };
    let settings = identify::Settings::default();
    let sensors = Sensors::All;
    let mut identifier = Identifier::new(&models, &settings, sensors, 1).unwrap();
    let mut belief = FaultBelief::default();
    let mut particles: Box<ParticleBlock> = Box::default();
    let mut alarm = alarm::Alarm::between(start_s + ONSET_S + 0.3, f64::INFINITY);
    for frame in &mut frames {
        alarm.set(frame);
        if time_s(frame) - start_s >= ONSET_S {
            change(frame);
        }
        let detection = Some((&alarm.belief, &*alarm.hypotheses));
        let entry = Entry::Frame(Input { frame, detection });
        identifier.step(entry, &mut belief, &mut particles);
    }
    (
        belief,
        ["RF_STEER", "POSE"].map(|leaf| tree.index(leaf).unwrap()),
    )
}

fn check(change: impl FnMut(&mut SensorFrame), kind: SizeKind, size: f64) {
    let (belief, [servo, pose]) = belief(change);
    let leaf = if kind == SizeKind::JumpM { pose } else { servo };
    assert_eq!(belief.mode as usize, leaf, "{kind:?} {size}");
    let found = (belief.size[leaf], belief.size_sd[leaf]);
    assert_eq!(
        SizeKind::from_wire(belief.size_kind[leaf]),
        kind,
        "{found:?}"
    );
    assert!((found.0 - size).abs() < 0.1 * size.abs(), "{found:?}");
}

#[test]
fn a_servo_that_slipped_is_named_with_its_angle() {
    for angle_rad in [0.2, -0.1, 0.04] {
        check(
            |frame| frame.channel[STEER_RF] += angle_rad,
            SizeKind::AngleRad,
            angle_rad,
        );
    }
}

#[test]
fn a_servo_that_stands_at_an_angle_is_named_with_it() {
    for angle_rad in [0.3, -0.15] {
        let mut k = 0.0_f64;
        let stands = |frame: &mut SensorFrame| {
            k += 1.0;
            frame.channel[STEER_RF] = angle_rad + 0.003 * k.sin();
        };
        check(stands, SizeKind::HeldAtRad, angle_rad);
    }
}

#[test]
fn a_pose_that_jumped_is_named_with_its_distance() {
    check(|frame| frame.channel[1] += 0.3, SizeKind::JumpM, 0.3);
}

#[test]
fn a_single_pose_that_is_far_off_is_no_jump() {
    // With a pose in each frame, and in every second one.
    for (apart_m, every) in [(0.05, 1), (0.15, 1), (-0.5, 1), (0.15, 2)] {
        let mut count = 0;
        let (belief, [_, pose]) = belief(|frame| {
            count += 1;
            frame.channel[1] += if count == every { apart_m } else { 0.0 };
            if count % every > 0 {
                frame.channel_valid &= !0b111;
            }
        });
        let (p, p_unknown) = (belief.p[pose], belief.p_unknown);
        assert!(p < 0.05 && p_unknown < 0.05, "{apart_m}: {p} {p_unknown}");
    }
}

#[test]
fn a_servo_within_its_tolerance_is_none() {
    let (belief, [servo, _]) = belief(|frame| frame.channel[STEER_RF] += 0.007);
    assert!(belief.p[servo] < 0.05, "{}", belief.p[servo]);
}

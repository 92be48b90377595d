//! What the frames say, field by field.

use std::f64::consts::PI;

use vigil_blocks::SensorFrame;
use vigil_recording::frames::{Field, fields};
use vigil_robot::Description;
use vigil_robot::publisher_check::PublisherCheck;

use super::FrameArrival;
use crate::findings::{Finding, Status};

/// Commanded speed above which a robot is to move, m/s.
const MOVING_M_S: f64 = 0.02;
/// Frames with motion commanded from which a field that never changes is a finding.
const MOVING_FRAMES_MIN: usize = 50;

/// Largest yaw, rad: a publisher need not wrap it, but after so many turns it is no angle in rad.
const YAW_MAX_RAD: f64 = 60.0;

/// What one field held.
#[derive(Debug, Clone, Copy, Default)]
struct Stretch {
    measured: usize,
    not_finite: usize,
    least: f64,
    most: f64,
    /// Frames in which motion was commanded, and the extremes in those.
    moving: usize,
    moving_least: f64,
    moving_most: f64,
}

/// One finding for each field of the robot, and one about what they mean together.
pub fn findings(robot: &Description, frames: &[FrameArrival]) -> Vec<Finding> {
    let fields = fields(robot);
    let one = |(name, field): &(String, Field)| {
        judge(
            name,
            *field,
            robot,
            stretch(robot, *field, frames),
            frames.len(),
        )
    };
    let mut all: Vec<Finding> = fields.iter().map(one).collect();
    all.extend(meanings(robot, frames));
    all
}

fn is_moving(robot: &Description, frame: &SensorFrame) -> bool {
    robot.path_speed_m_s(robot.twist(&frame.command)) > MOVING_M_S
}

fn stretch(robot: &Description, field: Field, frames: &[FrameArrival]) -> Stretch {
    let mut found = Stretch {
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
        moving_least: f64::INFINITY,
        moving_most: f64::NEG_INFINITY,
        ..Stretch::default()
    };
    for FrameArrival { frame, .. } in frames {
        let Some(value) = field.get(frame) else {
            continue;
        };
        found.measured += 1;
        if !value.is_finite() {
            found.not_finite += 1;
            continue;
        }
        (found.least, found.most) = (found.least.min(value), found.most.max(value));
        if is_moving(robot, frame) {
            found.moving += 1;
            found.moving_least = found.moving_least.min(value);
            found.moving_most = found.moving_most.max(value);
        }
    }
    found
}

fn judge(name: &str, field: Field, robot: &Description, of: Stretch, frames: usize) -> Finding {
    let finding = |status, detail: String| Finding::new(name, status, detail);
    if of.measured == 0 {
        let detail = "never marked as valid, but the robot's description says that it is \
                      measured: set its bit in `valid`, or take it out of [measured]";
        return finding(Status::Failure, detail.into());
    }
    if of.not_finite > 0 {
        let detail = format!(
            "NaN or infinite in {} of {frames} frames: leave it 0 and its bit in `valid` unset",
            of.not_finite
        );
        return finding(Status::Failure, detail);
    }
    let mut detail = format!("{:.4} to {:.4}", of.least, of.most);
    if of.measured < frames {
        let share = 100.0 * of.measured as f64 / frames as f64;
        detail.push_str(&format!(", valid in {share:.0} % of the frames"));
    }
    let largest = of.least.abs().max(of.most.abs());
    if let Some(limit) = limit(field, robot).filter(|limit| largest > *limit) {
        let guess = unit_guess(field);
        let detail = format!("{detail}: beyond {limit:.3}, which the description allows{guess}");
        return finding(Status::Failure, detail);
    }
    // A steering angle may stay as it is in a steady curve.
    let may_stay = matches!(field, Field::Command(_) | Field::Steer(_));
    if !may_stay && of.moving >= MOVING_FRAMES_MIN && of.moving_least == of.moving_most {
        let detail = format!("{detail}: never changes, though motion is commanded");
        return finding(Status::Warning, detail);
    }
    finding(Status::Ok, detail)
}

/// Largest magnitude that makes sense.
fn limit(field: Field, robot: &Description) -> Option<f64> {
    let limits = &robot.limits;
    match field {
        Field::Command(i) => robot.command.get(i).map(|axis| 1.001 * axis.limit),
        // A wrapped angle may be rounded up.
        Field::Steer(_) => Some(PI + 1e-3),
        Field::Pose(2) => Some(YAW_MAX_RAD),
        Field::WheelRate(_) => Some(limits.wheel_rate_rad_s),
        Field::YawRate => Some(limits.yaw_rate_rad_s),
        Field::Pose(_) | Field::Current(_) => None,
    }
}

const fn unit_guess(field: Field) -> &'static str {
    match field {
        Field::Pose(2) => ": looks like degrees, rad is wanted",
        Field::Steer(_) => ". Looks like degrees: rad is wanted",
        Field::YawRate => ". Looks like degrees per second: rad/s is wanted",
        Field::WheelRate(_) => {
            ". Looks like degrees per second or revolutions per minute: rad/s is wanted"
        }
        _ => ". Is the unit right?",
    }
}

/// Units, signs and sides, from what the frames say about each other: the tests that run in the
/// graph.
fn meanings(robot: &Description, frames: &[FrameArrival]) -> Vec<Finding> {
    let mut check = PublisherCheck::new(robot);
    let found = frames.iter().filter_map(|f| check.take(&f.frame));
    let found = found.map(|finding| finding.text(robot));
    let failure = |detail| Finding::new("meaning", Status::Failure, detail);
    let all: Vec<Finding> = found.map(failure).collect();
    if !all.is_empty() {
        return all;
    }
    if !check.has_judged() {
        let detail =
            "too little motion to judge units, signs and sides: drive a curve, and look longer";
        return vec![Finding::new("meaning", Status::Warning, detail)];
    }
    let mut detail = String::from("what the motion shows fits the command");
    let unjudged = check.unjudged();
    if !unjudged.is_empty() {
        detail = format!(
            "{detail}; NOT judged: {} (drive curves both ways, and look longer)",
            unjudged.join(", ")
        );
    }
    vec![Finding::new("meaning", Status::Ok, detail)]
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use vigil_blocks::Valid;

    use super::*;

    /// A recorded run without a fault, in a curve, as a good publisher would send it.
    fn recorded() -> (Description, Vec<FrameArrival>) {
        let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
        let robot = vigil_setup::load_robot(&root.join("config/robots/rover.toml")).unwrap();
        let path = root.join("tests/data/rover/learn_frames.csv.gz");
        let runs = vigil_recording::frames::read(&path, &robot).unwrap();
        let arrived = |frame: &SensorFrame| FrameArrival {
            now_ns: frame.header.t_capture_ns,
            frame: *frame,
        };
        let frames = runs[1].frames.iter().map(arrived).collect();
        (robot, frames)
    }

    /// What is found once every frame was changed.
    fn found(change: impl Fn(&mut SensorFrame)) -> Vec<Finding> {
        let (robot, mut frames) = recorded();
        frames.iter_mut().for_each(|f| change(&mut f.frame));
        findings(&robot, &frames)
    }

    /// The one finding that is not good: its name, how bad it is, and its text.
    fn only_bad(change: impl Fn(&mut SensorFrame)) -> (String, Status, String) {
        let mut bad = found(change);
        bad.retain(|f| f.status != Status::Ok);
        assert_eq!(bad.len(), 1, "{bad:?}");
        let one = bad.remove(0);
        (one.check, one.status, one.detail)
    }

    #[test]
    fn a_good_publisher_has_nothing_but_good_findings() {
        let found = found(|_| ());
        assert!(found.iter().all(|f| f.status == Status::Ok), "{found:?}");
        // Pose, command, six wheels, four steered, and what they mean together.
        assert_eq!(found.len(), 3 + 2 + 6 + 4 + 1);
    }

    #[test]
    fn a_field_that_is_missing_broken_or_still_is_told_under_its_name() {
        let failure = |name: &str| (name.to_owned(), Status::Failure);
        let of = |change: fn(&mut SensorFrame)| {
            let (check, status, detail) = only_bad(change);
            ((check, status), detail)
        };
        let (missing, detail) = of(|f| f.valid &= !Valid::steer(0));
        assert_eq!(missing, failure("steer_LF"));
        assert!(detail.starts_with("never marked as valid"), "{detail}");
        let (broken, detail) = of(|f| f.wheel_rate[4] = f64::NAN);
        assert_eq!(broken, failure("enc_RM"));
        assert!(
            detail.starts_with("NaN or infinite in 300 of 300"),
            "{detail}"
        );
        let (degrees, detail) = of(|f| f.steer[3] = f.steer[3].to_degrees());
        assert_eq!(degrees, failure("steer_RF"));
        assert!(detail.contains("Looks like degrees"), "{detail}");
    }

    #[test]
    fn what_the_fields_mean_together_is_told() {
        let swapped = |f: &mut SensorFrame| {
            for left in 0..3 {
                f.wheel_rate.swap(left, left + 3);
            }
        };
        let mut bad = found(swapped);
        bad.retain(|f| f.status != Status::Ok);
        assert_eq!(bad.len(), 3, "one for each pair: {bad:?}");
        for Finding {
            check,
            status,
            detail,
        } in &bad
        {
            assert_eq!((check.as_str(), *status), ("meaning", Status::Failure));
            assert!(detail.contains("turn as each other should"), "{detail}");
        }
        let reversed = |f: &mut SensorFrame| f.wheel_rate[4] = -f.wheel_rate[4];
        let (check, _, detail) = only_bad(reversed);
        assert_eq!(
            (check.as_str(), detail.as_str()),
            ("meaning", "signs: enc_RM has the other sign")
        );
        let millimetres = |f: &mut SensorFrame| {
            f.pose[0] *= 1e3;
            f.pose[1] *= 1e3;
        };
        let (check, _, detail) = only_bad(millimetres);
        assert_eq!(check, "meaning");
        assert!(detail.contains("are they in mm?"), "{detail}");
        let still = |f: &mut SensorFrame| f.wheel_rate[2] = 1.25;
        let bad = found(still);
        let bad: Vec<_> = bad.iter().filter(|f| f.status != Status::Ok).collect();
        assert_eq!(bad[0].check, "enc_LR");
        assert!(bad[0].detail.ends_with("though motion is commanded"));
    }
}

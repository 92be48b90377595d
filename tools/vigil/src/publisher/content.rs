//! What the frames say, field by field.

use std::f64::consts::PI;

use vigil_blocks::SensorFrame;
use vigil_recording::frames::{Field, fields};
use vigil_robot::channel::{Role, channels};
use vigil_robot::{ChannelMap, Description};

use super::{FrameArrival, command_time, meaning};
use crate::findings::{Finding, Status};

/// Commanded speed above which a robot is to move, m/s.
const MOVING_M_S: f64 = 0.02;
/// Frames with motion commanded from which a field that never changes is a finding.
const MOVING_FRAMES_MIN: usize = 50;

/// Largest yaw, rad: a publisher need not wrap it, but after so many turns it is no angle in rad.
const YAW_MAX_RAD: f64 = 60.0;

/// A pose that moves further between two frames has jumped: m, and at so many times the robot's
/// greatest speed. Chosen: a hundred deviations of a pose of 5 mm, and room for a slipping clock.
const JUMP_M: f64 = 0.5;
const JUMP_SPEEDS: f64 = 3.0;
/// Frames for each jump, at least.
const JUMP_SHARE: usize = 10;

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

/// One finding for each field of the robot, and one about what they mean together. A field that a
/// recording may lack may be lacking here.
pub fn findings(robot: &Description, frames: &[FrameArrival]) -> Vec<Finding> {
    let fields = fields(robot);
    let one = |(name, field): &(String, Field)| {
        let of = stretch(robot, *field, frames);
        let is_there = of.measured > 0 || !field.is_optional();
        is_there.then(|| judge(name, (*field, limit(*field, robot)), of, frames.len()))
    };
    let mut all: Vec<Finding> = fields.iter().filter_map(one).collect();
    all.extend(jumps(robot, frames));
    all.extend(meaning::findings(robot, frames));
    all.extend(command_time::finding(robot, frames));
    all
}

/// Steps of the pose that no motion makes, within one frame of reference.
fn jumps(robot: &Description, frames: &[FrameArrival]) -> Option<Finding> {
    let map = ChannelMap::new(robot);
    let (mut steps, mut jumps, mut largest_m) = (0, 0, 0.0_f64);
    for pair in frames.windows(2) {
        let [before, after] = [&pair[0].frame, &pair[1].frame];
        let track = |f: &SensorFrame| (f.header.epoch, f.run_id, f.pose_reset_count);
        let (Some(from), Some(to)) = (map.pose(before), map.pose(after)) else {
            continue;
        };
        let passed_ns = after
            .header
            .t_capture_ns
            .saturating_sub(before.header.t_capture_ns);
        if track(before) != track(after) || passed_ns == 0 {
            continue;
        }
        let way_m = (to[0] - from[0]).hypot(to[1] - from[1]);
        let most_m = JUMP_M + JUMP_SPEEDS * robot.limits.speed_m_s * passed_ns as f64 * 1e-9;
        steps += 1;
        if way_m > most_m {
            (jumps, largest_m) = (jumps + 1, largest_m.max(way_m));
        }
    }
    // A pose that always moves too far has another unit, which its motion tells.
    (jumps > 0 && jumps * JUMP_SHARE <= steps).then(|| {
        let detail = format!(
            "the pose jumps {jumps} times, by {largest_m:.2} m at most: where its frame of \
             reference is moved, count pose_reset_count up"
        );
        Finding::new("pose", Status::Failure, detail)
    })
}

fn is_moving(robot: &Description, frame: &SensorFrame) -> bool {
    robot.is_told_beyond(&frame.command, MOVING_M_S)
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

fn judge(name: &str, by: (Field, Option<f64>), of: Stretch, frames: usize) -> Finding {
    let (field, limit) = by;
    let finding = |status, detail: String| Finding::new(name, status, detail);
    if of.measured == 0 {
        let detail = format!(
            "never marked as valid, but the robot's description says that it is measured: set its \
             bit in `{}`, or take it out of the description",
            bits(field)
        );
        return finding(Status::Failure, detail);
    }
    if of.not_finite > 0 {
        let detail = format!(
            "NaN or infinite in {} of {frames} frames: leave it 0 and its bit in `{}` unset",
            of.not_finite,
            bits(field)
        );
        return finding(Status::Failure, detail);
    }
    let mut detail = format!("{:.4} to {:.4}", of.least, of.most);
    if of.measured < frames {
        let share = 100.0 * of.measured as f64 / frames as f64;
        detail.push_str(&format!(", valid in {share:.0} % of the frames"));
    }
    let largest = of.least.abs().max(of.most.abs());
    if let Some(limit) = limit.filter(|limit| largest > *limit) {
        let guess = unit_guess(field);
        let detail = format!("{detail}: beyond {limit:.3}, which the description allows{guess}");
        return finding(Status::Failure, detail);
    }
    // A steering angle may stay as it is in a steady curve.
    let may_stay = matches!(field, Field::Command(_)) || role(field) == Some(Role::SteeringAngle);
    if !may_stay && of.moving >= MOVING_FRAMES_MIN && of.moving_least == of.moving_most {
        let detail = format!("{detail}: never changes, though motion is commanded");
        return finding(Status::Warning, detail);
    }
    finding(Status::Ok, detail)
}

/// What a channel measures; none of a command.
const fn role(field: Field) -> Option<Role> {
    match field {
        Field::Command(_) => None,
        Field::Channel { role, .. } => Some(role),
    }
}

/// The frame's field that says whether it is there.
const fn bits(field: Field) -> &'static str {
    match field {
        Field::Command(_) => "command_valid",
        Field::Channel { .. } => "channel_valid",
    }
}

/// Largest magnitude that makes sense.
fn limit(field: Field, robot: &Description) -> Option<f64> {
    let limits = &robot.limits;
    let (place, role) = match field {
        Field::Command(i) => return robot.command.get(i).map(|axis| 1.001 * axis.limit),
        Field::Channel { place, role, .. } => (place, role),
    };
    let declared = channels(robot).get(place).and_then(|channel| channel.limit);
    declared.or(match role {
        // A wrapped angle may be rounded up.
        Role::SteeringAngle => Some(PI + 1e-3),
        Role::PoseYaw => Some(YAW_MAX_RAD),
        Role::WheelRate => Some(limits.wheel_rate_rad_s),
        Role::BodyRate => Some(limits.yaw_rate_rad_s),
        _ => None,
    })
}

const fn unit_guess(field: Field) -> &'static str {
    match role(field) {
        Some(Role::PoseYaw) => ": looks like degrees, rad is wanted",
        Some(Role::SteeringAngle) => ". Looks like degrees: rad is wanted",
        Some(Role::BodyRate) => ". Looks like degrees per second: rad/s is wanted",
        Some(Role::WheelRate) => {
            ". Looks like degrees per second or revolutions per minute: rad/s is wanted"
        }
        _ => ". Is the unit right?",
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use vigil_robot::ChannelMap;

    use super::*;

    /// Place of `steer_LF`: after the pose and six wheel rates.
    const STEER_LF: usize = 9;

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
    fn found(change: impl Fn(&mut SensorFrame, &ChannelMap)) -> Vec<Finding> {
        let (robot, mut frames) = recorded();
        let map = ChannelMap::new(&robot);
        frames.iter_mut().for_each(|f| change(&mut f.frame, &map));
        findings(&robot, &frames)
    }

    /// The one finding that is not good: its name, how bad it is, and its text.
    fn only_bad(change: impl Fn(&mut SensorFrame, &ChannelMap)) -> (String, Status, String) {
        let mut bad = found(change);
        bad.retain(|f| f.status > Status::Unjudged && !f.detail.contains("does not follow"));
        assert_eq!(bad.len(), 1, "{bad:?}");
        let one = bad.remove(0);
        (one.check, one.status, one.detail)
    }

    #[test]
    fn a_good_publisher_has_nothing_but_good_findings() {
        let found = found(|_, _| ());
        assert!(
            found.iter().all(|f| f.status <= Status::Unjudged),
            "{found:?}"
        );
        // Pose, command, six wheels, four steered, and what they mean together.
        let good = found.iter().filter(|f| f.status == Status::Ok);
        assert_eq!(good.count(), 3 + 2 + 6 + 4 + 1);
    }

    #[test]
    fn a_straight_drive_shows_units_and_signs_and_asks_for_turns() {
        let straight = |f: &mut SensorFrame, map: &ChannelMap| {
            let t_s = f.header.t_capture_ns as f64 * 1e-9;
            f.set_command(0, 0.0);
            f.set_command(1, 0.2);
            map.set_pose(f, [0.2 * t_s, 0.0, 0.0]);
            for wheel in 0..6 {
                map.set_wheel_rate(f, wheel, 2.5 + 1e-3 * t_s);
                map.set_steer(f, wheel, 1e-3 * t_s);
            }
        };
        let found = found(straight);
        let details = |wanted: Status| -> Vec<&str> {
            let of = found
                .iter()
                .filter(|f| f.check == "meaning" && f.status == wanted);
            of.map(|f| f.detail.as_str()).collect()
        };
        assert_eq!(
            details(Status::Ok),
            [
                "the motion fits the command: unit of the wheel rates; signs of enc_LF, enc_LM, \
                 enc_LR, enc_RF, enc_RM, enc_RR"
            ]
        );
        assert_eq!(
            details(Status::Unjudged),
            [
                "not judged yet: travel of the pose; drive four metres, or a quarter turn while \
                 this listens",
                "not judged yet: sign and unit of yaw; drive a left curve and a right one while \
                 this listens",
                "not judged yet: signs of steer_LF, steer_LR, steer_RF, steer_RR; drive a left \
                 curve while this listens",
                "not judged yet: sides of enc_LF, enc_LM, enc_LR, enc_RF, enc_RM, enc_RR; drive a \
                 left curve while this listens",
                "not judged yet: order on each side of enc_LF, enc_LM, enc_LR, enc_RF, enc_RM, \
                 enc_RR; drive the tightest curves while this listens",
                "not judged yet: order of steer_LF, steer_LR, steer_RF, steer_RR; drive a tight \
                 left curve while this listens",
                "no commanded motion shows: which is which of enc_LF, enc_LR",
                "no commanded motion shows: which is which of enc_RF, enc_RR",
            ]
        );
    }

    #[test]
    fn a_field_that_is_missing_broken_or_still_is_told_under_its_name() {
        let failure = |name: &str| (name.to_owned(), Status::Failure);
        let of = |change: fn(&mut SensorFrame, &ChannelMap)| {
            let (check, status, detail) = only_bad(change);
            ((check, status), detail)
        };
        let (missing, detail) = of(|f, _| f.channel_valid &= !(1 << STEER_LF));
        assert_eq!(missing, failure("steer_LF"));
        assert!(detail.starts_with("never marked as valid"), "{detail}");
        let (broken, detail) = of(|f, map| map.set_wheel_rate(f, 4, f64::NAN));
        assert_eq!(broken, failure("enc_RM"));
        assert!(
            detail.starts_with("NaN or infinite in 300 of 300"),
            "{detail}"
        );
        let (degrees, detail) = of(|f, map| {
            let steer = map.steer(f, 3).unwrap();
            map.set_steer(f, 3, steer.to_degrees());
        });
        assert_eq!(degrees, failure("steer_RF"));
        assert!(detail.contains("Looks like degrees"), "{detail}");
    }

    #[test]
    fn what_the_fields_mean_together_is_told() {
        let swapped = |f: &mut SensorFrame, map: &ChannelMap| {
            for left in 0..3 {
                let rates = [left, left + 3].map(|wheel| map.wheel_rate(f, wheel).unwrap());
                map.set_wheel_rate(f, left, rates[1]);
                map.set_wheel_rate(f, left + 3, rates[0]);
            }
        };
        let mut bad = found(swapped);
        bad.retain(|f| f.status > Status::Unjudged);
        assert_eq!(bad.len(), 3, "one for each pair: {bad:?}");
        for Finding {
            check,
            status,
            detail,
        } in &bad
        {
            assert_eq!((check.as_str(), *status), ("meaning", Status::Failure));
            assert!(detail.contains("fit when exchanged"), "{detail}");
        }
        let reversed = |f: &mut SensorFrame, map: &ChannelMap| {
            let rate = map.wheel_rate(f, 4).unwrap();
            map.set_wheel_rate(f, 4, -rate);
        };
        let (check, _, detail) = only_bad(reversed);
        assert_eq!(
            (check.as_str(), detail.as_str()),
            ("meaning", "signs: enc_RM has the other sign")
        );
        let millimetres = |f: &mut SensorFrame, map: &ChannelMap| {
            let [x, y, yaw] = map.pose(f).unwrap();
            map.set_pose(f, [x * 1e3, y * 1e3, yaw]);
        };
        let (check, _, detail) = only_bad(millimetres);
        assert_eq!(check, "meaning");
        assert!(detail.contains("are they in mm?"), "{detail}");
        let still = |f: &mut SensorFrame, map: &ChannelMap| map.set_wheel_rate(f, 2, 1.25);
        let bad = found(still);
        let bad: Vec<_> = bad.iter().filter(|f| f.status > Status::Unjudged).collect();
        assert_eq!(bad[0].check, "enc_LR");
        assert!(bad[0].detail.ends_with("though motion is commanded"));
    }
}

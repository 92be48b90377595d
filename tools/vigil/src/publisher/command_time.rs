//! Whether the command in a frame is the one that the robot followed when it was captured.

use vigil_robot::publisher_check::{RegressionSums, expected_rate};
use vigil_robot::{ChannelMap, Description};

use super::FrameArrival;
use crate::findings::{Finding, Status};

/// Longest shift between command and motion, s.
const SHIFT_MAX_S: f64 = 1.0;
/// Motion that leads its command by more has a command that is late, s. Chosen: the motion of a
/// robot follows; what a planner looks ahead is less.
const LEAD_S: f64 = 0.1;
/// Ratio of what two shifts leave unexplained from which they are told apart, and the part that a
/// shift may leave at most.
const TOLD: f64 = 0.5;
const UNEXPLAINED_MAX: f64 = 0.3;
/// Frames from which it is judged, beside twice the longest shift.
const FRAMES_MIN: usize = 50;

/// The finding; none where nothing measures the motion.
pub fn finding(robot: &Description, frames: &[FrameArrival]) -> Option<Finding> {
    let signals = signals(robot, frames);
    let of = |status, detail: String| Some(Finding::new("command time", status, detail));
    let not_yet = || {
        of(
            Status::Unjudged,
            "not judged yet: start, stop and turn".to_owned(),
        )
    };
    let (Some(first), Some(last)) = (frames.first(), frames.last()) else {
        return None;
    };
    if signals.is_empty() {
        return None;
    }
    let (from_ns, to_ns) = (
        first.frame.header.t_capture_ns,
        last.frame.header.t_capture_ns,
    );
    let period_s = to_ns.saturating_sub(from_ns) as f64 * 1e-9 / frames.len() as f64;
    let most = (SHIFT_MAX_S / period_s.max(1e-3)) as usize;
    if frames.len() < 2 * most + FRAMES_MIN {
        return not_yet();
    }
    // By how much the motion leads, in frames: behind zero and beyond LEAD_S.
    let shifts =
        (-(most as i64)..=most as i64).map(|shift| (shift, unexplained(&signals, shift, most)));
    let least = |leads: bool| {
        let is_lead = |shift: i64| shift as f64 * period_s > LEAD_S;
        let of_kind = shifts.clone().filter(|(shift, _)| is_lead(*shift) == leads);
        of_kind
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 1.0))
    };
    let ((lead, early), (_, in_time)) = (least(true), least(false));
    if early < TOLD * in_time && early < UNEXPLAINED_MAX {
        let lead_s = lead as f64 * period_s;
        let detail = format!(
            "the motion leads the command by {lead_s:.2} s: put in each frame the command that \
             the robot followed when it was captured"
        );
        return of(Status::Failure, detail);
    }
    if in_time < TOLD * early && in_time < UNEXPLAINED_MAX {
        return of(Status::Ok, "the motion follows the command".to_owned());
    }
    not_yet()
}

/// Measured and commanded values of each wheel's rate, and of the gyro, frame by frame.
fn signals(robot: &Description, frames: &[FrameArrival]) -> Vec<Vec<[f64; 2]>> {
    let map = ChannelMap::new(robot);
    let of = |value: &dyn Fn(&FrameArrival) -> Option<[f64; 2]>| -> Option<Vec<[f64; 2]>> {
        let is_finite = |pair: &[f64; 2]| pair.iter().all(|value| value.is_finite());
        frames
            .iter()
            .map(|arrived| value(arrived).filter(is_finite))
            .collect()
    };
    let wheels = (0..robot.wheels.len()).map(|wheel| {
        of(&|FrameArrival { frame, .. }| {
            let rate = map.wheel_rate(frame, wheel)?;
            Some([rate, expected_rate(robot, wheel, &frame.command)])
        })
    });
    let gyro = of(&|FrameArrival { frame, .. }| {
        Some([map.yaw_rate(frame)?, robot.twist(&frame.command)[2]])
    });
    let all = wheels.chain(std::iter::once(gyro)).flatten();
    all.filter(|signal| signal.iter().any(|pair| pair[1] != 0.0))
        .collect()
}

/// Part of the measured motion that the command of `shift` frames later leaves unexplained.
fn unexplained(signals: &[Vec<[f64; 2]>], shift: i64, most: usize) -> f64 {
    let part = |signal: &Vec<[f64; 2]>| {
        let mut sums = RegressionSums::default();
        let last = signal.len().saturating_sub(most);
        for at in most..last {
            let commanded = signal[at.saturating_add_signed(shift as isize)][1];
            sums.add(signal[at][0], commanded, 1.0);
        }
        1.0 - sums.explained()
    };
    signals.iter().map(part).sum::<f64>() / signals.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use vigil_blocks::SensorFrame;

    use super::*;

    /// A Kobuki that starts, stops and turns, and lags by a tenth of a second; its frames hold the
    /// command of `late` frames before. 50 Hz.
    fn told(late: usize, is_steady: bool) -> Status {
        let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
        let robot = vigil_setup::load_robot(&root.join("config/robots/kobuki.toml")).unwrap();
        let map = ChannelMap::new(&robot);
        let commanded = |k: usize| match (is_steady, k / 80 % 4) {
            (true, _) | (_, 0) => [0.3, 0.0],
            (_, 1) => [0.0, 0.0],
            (_, 2) => [0.2, 0.8],
            _ => [0.2, -0.8],
        };
        let mut actual = [0.0; 2];
        let one = |k: usize| {
            let mut frame = SensorFrame::default();
            for (axis, wanted) in commanded(k).into_iter().enumerate() {
                actual[axis] += 0.2 * (wanted - actual[axis]);
                frame.set_command(axis, actual[axis]);
            }
            for wheel in 0..2 {
                let rate = expected_rate(&robot, wheel, &frame.command);
                map.set_wheel_rate(&mut frame, wheel, rate);
            }
            map.set_yaw_rate(&mut frame, actual[1]);
            for (axis, value) in commanded(k.saturating_sub(late)).into_iter().enumerate() {
                frame.set_command(axis, value);
            }
            let now_ns = 20_000_000 * k as u64;
            frame.header.t_capture_ns = now_ns;
            FrameArrival { now_ns, frame }
        };
        let frames: Vec<FrameArrival> = (0..500).map(one).collect();
        finding(&robot, &frames).unwrap().status
    }

    #[test]
    fn a_command_that_comes_late_is_told_where_it_changes() {
        assert_eq!(told(0, false), Status::Ok);
        assert_eq!(told(25, false), Status::Failure);
        assert_eq!(told(25, true), Status::Unjudged);
    }
}

//! Frames that are refused, why, and what to change.

use vigil_blocks::Rejection;
use vigil_blocks::datagram::DATAGRAM_SIZE;

use super::Reception;
use crate::findings::{Finding, Status};

/// One finding for each cause that occurred; one if none did.
pub fn findings(heard: &Reception) -> Vec<Finding> {
    let count = |cause: &Rejection| heard.rejected[*cause as usize];
    let causes: Vec<Rejection> = Rejection::ALL
        .iter()
        .copied()
        .filter(|cause| count(cause) > 0)
        .collect();
    if causes.is_empty() {
        let is_silent = heard.frames.is_empty();
        let all = (!is_silent).then(|| Finding::new("refused", Status::Ok, "none"));
        return all.into_iter().collect();
    }
    let told = causes.iter().map(|cause| {
        let mut detail = format!("{} frames: {}", count(cause), advice(*cause));
        if *cause == Rejection::Malformed {
            detail.push_str(&format!(": {DATAGRAM_SIZE} bytes"));
        }
        Finding::new(
            format!("refused: {}", cause.as_str()),
            Status::Failure,
            detail,
        )
    });
    told.collect()
}

const fn advice(cause: Rejection) -> &'static str {
    match cause {
        Rejection::Schema => {
            "header.schema is not SensorFrame's: set it from the generated types, which must be of \
             this version"
        }
        Rejection::NoEpoch => {
            "header.epoch is 0: set it once at the start of the publisher to a number that no \
             other start has, such as the time in ns"
        }
        Rejection::OtherWriter => {
            "of another epoch, or from another address, within a second of the known publisher's \
             frames: is header.epoch set anew for each frame, or do two publishers run?"
        }
        Rejection::Repeated => "header.seq repeats: count it up by one for each frame",
        Rejection::WrongSequence => {
            "header.seq goes back, or leaps by more than a million: count it up by one for each \
             frame, and change header.epoch when it starts anew"
        }
        Rejection::Ahead => {
            "header.t_schedule_ns lies in the future: it is CLOCK_MONOTONIC of this machine, not \
             the time of day (Python: time.monotonic_ns())"
        }
        Rejection::Behind => {
            "header.t_schedule_ns lies more than 10 s back: it is CLOCK_MONOTONIC of this \
             machine, in ns, when the frame was due"
        }
        Rejection::Early => {
            "sooner than a quarter of a period after the one before: graph.rate_hz must be the \
             rate at which frames come, and header.t_schedule_ns advance with them; or, where it \
             is left at 0, header.t_capture_ns, in ns"
        }
        Rejection::NotFinite => {
            "a value is NaN or infinite: leave what was not measured at 0 and its bit in \
             `channel_valid` unset"
        }
        Rejection::OutOfRange => {
            "a value is beyond all that the robot's description allows: is the unit right (rad, \
             rad/s, m, A)?"
        }
        Rejection::Jump => {
            "the pose moved more than 100 m between two frames: is the unit m? If its frame \
             really was moved, count pose_reset_count up"
        }
        Rejection::Quarantined => {
            "good in themselves, but half of those before were not: mend the other causes"
        }
        Rejection::Malformed => {
            "datagrams of another length, mark or version than the generated types make"
        }
        Rejection::Clock => {
            "header.t_capture_ns is not after that of the frame before, or leaps by more than an \
             hour: set it to when the data was captured, in ns, by a clock that runs evenly"
        }
        Rejection::Robot => {
            "made for another channel list than that of the robot's description: robot_hash is not \
             its hash. Read the graph's file `channels`, or what `vigil channels` prints, and set \
             robot_hash and the channels by it"
        }
        Rejection::Corrupt => "the checksum of a datagram does not fit: CRC-32C (Castagnoli)",
    }
}

//! One number by which to know recorded frames again.

use vigil_blocks::{SensorFrame, Valid, WHEELS, fnv1a};

use vigil_recording::frames::Run;

/// Hash of what the frames up to `until_s` hold: ids of the runs, times, poses, commands, wheel
/// rates, and yaw rates and motor currents where they were measured.
#[must_use]
pub fn data_hash(runs: &[&Run], until_s: f64) -> String {
    let mut hash = fnv1a::BASIS;
    for run in runs {
        hash = fnv1a::hash_u64(hash, u64::from(run.id));
        let until = |frame: &&SensorFrame| frame.header.t_capture_ns as f64 * 1e-9 <= until_s;
        for frame in run.frames.iter().take_while(until) {
            hash = fnv1a::hash_u64(hash, frame.header.t_capture_ns);
            let values = frame
                .pose
                .iter()
                .chain(&frame.command)
                .chain(&frame.wheel_rate);
            let yaw_rate = frame.has(Valid::YAW_RATE).then_some(&frame.yaw_rate);
            let has_current = |&i: &usize| frame.has(Valid::current(i));
            let currents = (0..WHEELS).filter(has_current);
            let currents = currents.filter_map(|i| frame.current.get(i));
            for value in values.chain(yaw_rate).chain(currents) {
                hash = fnv1a::hash_u64(hash, value.to_bits());
            }
        }
    }
    format!("fnv1a64:{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(change: impl Fn(&mut SensorFrame)) -> Run {
        let frame = |i: u64| {
            let mut frame = SensorFrame::default();
            frame.header.t_capture_ns = i * 1_000_000_000;
            change(&mut frame);
            frame
        };
        let frames = (1..=3).map(frame).collect();
        Run { id: 7, frames }
    }

    #[test]
    fn what_was_measured_counts_and_what_comes_later_does_not() {
        let hash = |run: &Run, until_s| data_hash(&[run], until_s);
        let plain = hash(&run(|_| ()), f64::INFINITY);
        let late = |frame: &mut SensorFrame| {
            frame.pose[0] = if frame.header.t_capture_ns > 2_000_000_000 {
                1.0
            } else {
                0.0
            };
        };
        assert_ne!(hash(&run(late), f64::INFINITY), plain);
        assert_eq!(hash(&run(late), 2.5), hash(&run(|_| ()), 2.5));
        assert_ne!(hash(&run(|_| ()), 2.5), plain);
        let unmeasured = run(|frame| (frame.yaw_rate, frame.current[1]) = (0.3, 2.0));
        assert_eq!(hash(&unmeasured, f64::INFINITY), plain);
        for bit in [Valid::YAW_RATE, Valid::current(1)] {
            let measured = run(|frame| {
                (frame.yaw_rate, frame.current[1], frame.valid) = (0.3, 2.0, bit);
            });
            assert_ne!(hash(&measured, f64::INFINITY), plain);
        }
    }
}

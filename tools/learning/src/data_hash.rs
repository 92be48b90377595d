//! One number by which to know recorded frames again.

use vigil_blocks::{CHANNELS, COMMANDS, SensorFrame, fnv1a};

use vigil_recording::frames::Run;

/// Hash of what the frames up to `until_s` hold, and of labels: ids of the runs, times, commands
/// and channels, as far as they were measured.
#[must_use]
pub fn data_hash(runs: &[&Run], until_s: f64, labels: &[String]) -> String {
    let mut hash = fnv1a::BASIS;
    for run in runs {
        hash = fnv1a::hash_u64(hash, u64::from(run.id));
        let until = |frame: &&SensorFrame| frame.header.t_capture_ns as f64 * 1e-9 <= until_s;
        for frame in run.frames.iter().take_while(until) {
            hash = fnv1a::hash_u64(hash, frame.header.t_capture_ns);
            let command = (0..COMMANDS).filter_map(|i| frame.commanded(i));
            let channels = (0..CHANNELS).filter_map(|i| frame.measured(i));
            for value in command.chain(channels) {
                hash = fnv1a::hash_u64(hash, value.to_bits());
            }
        }
    }
    for label in labels {
        hash = fnv1a::hash(hash, label.as_bytes());
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
        let hash = |run: &Run, until_s| data_hash(&[run], until_s, &[]);
        let plain = hash(&run(|_| ()), f64::INFINITY);
        let late = |frame: &mut SensorFrame| {
            let is_late = frame.header.t_capture_ns > 2_000_000_000;
            frame.set_channel(0, if is_late { 1.0 } else { 0.0 });
        };
        assert_ne!(hash(&run(late), f64::INFINITY), plain);
        let early = run(|frame| frame.set_channel(0, 0.0));
        assert_eq!(hash(&run(late), 2.5), hash(&early, 2.5));
        assert_ne!(hash(&run(|_| ()), 2.5), plain);
        let unmeasured = run(|frame| (frame.channel[13], frame.command[7]) = (0.3, 2.0));
        assert_eq!(hash(&unmeasured, f64::INFINITY), plain);
        let measured = run(|frame| frame.set_channel(13, 0.3));
        assert_ne!(hash(&measured, f64::INFINITY), plain);
        let commanded = run(|frame| frame.set_command(7, 2.0));
        assert_ne!(hash(&commanded, f64::INFINITY), plain);
    }
}

//! Whether the detector is blind, and why.
//!
//! A frame is *valid* if it continues the one before it: same writer, same run, capture times that
//! advance like the graph's clock, a command, and a measurement of a channel that the detector
//! uses. Without a valid frame for [`BLIND_S`] the detector is blind: no filter would notice a
//! fault, and each would repeat its last belief. It is blind too while runs too short for the
//! filters follow each other.
//!
//! Time is counted by the graph's schedule: a period for each frame and each missed deadline.
//! Capture times are compared with the scheduled instants, which the border has checked. Each frame
//! is judged by its predecessor alone, so that jitter, gaps and bursts leave valid frames among the
//! others. A reset of the filters does not end blindness: a source that resets them with every
//! frame is one of its causes.

use vigil_blocks::{Blindness, SensorFrame};
use vigil_checkpoint::CheckpointValue;

/// Without a valid frame for so long, s, the detector is blind. As long as an alarm takes to clear
/// (`alarm::CLEAR_S`).
const BLIND_S: f64 = 1.0;
/// Slack when that time is compared, s: it is a sum of periods, each rounded.
const SLACK_S: f64 = 1e-6;
/// Blindness ends after valid frames for so long, s. Chosen by hand: two frames of
/// [`FRAME_MAX_S`], so that a single one does not end it; larger only delays the first diagnosis.
const VALID_S: f64 = 0.2;
/// A longer pause between valid frames begins that time anew, s: half of what blinds, so that a
/// source at the edge of blindness does not toggle it.
const PAUSE_S: f64 = 0.5;
/// One frame counts as valid time of this at most, s: no single one ends blindness.
const FRAME_MAX_S: f64 = 0.1;
/// A run shorter than this, s, shows nothing: the filters begin anew with each, and count evidence
/// after a second of motion at the least. After this many in a row the detector is blind until one
/// lasts. Chosen by hand: an operator may restart a publisher twice.
const SHORT_S: f64 = 2.0;
const SHORT_RUNS: u32 = 3;
/// Capture times that advance by this factor faster or slower than the schedule are no clock.
/// Chosen by hand: jitter of a whole period passes, a wrong unit does not.
const RATE_MAX: f64 = 2.0;

/// What the next frame is compared with.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Last {
    epoch: u64,
    run_id: u64,
    t_capture_ns: u64,
    t_schedule_ns: u64,
}

/// Counts the time without valid frames of one graph.
#[derive(Debug, Clone, CheckpointValue)]
pub struct BlindnessTimer {
    /// Bits of which a frame needs any, and of which it needs all.
    channels: u64,
    command: u32,
    /// Period of the graph, s; none offline, where capture times are the only time there is.
    period_s: Option<f64>,
    /// False for recorded frames: their times are the recording's.
    judges_clock: bool,
    last: Option<Last>,
    /// Time since the last valid frame, s.
    invalid_s: f64,
    /// Part of it that no verdict has used yet, s; the same by cause.
    unjudged_s: f64,
    by_cause: [f64; Blindness::ALL.len()],
    refused: bool,
    /// Time of valid frames without a pause while blind, s.
    valid_s: f64,
    /// Length of this run, s; how many in a row before it were short, and their length, s.
    run_s: f64,
    short_runs: u32,
    short_s: f64,
    blind: Option<Blindness>,
    is_doubtful: bool,
}

impl BlindnessTimer {
    /// For frames that need any bit of `channels` in [`SensorFrame::channel_valid`] and all bits
    /// of `command` in [`SensorFrame::command_valid`].
    #[must_use]
    pub const fn new(channels: u64, command: u32) -> Self {
        Self {
            channels,
            command,
            period_s: None,
            judges_clock: false,
            last: None,
            invalid_s: 0.0,
            unjudged_s: 0.0,
            by_cause: [0.0; Blindness::ALL.len()],
            refused: false,
            valid_s: 0.0,
            run_s: 0.0,
            short_runs: 0,
            short_s: 0.0,
            blind: None,
            is_doubtful: false,
        }
    }

    /// The same in a graph of this period, s. `judges_clock` unless frames are recorded ones, the
    /// capture times of which are the recording's.
    #[must_use]
    pub const fn in_graph(mut self, period_s: f64, judges_clock: bool) -> Self {
        self.period_s = Some(period_s);
        self.judges_clock = judges_clock;
        self
    }

    /// Why the detector is blind; none while it is not.
    #[must_use]
    pub const fn blind(&self) -> Option<Blindness> {
        match self.blind {
            None if self.short_runs >= SHORT_RUNS && self.short_s >= BLIND_S => {
                Some(Blindness::Run)
            }
            None if self.is_doubtful => Some(Blindness::Meaning),
            blind => blind,
        }
    }

    /// Takes whether the measurements cannot mean what they should.
    pub const fn doubt(&mut self, is_doubtful: bool) {
        self.is_doubtful = is_doubtful;
    }

    /// Takes a frame.
    pub fn take(&mut self, frame: &SensorFrame) {
        let now = Last {
            epoch: frame.header.epoch,
            run_id: frame.run_id,
            t_capture_ns: frame.header.t_capture_ns,
            t_schedule_ns: frame.header.t_schedule_ns,
        };
        let Some(last) = self.last.replace(now) else {
            return;
        };
        let captured_s = seconds(last.t_capture_ns, now.t_capture_ns);
        let scheduled_s = match seconds(last.t_schedule_ns, now.t_schedule_ns) {
            // A publisher without a schedule is taken to publish once a period.
            s if s <= 0.0 => self.period_s.unwrap_or(captured_s),
            s => s,
        };
        if (now.epoch, now.run_id) != (last.epoch, last.run_id) {
            if self.run_s < SHORT_S {
                self.short_runs = self.short_runs.saturating_add(1);
                self.short_s += self.run_s;
            }
            self.run_s = 0.0;
        }
        // A recording may be played faster than it was made.
        let run_s = match self.judges_clock {
            true => scheduled_s,
            false => captured_s,
        };
        self.run_s += run_s.clamp(0.0, BLIND_S);
        if self.run_s >= SHORT_S {
            (self.short_runs, self.short_s) = (0, 0.0);
        }
        let is_clock = captured_s <= RATE_MAX * scheduled_s && scheduled_s <= RATE_MAX * captured_s;
        let cause = if now.epoch != last.epoch {
            Blindness::Epoch
        } else if now.run_id != last.run_id {
            Blindness::Run
        } else if self.judges_clock && !is_clock {
            Blindness::Clock
        } else if frame.channel_valid & self.channels == 0 {
            Blindness::Validity
        } else if frame.command_valid & self.command != self.command {
            Blindness::Command
        } else {
            return self.take_valid(scheduled_s);
        };
        let span_s = self.period_s.unwrap_or(captured_s);
        self.add_invalid(span_s.clamp(0.0, BLIND_S), cause);
    }

    /// Counts deadlines that passed without input.
    pub fn miss(&mut self, count: u32) {
        let cause = match self.refused {
            true => Blindness::Refused,
            false => Blindness::Silence,
        };
        self.add_invalid(f64::from(count) * self.period_s.unwrap_or(0.0), cause);
    }

    /// Counts a frame that the border refused.
    pub const fn refuse(&mut self) {
        self.refused = true;
    }

    fn take_valid(&mut self, span_s: f64) {
        if self.invalid_s > PAUSE_S {
            self.valid_s = 0.0;
        }
        self.invalid_s = 0.0;
        self.forget_causes();
        if self.blind.is_some() {
            self.valid_s += span_s.clamp(0.0, FRAME_MAX_S);
            if self.valid_s >= VALID_S - SLACK_S {
                (self.blind, self.valid_s) = (None, 0.0);
            }
        }
    }

    /// Adds invalid time. Each full second names the cause with most of it and counts anew.
    fn add_invalid(&mut self, span_s: f64, cause: Blindness) {
        self.invalid_s += span_s;
        self.unjudged_s += span_s;
        self.by_cause[cause as usize - 1] += span_s;
        if self.unjudged_s < BLIND_S - SLACK_S {
            return;
        }
        let causes = Blindness::ALL.iter().zip(self.by_cause);
        let most = causes.max_by(|a, b| a.1.total_cmp(&b.1));
        self.blind = most.map(|(cause, _)| *cause);
        self.valid_s = 0.0;
        self.forget_causes();
    }

    const fn forget_causes(&mut self) {
        self.unjudged_s = 0.0;
        self.by_cause = [0.0; Blindness::ALL.len()];
        self.refused = false;
    }
}

/// From one instant to another, s; negative if time went back.
fn seconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.wrapping_sub(from_ns).cast_signed() as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.02;
    const PERIOD_NS: u64 = 20_000_000;
    const COMMAND: u32 = 0b11;
    /// Pose and two wheel rates.
    const CHANNELS: u64 = 0b1_1111;
    const POSE: u64 = 0b111;

    fn timer() -> BlindnessTimer {
        BlindnessTimer::new(CHANNELS, COMMAND).in_graph(PERIOD_S, true)
    }

    fn frame(k: u64) -> SensorFrame {
        let mut frame = SensorFrame {
            run_id: 1,
            command_valid: COMMAND,
            channel_valid: POSE,
            ..SensorFrame::default()
        };
        (frame.header.epoch, frame.header.seq) = (9, k);
        frame.header.t_schedule_ns = 5_000_000_000 + k * PERIOD_NS;
        frame.header.t_capture_ns = 70_000_000_000 + k * PERIOD_NS;
        frame
    }

    /// Seconds after which the timer is lost, of 10 s of frames; and why.
    fn lost(spoil: impl Fn(u64, &mut SensorFrame)) -> Option<(f64, Blindness)> {
        let mut timer = timer();
        for k in 0..500 {
            let mut frame = frame(k);
            spoil(k, &mut frame);
            timer.take(&frame);
            if let Some(cause) = timer.blind() {
                return Some((k as f64 * PERIOD_S, cause));
            }
        }
        None
    }

    #[test]
    fn a_frame_may_lack_some_channels_but_no_part_of_the_command() {
        assert_eq!(lost(|_, f| f.channel_valid = 1 << 4), None);
        let found = lost(|_, f| f.command_valid = 1);
        assert_eq!(found.map(|(_, cause)| cause), Some(Blindness::Command));
        // The validity is judged first.
        let found = lost(|_, f| (f.command_valid, f.channel_valid) = (1, 0));
        assert_eq!(found.map(|(_, cause)| cause), Some(Blindness::Validity));
    }

    #[test]
    fn doubt_about_the_meaning_is_blindness_at_once_and_as_long_as_it_lasts() {
        let mut timer = timer();
        timer.take(&frame(0));
        timer.doubt(true);
        assert_eq!(timer.blind(), Some(Blindness::Meaning));
        timer.doubt(false);
        assert_eq!(timer.blind(), None);
    }

    #[test]
    fn the_cause_of_most_of_the_time_is_named() {
        let mut timer = timer();
        timer.take(&frame(0));
        for k in 0..50 {
            if k % 3 == 0 {
                timer.miss(1);
            } else {
                let mut spoilt = frame(k + 1);
                spoilt.command_valid = 0;
                timer.take(&spoilt);
            }
        }
        assert_eq!(timer.blind(), Some(Blindness::Command));
    }

    #[test]
    fn each_cause_is_named_after_a_second() {
        type Spoil = fn(u64, &mut SensorFrame);
        let spoils: [(Spoil, Blindness); 8] = [
            (|_, f| f.header.t_capture_ns /= 1000, Blindness::Clock),
            (|_, f| f.header.t_capture_ns /= 1_000_000, Blindness::Clock),
            (|_, f| f.header.t_capture_ns *= 3, Blindness::Clock),
            (|_, f| f.header.t_capture_ns = 5, Blindness::Clock),
            (|_, f| f.channel_valid = 0, Blindness::Validity),
            (|_, f| f.command_valid = 0, Blindness::Command),
            (|k, f| f.run_id = k, Blindness::Run),
            (|k, f| f.header.epoch = 1 + k, Blindness::Epoch),
        ];
        for (spoil, cause) in spoils {
            let Some((after_s, found)) = lost(spoil) else {
                unreachable!("{cause:?} is not found");
            };
            assert_eq!(found, cause);
            assert!((0.98..=1.02).contains(&after_s), "{cause:?}: {after_s} s");
        }
    }

    #[test]
    fn runs_too_short_to_show_anything_are_blindness_until_one_lasts() {
        let found = lost(|k, f| f.run_id = k / 20);
        let in_time = |(at_s, cause)| cause == Blindness::Run && at_s < 2.0;
        assert!(found.is_some_and(in_time), "{found:?}");
        assert_eq!(lost(|k, f| f.run_id = k.min(110) / 50), None);
        // Quick restarts after a long run are no second yet.
        assert_eq!(lost(|k, f| f.run_id = (k.clamp(250, 259) - 250) / 3), None);
        // Twenty times as fast, ten seconds of a recording are half a second.
        let mut recorded = BlindnessTimer::new(CHANNELS, COMMAND).in_graph(PERIOD_S, false);
        for k in 0..500 {
            let mut frame = frame(k);
            frame.run_id = k / 25;
            frame.header.t_capture_ns += 19 * k * PERIOD_NS;
            recorded.take(&frame);
            assert_eq!(recorded.blind(), None, "frame {k}");
        }
        let mut timer = timer();
        let mut blind = Vec::new();
        for k in 0..500 {
            let run_id = k.min(200) / 20;
            timer.take(&SensorFrame { run_id, ..frame(k) });
            blind.push(timer.blind().is_some());
        }
        assert!(
            blind[150] && blind[290] && !blind[310],
            "seen after two seconds"
        );
    }

    #[test]
    fn jitter_other_rates_and_a_clock_of_its_own_are_no_blindness() {
        // Capture a tenth fast, from another origin; jitter of half a period; bursts of ten.
        assert_eq!(
            lost(|k, f| f.header.t_capture_ns = 1 + k * 22_000_000),
            None
        );
        let jitter = |k: u64| (k * 7919) % (PERIOD_NS / 2);
        assert_eq!(lost(|k, f| f.header.t_capture_ns += jitter(k)), None);
        let burst = |k: u64| (k / 10 + 1) * 10 * PERIOD_NS;
        assert_eq!(lost(|k, f| f.header.t_schedule_ns = burst(k)), None);
        // No schedule at all; one run after the other; no command now and then.
        assert_eq!(lost(|_, f| f.header.t_schedule_ns = 0), None);
        assert_eq!(lost(|k, f| f.run_id = k / 150), None);
        assert_eq!(
            lost(|k, f| f.command_valid = if k % 9 == 0 { COMMAND } else { 0 }),
            None
        );
        let mut slow = timer();
        for k in 0..100 {
            slow.take(&frame(5 * k));
            slow.miss(4);
            assert_eq!(slow.blind(), None);
        }
    }

    #[test]
    fn silence_is_blindness_until_frames_have_come_for_a_while() {
        let mut timer = timer();
        for k in 0..10 {
            timer.take(&frame(k));
        }
        for _ in 0..49 {
            timer.miss(1);
        }
        assert_eq!(timer.blind(), None);
        timer.miss(1);
        assert_eq!(timer.blind(), Some(Blindness::Silence));
        for _ in 0..20 {
            timer.refuse();
            timer.miss(3);
        }
        assert_eq!(timer.blind(), Some(Blindness::Refused));
        // A frame a second is no timer.
        for k in 2..6 {
            timer.take(&frame(50 * k));
            timer.miss(49);
            assert!(timer.blind().is_some());
        }
        let seen = (300..400).find(|&k| {
            timer.take(&frame(k));
            timer.blind().is_none()
        });
        assert!(seen.is_some_and(|k| (303..=311).contains(&k)), "{seen:?}");
    }

    #[test]
    fn recorded_frames_keep_their_own_time() {
        let mut timer = BlindnessTimer::new(POSE, COMMAND).in_graph(PERIOD_S, false);
        for k in 0..500 {
            let mut frame = frame(k);
            frame.header.t_capture_ns = k * 10 * PERIOD_NS;
            timer.take(&frame);
            assert_eq!(timer.blind(), None);
        }
    }
}

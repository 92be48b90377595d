//! The detector's alarm as its readers know it, also when another detector takes its place.

use vigil_blocks::{Carryover, DetectionBelief, Readiness};
use vigil_checkpoint::CheckpointValue;

use crate::alarm::Lull;

/// Motion between two beliefs counts for at most this long, s. Chosen: ten observations of 50 ms.
const STEP_MAX_S: f64 = 0.5;

/// True if faults with a name are more probable than not. A reader of an alarm that has not seen
/// how it began tells of nothing else, or hears nothing else, at first.
#[must_use]
pub const fn are_named(p_nominal: f64, p_unknown: f64) -> bool {
    1.0 - p_nominal - p_unknown > 0.5
}

/// What the detector says of a fault. One that has just begun, or whose frames come from another
/// publisher than before, knows nothing of an alarm that stood before: that alarm is held until the
/// detector has raised its own, or its log-odds have been as low for as long as those that end an
/// alarm. So it is held as long as the robot rests; a new run ends it.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct DetectorAlarm {
    run_id: u64,
    /// Epochs of the detector and of its frames' publisher.
    epoch: u64,
    frame_epoch: u64,
    /// Of the last belief, and the time that had passed then.
    t_capture_ns: u64,
    passed_s: f64,
    alarm_count: u32,
    stands: bool,
    alarm_t_ns: u64,
    /// When the present detector has raised its own; another instant where it stood before.
    own_t_ns: u64,
    p_fault: f64,
    /// While an alarm is held: alarms that the detector had raised when that began.
    count_before: u32,
    lull: Option<Lull>,
}

impl DetectorAlarm {
    /// The alarm that an earlier reader of the same run has left.
    #[must_use]
    pub fn restored(left: &Carryover) -> Self {
        Self {
            run_id: left.run_id,
            stands: left.detected_t_capture_ns != 0,
            alarm_t_ns: left.detected_t_capture_ns,
            own_t_ns: left.detected_t_capture_ns,
            p_fault: left.p_fault,
            ..Self::default()
        }
    }

    /// Takes the next belief; false while an alarm is held against it.
    pub fn take(&mut self, belief: &DetectionBelief) -> bool {
        self.follow(belief);
        let t_ns = belief.header.t_capture_ns;
        let passed_s = t_ns.saturating_sub(self.t_capture_ns) as f64 * 1e-9;
        self.passed_s = match self.t_capture_ns {
            0 => 0.0,
            _ => passed_s.min(STEP_MAX_S),
        };
        (self.t_capture_ns, self.alarm_count) = (t_ns, belief.alarm_count);
        let is_silent = belief.alarm == 0 && belief.alarm_count == self.count_before;
        if let Some(lull) = self.lull.as_mut().filter(|_| is_silent) {
            let sees = belief.readiness == Readiness::Armed as u32 && belief.blind == 0;
            let (odds, threshold) = (belief.log_odds, belief.alarm_log_odds);
            if !sees || !lull.take(odds, threshold, self.passed_s) {
                return false;
            }
        }
        let was_held = self.lull.take().is_some();
        self.stands = belief.alarm != 0;
        self.p_fault = belief.p_fault;
        if belief.alarm_t_capture_ns != self.own_t_ns {
            self.own_t_ns = belief.alarm_t_capture_ns;
            // One that was held until the next detector raised its own is the same one.
            if !(was_held && self.stands) {
                self.alarm_t_ns = self.own_t_ns;
            }
        }
        true
    }

    /// Finds out whether another run has begun, or another detector.
    fn follow(&mut self, belief: &DetectionBelief) {
        self.begin_run(belief.run_id);
        let (epoch, frame_epoch) = (belief.header.epoch, belief.cause.frame_epoch);
        if (epoch, frame_epoch) != (self.epoch, self.frame_epoch) {
            self.lull = self.stands.then(Lull::default);
            self.count_before = match self.epoch {
                // What was restored does not say of which detector it is.
                0 => belief.alarm_count,
                before if before == epoch => self.alarm_count,
                _ => 0,
            };
            (self.epoch, self.frame_epoch) = (epoch, frame_epoch);
        }
    }

    /// Goes on in this run. Another one begins without an alarm.
    pub fn begin_run(&mut self, run_id: u64) {
        if run_id != self.run_id {
            *self = Self {
                run_id,
                ..Self::default()
            };
        }
    }

    /// Time between the last two beliefs of this run as far as it counts, s: a long gap does not
    /// show what was in it.
    #[must_use]
    pub const fn passed_s(&self) -> f64 {
        self.passed_s
    }

    /// True while an alarm is held against what the present detector says.
    #[must_use]
    pub const fn is_held(&self) -> bool {
        self.lull.is_some()
    }

    /// True while it stands.
    #[must_use]
    pub const fn stands(&self) -> bool {
        self.stands
    }

    /// Capture time of the frame that raised it, ns; 0 without one. It tells alarms apart.
    #[must_use]
    pub const fn t_ns(&self) -> u64 {
        self.alarm_t_ns
    }

    /// Probability of a fault. Not a number is no word of health while an alarm stands.
    #[must_use]
    pub fn p_fault(&self) -> f64 {
        match self.p_fault.is_finite() {
            true => self.p_fault.clamp(0.0, 1.0),
            false => f64::from(u8::from(self.stands)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOW: f64 = -9.0;

    #[test]
    fn faults_are_named_beyond_even_odds() {
        assert!(are_named(0.1, 0.3) && are_named(0.0, 0.0));
        assert!(!are_named(0.25, 0.25) && !are_named(0.9, 0.1));
        assert!(!are_named(f64::NAN, 0.0));
    }

    /// A belief of the detector that began at `epoch`, after so many steps of 100 ms.
    fn belief(epoch: u64, step: u64, alarm: bool, readiness: Readiness) -> DetectionBelief {
        let mut belief = DetectionBelief {
            alarm: alarm.into(),
            alarm_count: alarm.into(),
            alarm_t_capture_ns: if alarm { 7 * epoch } else { 0 },
            p_fault: if alarm { 0.75 } else { 0.0 },
            log_odds: LOW,
            readiness: readiness as u32,
            run_id: 1,
            ..DetectionBelief::default()
        };
        belief.header.epoch = epoch;
        belief.header.t_capture_ns = step * 100_000_000;
        belief
    }

    fn standing() -> DetectorAlarm {
        let mut alarm = DetectorAlarm::default();
        assert!(alarm.take(&belief(1, 0, false, Readiness::Arming)));
        assert!(alarm.take(&belief(1, 1, true, Readiness::Armed)));
        assert_eq!((alarm.p_fault(), alarm.is_held()), (0.75, false));
        assert_eq!(alarm.t_ns(), 7);
        alarm
    }

    #[test]
    fn an_alarm_is_held_until_the_next_detector_has_found_nothing_for_a_second() {
        let mut alarm = standing();
        for step in 2..40 {
            assert!(!alarm.take(&belief(2, step, false, Readiness::Arming)));
            assert!(!alarm.take(&belief(2, step, false, Readiness::NotExcited)));
        }
        // Odds that only do not raise an alarm, or of a blind detector, show nothing.
        for step in 40..80 {
            let mut doubt = belief(2, step, false, Readiness::Armed);
            match step < 60 {
                true => doubt.log_odds = -3.9,
                false => doubt.blind = 1,
            }
            assert!(!alarm.take(&doubt));
        }
        for step in 80..89 {
            assert!(!alarm.take(&belief(2, step, false, Readiness::Armed)));
            assert_eq!((alarm.is_held(), alarm.p_fault()), (true, 0.75));
        }
        assert!(alarm.take(&belief(2, 89, false, Readiness::Armed)));
        assert_eq!((alarm.stands(), alarm.t_ns()), (false, 0));
        assert!(alarm.take(&belief(2, 90, true, Readiness::Armed)));
        assert_eq!(alarm.t_ns(), 14, "another one");
    }

    #[test]
    fn doubt_begins_the_second_anew() {
        let mut alarm = standing();
        for step in 2..60 {
            let mut belief = belief(2, step, false, Readiness::Armed);
            belief.log_odds = if step % 9 == 0 { -3.9 } else { LOW };
            assert!(!alarm.take(&belief), "{step}");
        }
    }

    #[test]
    fn the_next_detectors_own_alarm_is_the_one_that_stood_and_then_another() {
        let mut alarm = standing();
        assert!(!alarm.take(&belief(2, 2, false, Readiness::Arming)));
        for step in 3..5 {
            assert!(alarm.take(&belief(2, step, true, Readiness::Armed)));
            assert_eq!((alarm.t_ns(), alarm.is_held()), (7, false));
        }
        let mut fallen = belief(2, 5, false, Readiness::Armed);
        fallen.alarm_count = 1;
        assert!(alarm.take(&fallen));
        assert!(alarm.take(&belief(3, 6, false, Readiness::Arming)));
        assert!(alarm.take(&belief(3, 7, true, Readiness::Armed)));
        assert_eq!(alarm.t_ns(), 21);
    }

    #[test]
    fn an_alarm_is_held_when_frames_come_from_another_publisher() {
        let mut alarm = standing();
        let mut next = belief(1, 2, false, Readiness::Arming);
        (next.cause.frame_epoch, next.alarm_count) = (9, 1);
        assert!(!alarm.take(&next));
        next.alarm_count = 2;
        assert!(alarm.take(&next), "it has raised another, which has ended");
        assert!(!alarm.stands());
    }

    #[test]
    fn an_alarm_that_rose_and_fell_unseen_has_ended() {
        let mut alarm = standing();
        assert!(!alarm.take(&belief(2, 2, false, Readiness::Armed)));
        let mut fallen = belief(2, 3, false, Readiness::Armed);
        fallen.alarm_count = 1;
        assert!(alarm.take(&fallen));
        assert!(!alarm.stands());
    }

    #[test]
    fn without_an_alarm_or_in_a_new_run_nothing_is_held() {
        let mut quiet = DetectorAlarm::default();
        assert!(quiet.take(&belief(1, 0, false, Readiness::Armed)));
        assert!(quiet.take(&belief(2, 1, false, Readiness::Arming)));
        let mut alarm = standing();
        alarm.begin_run(1);
        assert!(alarm.stands());
        let mut next = belief(2, 2, false, Readiness::Arming);
        next.run_id = 2;
        assert!(alarm.take(&next));
        assert_eq!((alarm.stands(), alarm.t_ns()), (false, 0));
    }

    #[test]
    fn a_long_gap_proves_half_a_second() {
        let mut alarm = standing();
        assert!(!alarm.take(&belief(2, 100, false, Readiness::Armed)));
        assert!(alarm.take(&belief(2, 200, false, Readiness::Armed)));
    }

    #[test]
    fn what_an_earlier_reader_has_left_is_held_and_is_no_other_alarm() {
        let left = Carryover {
            run_id: 1,
            detected_t_capture_ns: 7,
            p_fault: f64::NAN,
            ..Carryover::default()
        };
        let mut held = DetectorAlarm::restored(&left);
        assert_eq!((held.stands(), held.t_ns(), held.p_fault()), (true, 7, 1.0));
        assert!(!held.take(&belief(2, 3, false, Readiness::Arming)));
        assert!(held.is_held());
        // The same detector, which still stands by its alarm, and another one.
        for epoch in [1, 2] {
            let mut alarm = DetectorAlarm::restored(&left);
            assert!(alarm.take(&belief(epoch, 4, true, Readiness::Armed)));
            assert_eq!((alarm.t_ns(), alarm.is_held()), (7, false));
        }
        // The same detector, whose frames come from another publisher since: it begins anew.
        let mut alarm = DetectorAlarm::restored(&left);
        let mut anew = belief(1, 4, false, Readiness::Arming);
        anew.alarm_count = 3;
        assert!(!alarm.take(&anew) && alarm.is_held());
        assert!(!DetectorAlarm::restored(&Carryover::default()).stands());
    }
}

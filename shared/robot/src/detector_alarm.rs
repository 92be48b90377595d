//! The detector's alarm as its readers know it, also when another detector takes its place.

use vigil_blocks::{DetectionBelief, Readiness};
use vigil_checkpoint::CheckpointValue;

/// Motion, s, for which a new detector must be armed before its silence ends the alarm of the one
/// before it. Chosen: as long as a detector's own alarm takes to fall.
const PROOF_S: f64 = 1.0;
/// Motion between two beliefs counts for at most this long, s. Chosen: ten observations of 50 ms;
/// what is further apart does not show what was between.
const STEP_MAX_S: f64 = 0.5;
/// Slack when that time is compared, s: it is a sum of short intervals.
const SLACK_S: f64 = 1e-6;

/// What the detector says of a fault. One that has just begun knows nothing of an alarm that stood
/// before it: that alarm is held until the new detector has raised its own, or has been armed for a
/// second of motion without one. So it is held as long as the robot rests; a new run ends it.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct DetectorAlarm {
    epoch: u64,
    run_id: u64,
    t_capture_ns: u64,
    stands: bool,
    alarm_t_ns: u64,
    p_fault: f64,
    count: u32,
    /// Alarms of the detectors before, without the one that is held.
    count_before: u32,
    /// While an alarm is held: for how long the new detector has been armed in motion, s.
    proof_s: Option<f64>,
}

impl DetectorAlarm {
    /// Takes the next belief; false while an alarm is held against it.
    pub fn take(&mut self, belief: &DetectionBelief) -> bool {
        let (epoch, t_ns) = (belief.header.epoch, belief.header.t_capture_ns);
        let passed_s = t_ns.saturating_sub(self.t_capture_ns) as f64 * 1e-9;
        if belief.run_id != self.run_id {
            *self = Self::default();
        } else if epoch != self.epoch {
            self.proof_s = self.stands.then_some(0.0);
            self.count_before = self.count - u32::from(self.stands && self.count > 0);
        }
        (self.epoch, self.run_id, self.t_capture_ns) = (epoch, belief.run_id, t_ns);
        let is_silent = belief.alarm == 0 && belief.alarm_count == 0;
        if let Some(proof_s) = self.proof_s.as_mut().filter(|_| is_silent) {
            if belief.readiness == Readiness::Armed as u32 {
                *proof_s += passed_s.min(STEP_MAX_S);
            }
            if *proof_s < PROOF_S - SLACK_S {
                return false;
            }
            // It has ended: the next alarm is another one.
            self.count_before += u32::from(self.count > self.count_before);
        }
        self.proof_s = None;
        self.stands = belief.alarm != 0;
        (self.alarm_t_ns, self.p_fault) = (belief.alarm_t_capture_ns, belief.p_fault);
        self.count = self.count_before.saturating_add(belief.alarm_count);
        true
    }

    /// Holds an alarm of which another stage tells, against the belief that was taken last: this
    /// reader has begun after the detector that had raised it was gone.
    pub const fn hold(&mut self, alarm_t_ns: u64, p_fault: f64) {
        (self.stands, self.alarm_t_ns, self.p_fault) = (true, alarm_t_ns, p_fault);
        (self.count, self.proof_s) = (1, Some(0.0));
    }

    /// True while an alarm is held against what the present detector says.
    #[must_use]
    pub const fn is_held(&self) -> bool {
        self.proof_s.is_some()
    }

    /// True while it stands.
    #[must_use]
    pub const fn stands(&self) -> bool {
        self.stands
    }

    /// Capture time of the frame that raised it, ns; 0 without one.
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

    /// Alarms of this run, by this detector and by those before it; one that was held until the
    /// next detector raised its own counts once.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A belief of the detector that began at `epoch`, after so many steps of 100 ms.
    fn belief(epoch: u64, step: u64, alarm: bool, readiness: Readiness) -> DetectionBelief {
        let mut belief = DetectionBelief {
            alarm: alarm.into(),
            alarm_count: alarm.into(),
            p_fault: if alarm { 0.75 } else { 0.0 },
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
        alarm
    }

    #[test]
    fn an_alarm_is_held_until_the_next_detector_has_been_armed_for_a_second() {
        let mut alarm = standing();
        for step in 2..40 {
            assert!(!alarm.take(&belief(2, step, false, Readiness::Arming)));
            assert!(!alarm.take(&belief(2, step, false, Readiness::NotExcited)));
        }
        for step in 40..49 {
            assert!(!alarm.take(&belief(2, step, false, Readiness::Armed)));
            assert_eq!((alarm.is_held(), alarm.p_fault()), (true, 0.75));
        }
        assert!(alarm.take(&belief(2, 49, false, Readiness::Armed)));
        assert_eq!((alarm.stands(), alarm.count()), (false, 1));
        assert!(alarm.take(&belief(2, 50, true, Readiness::Armed)));
        assert_eq!(alarm.count(), 2, "another one");
    }

    #[test]
    fn the_next_detectors_own_alarm_counts_at_once_and_is_the_one_that_stood() {
        let mut alarm = standing();
        assert!(!alarm.take(&belief(2, 2, false, Readiness::Arming)));
        assert!(alarm.take(&belief(2, 3, true, Readiness::Armed)));
        assert_eq!(alarm.count(), 1);
        let mut fallen = belief(2, 4, false, Readiness::Armed);
        fallen.alarm_count = 1;
        assert!(alarm.take(&fallen));
        assert!(alarm.take(&belief(3, 5, false, Readiness::Arming)));
        assert_eq!(alarm.count(), 1);
        assert!(alarm.take(&belief(3, 6, true, Readiness::Armed)));
        assert_eq!(alarm.count(), 2);
    }

    #[test]
    fn an_alarm_that_rose_and_fell_unseen_has_ended() {
        let mut alarm = standing();
        assert!(!alarm.take(&belief(2, 2, false, Readiness::Armed)));
        let mut fallen = belief(2, 3, false, Readiness::Armed);
        fallen.alarm_count = 1;
        assert!(alarm.take(&fallen));
        assert_eq!((alarm.stands(), alarm.count()), (false, 1));
    }

    #[test]
    fn without_an_alarm_or_in_a_new_run_nothing_is_held() {
        let mut quiet = DetectorAlarm::default();
        assert!(quiet.take(&belief(1, 0, false, Readiness::Armed)));
        assert!(quiet.take(&belief(2, 1, false, Readiness::Arming)));
        let mut alarm = standing();
        let mut next = belief(2, 2, false, Readiness::Arming);
        next.run_id = 2;
        assert!(alarm.take(&next));
        assert_eq!((alarm.stands(), alarm.count()), (false, 0));
    }

    #[test]
    fn a_long_gap_proves_half_a_second() {
        let mut alarm = standing();
        assert!(!alarm.take(&belief(2, 100, false, Readiness::Armed)));
        assert!(alarm.take(&belief(2, 200, false, Readiness::Armed)));
    }

    #[test]
    fn who_has_begun_later_holds_what_another_stage_tells() {
        let mut alarm = DetectorAlarm::default();
        assert!(alarm.take(&belief(2, 2, false, Readiness::Arming)));
        alarm.hold(7, f64::NAN);
        assert!(!alarm.take(&belief(2, 3, false, Readiness::Arming)));
        assert_eq!((alarm.stands(), alarm.t_ns()), (true, 7));
        assert_eq!((alarm.p_fault(), alarm.is_held()), (1.0, true));
        assert!(alarm.take(&belief(2, 4, true, Readiness::Armed)));
        assert_eq!((alarm.count(), alarm.is_held()), (1, false));
    }
}

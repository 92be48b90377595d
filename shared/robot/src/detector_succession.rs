//! One detector follows another: a process that was replaced.

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

/// Tells whether what a detector says counts. One that has just begun knows nothing of an alarm
/// that stood before it: that alarm stands until the new one raises its own, or until it has been
/// armed for a second of motion without one.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct DetectorSuccession {
    epoch: u64,
    run_id: u64,
    t_ns: u64,
    /// The alarm of the last belief that counted.
    alarm: bool,
    /// How many alarms there had been.
    count: u32,
    /// Alarms of those before, without the one that goes on.
    count_before: u32,
    /// While that alarm stands on: for how long the new detector has been armed, s.
    proof_s: Option<f64>,
}

impl DetectorSuccession {
    /// Takes the next belief; false while what was believed before it stands.
    pub fn counts(&mut self, belief: &DetectionBelief) -> bool {
        let (epoch, t_ns) = (belief.header.epoch, belief.header.t_capture_ns);
        let passed_s = t_ns.saturating_sub(self.t_ns) as f64 * 1e-9;
        if belief.run_id != self.run_id {
            *self = Self::default();
        } else if epoch != self.epoch {
            self.proof_s = self.alarm.then_some(0.0);
            self.count_before = self.count - u32::from(self.alarm && self.count > 0);
        }
        (self.epoch, self.run_id, self.t_ns) = (epoch, belief.run_id, t_ns);
        if let Some(proof_s) = &mut self.proof_s {
            if belief.readiness == Readiness::Armed as u32 {
                *proof_s += passed_s.min(STEP_MAX_S);
            }
            if belief.alarm == 0 && *proof_s < PROOF_S - SLACK_S {
                return false;
            }
            // It has ended: the next alarm is another one.
            self.count_before += u32::from(belief.alarm == 0 && self.count > self.count_before);
        }
        self.proof_s = None;
        self.alarm = belief.alarm != 0;
        self.count = self.count_before.saturating_add(belief.alarm_count);
        true
    }

    /// Alarms that were raised in this run, by this detector and by those before it. One that went
    /// on counts once.
    #[must_use]
    pub const fn alarm_count(&self) -> u32 {
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
            readiness: readiness as u32,
            run_id: 1,
            ..DetectionBelief::default()
        };
        belief.header.epoch = epoch;
        belief.header.t_capture_ns = step * 100_000_000;
        belief
    }

    fn alarmed() -> DetectorSuccession {
        let mut succession = DetectorSuccession::default();
        assert!(succession.counts(&belief(1, 0, false, Readiness::Arming)));
        assert!(succession.counts(&belief(1, 1, true, Readiness::Armed)));
        succession
    }

    #[test]
    fn an_alarm_stands_until_the_next_detector_has_been_armed_for_a_second() {
        let mut succession = alarmed();
        for step in 2..40 {
            assert!(!succession.counts(&belief(2, step, false, Readiness::Arming)));
            assert!(!succession.counts(&belief(2, step, false, Readiness::NotExcited)));
        }
        for step in 40..49 {
            assert!(!succession.counts(&belief(2, step, false, Readiness::Armed)));
        }
        assert!(succession.counts(&belief(2, 49, false, Readiness::Armed)));
        assert_eq!(succession.alarm_count(), 1);
        assert!(succession.counts(&belief(2, 50, true, Readiness::Armed)));
        assert_eq!(succession.alarm_count(), 2, "another one");
    }

    #[test]
    fn its_own_alarm_counts_at_once_and_is_the_one_that_stood() {
        let mut succession = alarmed();
        assert!(!succession.counts(&belief(2, 2, false, Readiness::Arming)));
        assert!(succession.counts(&belief(2, 3, true, Readiness::Armed)));
        assert_eq!(succession.alarm_count(), 1);
        let mut fallen = belief(2, 4, false, Readiness::Armed);
        fallen.alarm_count = 1;
        assert!(succession.counts(&fallen));
        assert!(succession.counts(&belief(3, 5, false, Readiness::Arming)));
        assert_eq!(succession.alarm_count(), 1);
        assert!(succession.counts(&belief(3, 6, true, Readiness::Armed)));
        assert_eq!(succession.alarm_count(), 2);
    }

    #[test]
    fn without_an_alarm_or_in_a_new_run_there_is_nothing_to_stand() {
        let mut quiet = DetectorSuccession::default();
        assert!(quiet.counts(&belief(1, 0, false, Readiness::Armed)));
        assert!(quiet.counts(&belief(2, 1, false, Readiness::Arming)));
        let mut succession = alarmed();
        let mut next = belief(2, 2, false, Readiness::Arming);
        next.run_id = 2;
        assert!(succession.counts(&next));
        assert_eq!(succession.alarm_count(), 0);
    }

    #[test]
    fn a_long_gap_proves_half_a_second() {
        let mut succession = alarmed();
        assert!(!succession.counts(&belief(2, 100, false, Readiness::Armed)));
        assert!(succession.counts(&belief(2, 200, false, Readiness::Armed)));
    }
}

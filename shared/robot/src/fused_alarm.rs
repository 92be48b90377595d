//! The fused alarm: the detector's, unless the identifier has found the robot nominal since.
//!
//! The detector decides the onset, and its alarm falls late. The identifier explains the same
//! measurements and may find the robot nominal earlier. The two contradict each other for a second
//! of motion at most. After that the identifier decides, until its p(nominal) falls or the detector
//! raises another alarm.

use vigil_blocks::Carryover;
use vigil_checkpoint::CheckpointValue;

/// Probability of nominal above which a diagnosis contradicts an alarm. Even odds: a lower bound
/// would end alarms that the identifier itself holds for likely.
pub const NOMINAL: f64 = 0.5;
/// Motion, s, after which such a diagnosis ends the alarm. Chosen: as long as the detector's own
/// alarm takes to fall; shorter, and single observations toggle it.
pub const NOMINAL_S: f64 = 1.0;
/// Probability of nominal below which an alarm that the identifier has ended stands again. Chosen:
/// 0.2 below [`NOMINAL`], so that a diagnosis at even odds does not toggle it. A lower one
/// keeps an alarm down that was ended wrongly.
const NOMINAL_DOUBTED: f64 = 0.3;
/// Motion, s, after which a larger fault set counts as a further fault. Chosen: four 50 ms
/// observations must agree. With fewer, one wrong set raises an alarm; with more, the alarm of a
/// second fault comes later.
const GROWN_S: f64 = 0.2;
/// Slack when times are compared, s: they are sums of short intervals, each rounded.
const SLACK_S: f64 = 1e-6;

/// Detector's alarm and identifier's belief for one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageBeliefs {
    /// Capture time of the frame, ns.
    pub t_ns: u64,
    /// Time since the frame before, s; 0 while the robot stands, which excites nothing.
    pub moved_s: f64,
    /// True while the detector's alarm stands.
    pub alarm: bool,
    /// Capture time of the frame that raised the detector's alarm, ns: it tells alarms apart.
    pub alarm_t_ns: u64,
    /// The identifier's probability that nothing is wrong; 0 if none is heard.
    pub p_nominal: f64,
    /// Faults in the set that the identifier reports; 0 for none.
    pub faults: u32,
}

/// Fuses the detector's alarm with the identifier's diagnosis. Of one stage alone, use
/// [`crate::alarm::Alarm`].
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct FusedAlarm {
    stands: bool,
    t_ns: u64,
    count: u32,
    /// The detector's alarm in the frame before, and when it was raised, ns.
    was_raised: bool,
    raised_t_ns: u64,
    nominal_s: f64,
    /// Most faults reported during this alarm, and for how long there have been more.
    faults: u32,
    grown_s: f64,
}

impl FusedAlarm {
    /// The alarm that an earlier supervisor of the same run has left.
    #[must_use]
    pub fn restored(left: &Carryover) -> Self {
        let was_raised = left.detected_t_capture_ns != 0;
        let stands = was_raised && left.alarm_t_capture_ns != 0;
        Self {
            stands,
            t_ns: if stands { left.alarm_t_capture_ns } else { 0 },
            count: left.alarm_count,
            was_raised,
            raised_t_ns: left.detected_t_capture_ns,
            ..Self::default()
        }
    }

    /// True while it stands.
    #[must_use]
    pub const fn stands(&self) -> bool {
        self.stands
    }

    /// Capture time of the frame that raised it, ns; 0 without alarm.
    #[must_use]
    pub const fn t_ns(&self) -> u64 {
        self.t_ns
    }

    /// Alarms so far. A second fault during an alarm is an alarm of its own.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// A new run begins: it stands no longer.
    pub const fn reset(&mut self) {
        self.fall();
        self.was_raised = false;
    }

    /// Takes the stages' beliefs for the next frame.
    pub fn take(&mut self, stages: &StageBeliefs) {
        self.update(stages);
        self.check(stages);
    }

    /// The detector decides the onset, so no other stage's word raises the fused alarm.
    fn check(&self, stages: &StageBeliefs) {
        assert!(
            stages.alarm || !self.stands,
            "the fused alarm stands only while the detector's does"
        );
    }

    fn update(&mut self, stages: &StageBeliefs) {
        let is_new = !self.was_raised || stages.alarm_t_ns != self.raised_t_ns;
        (self.was_raised, self.raised_t_ns) = (stages.alarm, stages.alarm_t_ns);
        if !stages.alarm {
            return self.fall();
        }
        if is_new {
            return self.rise(stages.alarm_t_ns.max(1), stages.faults);
        }
        if !self.stands {
            if stages.p_nominal < NOMINAL_DOUBTED {
                self.rise(stages.t_ns.max(1), stages.faults);
            }
            return;
        }
        self.nominal_s = match stages.p_nominal > NOMINAL {
            true => self.nominal_s + stages.moved_s,
            false => 0.0,
        };
        if self.nominal_s >= NOMINAL_S - SLACK_S {
            return self.fall();
        }
        self.follow(stages);
    }

    /// The first fault set that is named explains the alarm; a larger one is a further fault.
    fn follow(&mut self, stages: &StageBeliefs) {
        if self.faults == 0 || stages.faults <= self.faults {
            self.faults = self.faults.max(stages.faults);
            self.grown_s = 0.0;
            return;
        }
        self.grown_s += stages.moved_s;
        if self.grown_s >= GROWN_S - SLACK_S {
            self.rise(stages.t_ns.max(1), stages.faults);
        }
    }

    const fn rise(&mut self, t_ns: u64, faults: u32) {
        (self.stands, self.t_ns) = (true, t_ns);
        self.count = self.count.saturating_add(1);
        (self.nominal_s, self.grown_s) = (0.0, 0.0);
        self.faults = faults;
    }

    const fn fall(&mut self) {
        (self.stands, self.t_ns) = (false, 0);
        (self.nominal_s, self.grown_s) = (0.0, 0.0);
        self.faults = 0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ALARM: StageBeliefs = StageBeliefs {
        t_ns: 7,
        moved_s: 0.1,
        alarm: true,
        alarm_t_ns: 5,
        p_nominal: 0.01,
        faults: 0,
    };
    const QUIET: StageBeliefs = StageBeliefs {
        alarm: false,
        alarm_t_ns: 0,
        p_nominal: 1.0,
        ..ALARM
    };

    fn standing() -> FusedAlarm {
        let mut alarm = FusedAlarm::default();
        alarm.take(&QUIET);
        assert!(!alarm.stands());
        alarm.take(&ALARM);
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (true, 5, 1));
        alarm
    }

    fn takes(alarm: &mut FusedAlarm, times: usize, stages: StageBeliefs) {
        (0..times).for_each(|_| alarm.take(&stages));
    }

    #[test]
    fn it_rises_and_falls_with_the_detectors() {
        let mut alarm = standing();
        takes(&mut alarm, 100, ALARM);
        assert!(alarm.stands());
        alarm.take(&QUIET);
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (false, 0, 1));
        alarm.take(&StageBeliefs {
            alarm_t_ns: 6,
            ..ALARM
        });
        assert_eq!((alarm.stands(), alarm.count()), (true, 2));
    }

    #[test]
    fn a_nominal_diagnosis_ends_it_after_a_second_of_motion() {
        let nominal = StageBeliefs {
            p_nominal: 0.96,
            ..ALARM
        };
        let mut alarm = standing();
        takes(&mut alarm, 9, nominal);
        // At rest nothing is shown, and one other word begins the second anew.
        takes(
            &mut alarm,
            50,
            StageBeliefs {
                moved_s: 0.0,
                ..nominal
            },
        );
        assert!(alarm.stands());
        alarm.take(&ALARM);
        takes(&mut alarm, 9, nominal);
        assert!(alarm.stands());
        alarm.take(&nominal);
        assert!(!alarm.stands());
        // It stays down while the identifier holds, and rises when it does not.
        takes(
            &mut alarm,
            50,
            StageBeliefs {
                p_nominal: 0.35,
                ..nominal
            },
        );
        assert_eq!((alarm.stands(), alarm.count()), (false, 1));
        alarm.take(&StageBeliefs {
            p_nominal: 0.25,
            ..nominal
        });
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (true, 7, 2));
    }

    #[test]
    fn another_alarm_of_the_detector_is_one_whatever_the_identifier_says() {
        let nominal = StageBeliefs {
            p_nominal: 1.0,
            ..ALARM
        };
        let mut alarm = standing();
        takes(&mut alarm, 10, nominal);
        assert!(!alarm.stands());
        alarm.take(&StageBeliefs {
            alarm_t_ns: 6,
            ..nominal
        });
        assert_eq!((alarm.stands(), alarm.count()), (true, 2));
        alarm.take(&StageBeliefs {
            alarm_t_ns: 7,
            ..ALARM
        });
        assert_eq!((alarm.stands(), alarm.count()), (true, 3));
    }

    #[test]
    fn a_second_fault_during_the_first_is_an_alarm_of_its_own() {
        let of = |faults| StageBeliefs { faults, ..ALARM };
        let mut alarm = standing();
        takes(&mut alarm, 5, of(1));
        alarm.take(&of(2));
        takes(&mut alarm, 5, of(1));
        assert_eq!(alarm.count(), 1);
        takes(&mut alarm, 2, of(2));
        assert_eq!((alarm.count(), alarm.t_ns()), (2, 7));
        // The set may shrink and come back: these are no faults that nobody knew.
        takes(&mut alarm, 5, of(1));
        takes(&mut alarm, 5, of(2));
        assert_eq!(alarm.count(), 2);
        takes(&mut alarm, 2, of(3));
        assert_eq!(alarm.count(), 3);
    }

    #[test]
    fn a_new_run_begins_without_it() {
        let mut alarm = standing();
        alarm.reset();
        assert!(!alarm.stands());
        alarm.take(&QUIET);
        assert_eq!((alarm.stands(), alarm.count()), (false, 1));
    }

    #[test]
    fn what_an_earlier_supervisor_has_left_stands_on_and_is_no_other_alarm() {
        let left = Carryover {
            detected_t_capture_ns: 5,
            alarm_t_capture_ns: 6,
            alarm_count: 3,
            ..Carryover::default()
        };
        let mut alarm = FusedAlarm::restored(&left);
        alarm.take(&ALARM);
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (true, 6, 3));
        // One that the identifier had ended stays so.
        let ended = Carryover {
            alarm_t_capture_ns: 0,
            ..left
        };
        let mut alarm = FusedAlarm::restored(&ended);
        alarm.take(&StageBeliefs {
            p_nominal: 0.9,
            ..ALARM
        });
        assert_eq!((alarm.stands(), alarm.count()), (false, 3));
        // Without the detector's there is none.
        let none = Carryover {
            detected_t_capture_ns: 0,
            ..left
        };
        assert!(!FusedAlarm::restored(&none).stands());
    }

    #[test]
    fn bounds_of_the_nominal_probability_are_exclusive() {
        let even = StageBeliefs {
            p_nominal: NOMINAL,
            ..ALARM
        };
        let mut alarm = standing();
        takes(&mut alarm, 100, even);
        assert!(alarm.stands());
        takes(
            &mut alarm,
            10,
            StageBeliefs {
                p_nominal: 0.51,
                ..ALARM
            },
        );
        assert!(!alarm.stands());
        takes(
            &mut alarm,
            10,
            StageBeliefs {
                p_nominal: NOMINAL_DOUBTED,
                ..ALARM
            },
        );
        assert!(!alarm.stands());
        takes(
            &mut alarm,
            1,
            StageBeliefs {
                p_nominal: 0.299,
                ..ALARM
            },
        );
        assert!(alarm.stands());
    }

    #[test]
    fn the_first_set_that_is_named_is_no_further_fault_however_large() {
        let mut alarm = standing();
        takes(&mut alarm, 20, StageBeliefs { faults: 3, ..ALARM });
        assert_eq!(alarm.count(), 1);
        // At rest a larger set shows nothing.
        takes(
            &mut alarm,
            20,
            StageBeliefs {
                faults: 4,
                moved_s: 0.0,
                ..ALARM
            },
        );
        assert_eq!(alarm.count(), 1);
        takes(
            &mut alarm,
            1,
            StageBeliefs {
                faults: 4,
                moved_s: 0.19,
                ..ALARM
            },
        );
        assert_eq!(alarm.count(), 1);
        takes(
            &mut alarm,
            1,
            StageBeliefs {
                faults: 4,
                moved_s: 0.01,
                ..ALARM
            },
        );
        assert_eq!(alarm.count(), 2);
    }

    #[test]
    fn an_alarm_that_still_stands_in_a_new_run_is_another_and_0_ns_is_told_from_no_alarm() {
        let mut alarm = standing();
        alarm.reset();
        alarm.take(&StageBeliefs {
            alarm_t_ns: 0,
            ..ALARM
        });
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (true, 1, 2));
    }

    #[test]
    #[should_panic(expected = "the fused alarm stands only while the detector's does")]
    fn an_alarm_that_no_stage_raised_would_end_the_process() {
        standing().check(&QUIET);
    }

    proptest! {
        #[test]
        fn it_follows_the_detector_whatever_the_identifier_says(
            all in prop::collection::vec(
                (any::<[u64; 2]>(), any::<u32>(), any::<(u64, u64, bool)>()), 1..60),
        ) {
            let mut alarm = FusedAlarm::default();
            let mut count = 0;
            for (bits, faults, (t_ns, alarm_t_ns, raised)) in all {
                let [moved_s, p_nominal] = bits.map(f64::from_bits);
                let stages = StageBeliefs {
                    t_ns, moved_s, alarm: raised, alarm_t_ns, p_nominal, faults,
                };
                alarm.take(&stages);
                prop_assert!(raised || !alarm.stands());
                prop_assert_eq!(alarm.stands(), alarm.t_ns() != 0);
                prop_assert!(alarm.count() >= count);
                count = alarm.count();
            }
        }
    }
}

//! The alarm that a user reads: the detector's, unless the identifier has found the robot nominal
//! since.
//!
//! The detector decides the onset. It is slow to take an alarm back; the identifier, which explains
//! the same readings, may know earlier. Alarm and diagnosis contradict each other for a second of
//! motion at most: then the identifier's word counts, until it takes that back or the detector
//! raises another alarm.

/// A diagnosis that is nominal by more than this contradicts an alarm, and a name ..
pub const NOMINAL: f64 = 0.5;
/// .. and ends both after so much motion, s.
pub const NOMINAL_S: f64 = 1.0;
/// An alarm that a nominal diagnosis has ended stands again once that is below this. Chosen: 0.2
/// below what ends it, so that a diagnosis at even odds does not toggle it.
const DOUBTED: f64 = 0.3;
/// A set of faults that has grown is believed after so much motion, s. Four 50 ms observations
/// agree.
const GROWN_S: f64 = 0.2;
/// Slack when times are compared, s: they are sums of short intervals.
const SLACK_S: f64 = 1e-6;

/// What both stages say of one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageOdds {
    /// Capture time of the frame, ns.
    pub t_ns: u64,
    /// Time since the frame before, s; 0 while the robot stands, which shows nothing.
    pub moved_s: f64,
    /// Whether the detector's alarm stands, since when (capture time, ns), and how many it has
    /// raised.
    pub alarm: bool,
    /// See `alarm`.
    pub alarm_t_ns: u64,
    /// See `alarm`.
    pub alarm_count: u32,
    /// The identifier's probability that nothing is wrong; 0 without an identifier.
    pub p_nominal: f64,
    /// Faults in the set that the identifier reports; 0 for none.
    pub faults: u32,
}

/// Fuses the detector's alarm with the identifier's diagnosis. Of one stage alone, use
/// [`crate::alarm::Alarm`].
#[derive(Debug, Clone, Copy, Default)]
pub struct FusedAlarm {
    stands: bool,
    t_ns: u64,
    count: u32,
    /// The detector's, as last heard.
    was_raised: bool,
    raised_count: u32,
    nominal_s: f64,
    /// Most faults reported during this alarm, and for how long there have been more.
    faults: u32,
    grown_s: f64,
}

impl FusedAlarm {
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

    /// Takes what both stages say of the next frame.
    pub fn take(&mut self, said: &StageOdds) {
        let is_new = !self.was_raised || said.alarm_count != self.raised_count;
        (self.was_raised, self.raised_count) = (said.alarm, said.alarm_count);
        if !said.alarm {
            return self.fall();
        }
        if is_new {
            return self.rise(said.alarm_t_ns.max(1), said.faults);
        }
        if !self.stands {
            if said.p_nominal < DOUBTED {
                self.rise(said.t_ns.max(1), said.faults);
            }
            return;
        }
        self.nominal_s = match said.p_nominal > NOMINAL {
            true => self.nominal_s + said.moved_s,
            false => 0.0,
        };
        if self.nominal_s >= NOMINAL_S - SLACK_S {
            return self.fall();
        }
        self.follow(said);
    }

    /// The first set that is named is what the alarm was about; a larger one is another fault.
    fn follow(&mut self, said: &StageOdds) {
        if self.faults == 0 || said.faults <= self.faults {
            self.faults = self.faults.max(said.faults);
            self.grown_s = 0.0;
            return;
        }
        self.grown_s += said.moved_s;
        if self.grown_s >= GROWN_S - SLACK_S {
            self.rise(said.t_ns.max(1), said.faults);
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
    use super::*;

    const ALARM: StageOdds = StageOdds {
        t_ns: 7,
        moved_s: 0.1,
        alarm: true,
        alarm_t_ns: 5,
        alarm_count: 1,
        p_nominal: 0.01,
        faults: 0,
    };
    const QUIET: StageOdds = StageOdds {
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

    fn takes(alarm: &mut FusedAlarm, times: usize, said: StageOdds) {
        (0..times).for_each(|_| alarm.take(&said));
    }

    #[test]
    fn it_rises_and_falls_with_the_detectors() {
        let mut alarm = standing();
        takes(&mut alarm, 100, ALARM);
        assert!(alarm.stands());
        alarm.take(&QUIET);
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (false, 0, 1));
        alarm.take(&StageOdds {
            alarm_count: 2,
            ..ALARM
        });
        assert_eq!((alarm.stands(), alarm.count()), (true, 2));
    }

    #[test]
    fn a_nominal_diagnosis_ends_it_after_a_second_of_motion() {
        let nominal = StageOdds {
            p_nominal: 0.96,
            ..ALARM
        };
        let mut alarm = standing();
        takes(&mut alarm, 9, nominal);
        // At rest nothing is shown, and one other word begins the second anew.
        takes(
            &mut alarm,
            50,
            StageOdds {
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
            StageOdds {
                p_nominal: 0.35,
                ..nominal
            },
        );
        assert_eq!((alarm.stands(), alarm.count()), (false, 1));
        alarm.take(&StageOdds {
            p_nominal: 0.25,
            ..nominal
        });
        assert_eq!((alarm.stands(), alarm.t_ns(), alarm.count()), (true, 7, 2));
    }

    #[test]
    fn another_alarm_of_the_detector_is_one_whatever_the_identifier_says() {
        let nominal = StageOdds {
            p_nominal: 1.0,
            ..ALARM
        };
        let mut alarm = standing();
        takes(&mut alarm, 10, nominal);
        assert!(!alarm.stands());
        alarm.take(&StageOdds {
            alarm_count: 2,
            ..nominal
        });
        assert_eq!((alarm.stands(), alarm.count()), (true, 2));
        alarm.take(&StageOdds {
            alarm_count: 3,
            ..ALARM
        });
        assert_eq!((alarm.stands(), alarm.count()), (true, 3));
    }

    #[test]
    fn a_second_fault_during_the_first_is_an_alarm_of_its_own() {
        let of = |faults| StageOdds { faults, ..ALARM };
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
}

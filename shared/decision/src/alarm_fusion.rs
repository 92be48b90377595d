//! The fused alarm and the detector's sight. The supervisor alone sees both stages, so it joins
//! them before it decides.

use vigil_blocks::{
    Action, CauseKind, DetectionBelief, Entry, FaultBelief, MODE_BLIND, Readiness, RecoveryKind,
};
use vigil_checkpoint::Checkpoint;
use vigil_robot::DetectorAlarm;
use vigil_robot::fused_alarm::{FusedAlarm, StageBeliefs};

use crate::inputs::Inputs;

/// Detections in a row without a diagnosis after which the identifier counts as lost, as every
/// input of a service does (`vigil_cycle`).
const LOST_AFTER: u32 = 3;
/// A set of faults is reported from this probability on: more likely than not, as every name.
const REPORTED: f64 = 0.5;
/// Motion between two frames counts for at most this long, s: ten observations of 50 ms. Chosen by
/// hand: frames further apart do not show what was between them, and a gap must not end an alarm.
const STEP_MAX_S: f64 = 0.5;

/// The fused alarm of a cycle: what the supervisor has published. Without a supervisor the
/// detector's stands for it.
#[must_use]
pub const fn fused_alarm(detection: &DetectionBelief, action: Option<&Action>) -> bool {
    match action {
        Some(action) => action.alarm != 0,
        None => detection.alarm != 0,
    }
}

/// What decisions depend on besides beliefs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Situation {
    /// The detector is blind: no belief counts.
    pub is_blind: bool,
    /// The fused alarm stands: before it, what has no name counts as nothing.
    pub alarm: bool,
    /// The detector's probability of a fault, also after its replacement.
    pub p_fault: f64,
    /// How probable it is at most that nothing is wrong: beside an alarm of which the identifier
    /// does not know yet, since it has just begun.
    pub p_nominal_max: f64,
    /// The robot rests: nothing that it does would show a fault.
    pub rests: bool,
}

/// Follows detections and diagnoses.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct AlarmFusion {
    alarm: FusedAlarm,
    detected: DetectorAlarm,
    has_begun: bool,
    /// As in the last detection.
    blind: u32,
    readiness: u32,
    run_id: u64,
    t_ns: u64,
    p_nominal: f64,
    /// The identifier knows of an alarm.
    is_identifying: bool,
    faults: u32,
    /// Detections since the last diagnosis.
    unanswered: u32,
    arming_speed_scale: f64,
}

impl AlarmFusion {
    /// While the detector arms, the robot goes on at this share of its speed.
    pub(crate) fn new(arming_speed_scale: f64) -> Self {
        Self {
            alarm: FusedAlarm::default(),
            detected: DetectorAlarm::default(),
            has_begun: false,
            blind: 0,
            readiness: Readiness::Arming as u32,
            run_id: 0,
            t_ns: 0,
            p_nominal: 1.0,
            is_identifying: false,
            faults: 0,
            unanswered: 0,
            arming_speed_scale,
        }
    }

    /// Takes an entry, and returns what of it concerns the belief. A detection that only predicts
    /// says whether the detector is blind, and nothing else.
    pub(crate) fn take<'a>(&mut self, entry: Entry<Inputs<'a>>) -> Entry<Inputs<'a>> {
        let Entry::Frame(inputs) = entry else {
            if matches!(entry, Entry::Reset) {
                self.alarm.reset();
                self.detected = DetectorAlarm::default();
                self.readiness = Readiness::Arming as u32;
                (self.p_nominal, self.faults, self.unanswered) = (1.0, 0, 0);
            }
            return entry;
        };
        let predicts = |d: &DetectionBelief| d.cause.kind() == Some(CauseKind::Missed);
        self.blind = inputs.detection.map_or(self.blind, |d| d.blind);
        let detection = inputs.detection.filter(|d| !predicts(d));
        if let Some(diagnosis) = inputs.diagnosis {
            self.take_diagnosis(diagnosis);
        }
        if let Some(detection) = detection {
            self.fuse(detection, inputs.diagnosis);
        }
        match (inputs.diagnosis, detection) {
            (None, None) => Entry::Missed(0),
            (diagnosis, detection) => Entry::Frame(Inputs {
                diagnosis,
                detection,
            }),
        }
    }

    fn take_diagnosis(&mut self, diagnosis: &FaultBelief) {
        let p = diagnosis.p[0];
        self.p_nominal = if p.is_finite() { p } else { 0.0 };
        self.is_identifying = diagnosis.identifying != 0;
        let set = &diagnosis.sets[0];
        let is_named = diagnosis.set_count > 0 && set.p >= REPORTED;
        self.faults = match is_named && diagnosis.mode != MODE_BLIND {
            true => set.leaves.count_ones(),
            false => 0,
        };
    }

    fn fuse(&mut self, detection: &DetectionBelief, diagnosis: Option<&FaultBelief>) {
        if detection.run_id != self.run_id {
            self.alarm.reset();
            self.run_id = detection.run_id;
        }
        self.unanswered = match diagnosis {
            Some(_) => 0,
            None => self.unanswered.saturating_add(1),
        };
        let is_lost = self.unanswered >= LOST_AFTER;
        let t_ns = detection.header.t_capture_ns;
        let passed_s = t_ns.saturating_sub(self.t_ns) as f64 * 1e-9;
        (self.t_ns, self.readiness) = (t_ns, detection.readiness);
        self.detected.take(detection);
        if let Some(diagnosis) = diagnosis {
            self.hold(detection, diagnosis);
        }
        self.alarm.take(&StageBeliefs {
            t_ns,
            moved_s: if self.rests() {
                0.0
            } else {
                passed_s.min(STEP_MAX_S)
            },
            alarm: self.detected.stands(),
            alarm_t_ns: self.detected.t_ns(),
            alarm_count: self.detected.count(),
            p_nominal: match is_lost {
                true => 0.0,
                false => self.p_nominal.min(self.p_nominal_max()),
            },
            faults: self.faults,
        });
    }

    /// What decisions depend on.
    pub(crate) fn situation(&self) -> Situation {
        Situation {
            is_blind: self.blind != 0,
            alarm: self.alarm.stands(),
            p_fault: self.detected.p_fault(),
            p_nominal_max: self.p_nominal_max(),
            rests: self.rests(),
        }
    }

    fn p_nominal_max(&self) -> f64 {
        match self.detected.stands() && !self.is_identifying {
            true => 1.0 - self.detected.p_fault(),
            false => 1.0,
        }
    }

    /// A detector that arms does not say whether the robot moves: while an alarm is held against
    /// it, nothing counts as shown.
    const fn rests(&self) -> bool {
        let arms = self.readiness == Readiness::Arming as u32;
        self.readiness == Readiness::NotExcited as u32 || arms && self.detected.is_held()
    }

    /// A supervisor that begins beside a detector that has just begun, too, learns from the
    /// identifier of an alarm that stood.
    fn hold(&mut self, detection: &DetectionBelief, diagnosis: &FaultBelief) {
        let is_first = !std::mem::replace(&mut self.has_begun, true);
        let knows = diagnosis.alarm_t_capture_ns != 0 && diagnosis.run_id == detection.run_id;
        let arms = self.readiness == Readiness::Arming as u32 && detection.alarm == 0;
        if is_first && knows && arms {
            let p_fault = 1.0 - diagnosis.p[0];
            self.detected.hold(diagnosis.alarm_t_capture_ns, p_fault);
        }
    }

    /// Writes alarm and blindness into the decision. While the detector arms, the robot goes on
    /// slowly.
    pub(crate) fn write(&self, action: &mut Action) {
        action.alarm = u32::from(self.alarm.stands());
        action.alarm_t_capture_ns = self.alarm.t_ns();
        action.alarm_count = self.alarm.count();
        action.blind = self.blind;
        let arms = self.readiness == Readiness::Arming as u32;
        if arms && action.kind == RecoveryKind::GoOn as u32 {
            action.speed_scale *= self.arming_speed_scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn detection(t_ms: u64, alarm: u32) -> DetectionBelief {
        let mut detection = DetectionBelief {
            alarm,
            alarm_count: alarm,
            readiness: Readiness::Armed as u32,
            ..DetectionBelief::default()
        };
        detection.header.t_capture_ns = t_ms * MS;
        detection
    }

    fn diagnosis(p_nominal: f64) -> FaultBelief {
        let mut diagnosis = FaultBelief::default();
        diagnosis.p[0] = p_nominal;
        diagnosis
    }

    fn take(fusion: &mut AlarmFusion, d: Option<&DetectionBelief>, f: Option<&FaultBelief>) {
        let inputs = Inputs {
            diagnosis: f,
            detection: d,
        };
        fusion.take(Entry::Frame(inputs));
    }

    #[test]
    fn the_published_alarm_counts_before_the_detectors() {
        let (alarm, none) = (detection(0, 1), detection(0, 0));
        let published = |alarm| Action {
            alarm,
            ..Action::default()
        };
        assert!(fused_alarm(&alarm, None) && !fused_alarm(&none, None));
        assert!(!fused_alarm(&alarm, Some(&published(0))));
        assert!(fused_alarm(&none, Some(&published(1))));
    }

    #[test]
    fn an_identifier_that_is_lost_does_not_end_an_alarm() {
        // The third detection without a diagnosis counts as lost; then no motion ends the alarm.
        for (unanswered, stands) in [(2, false), (3, true)] {
            let mut fusion = AlarmFusion::new(0.5);
            take(&mut fusion, Some(&detection(0, 1)), Some(&diagnosis(1.0)));
            assert!(fusion.situation().alarm);
            for k in 1..=200 {
                let answer = (k % (unanswered + 1) == 0).then(|| diagnosis(1.0));
                take(&mut fusion, Some(&detection(10 * k, 1)), answer.as_ref());
            }
            assert_eq!(fusion.situation().alarm, stands, "{unanswered}");
        }
    }

    #[test]
    fn the_alarm_of_a_detector_that_was_replaced_stands_until_the_next_one_can_tell() {
        let mut fusion = AlarmFusion::new(0.5);
        let mut first = detection(0, 1);
        (first.header.epoch, first.p_fault) = (1, 0.75);
        take(&mut fusion, Some(&first), Some(&diagnosis(0.0)));
        let mut next = |t_ms, readiness| {
            let mut next = detection(t_ms, 0);
            (next.header.epoch, next.readiness) = (2, readiness as u32);
            take(&mut fusion, Some(&next), Some(&diagnosis(0.0)));
            let Situation { alarm, p_fault, .. } = fusion.situation();
            (alarm, p_fault)
        };
        assert_eq!(next(100, Readiness::Arming), (true, 0.75));
        assert_eq!(next(5000, Readiness::Armed), (true, 0.75));
        assert_eq!(next(5400, Readiness::Armed), (true, 0.75));
        assert_eq!(next(5600, Readiness::Armed), (false, 0.0));
    }

    #[test]
    fn beside_a_detector_that_arms_nothing_shows_that_an_alarm_has_ended() {
        let mut fusion = AlarmFusion::new(0.5);
        let mut first = detection(0, 1);
        (first.header.epoch, first.p_fault) = (1, 0.75);
        take(&mut fusion, Some(&first), Some(&diagnosis(0.0)));
        let mut next = |t_ms, readiness| {
            let mut next = detection(t_ms, 0);
            (next.header.epoch, next.readiness) = (2, readiness as u32);
            // An identifier that was replaced, too: it does not know of the alarm.
            take(&mut fusion, Some(&next), Some(&diagnosis(1.0)));
            fusion.situation()
        };
        for step in 1..100 {
            let situation = next(100 * step, Readiness::Arming);
            assert!(situation.alarm && situation.rests);
            assert_eq!(situation.p_nominal_max, 0.25);
        }
        for step in 100..109 {
            let situation = next(100 * step, Readiness::Armed);
            assert!(situation.alarm && !situation.rests);
        }
        let situation = next(10_900, Readiness::Armed);
        assert_eq!((situation.alarm, situation.p_nominal_max), (false, 1.0));
    }

    #[test]
    fn a_supervisor_that_begins_beside_a_new_detector_learns_of_the_alarm_from_the_identifier() {
        let mut stands = diagnosis(0.25);
        stands.alarm_t_capture_ns = 7;
        let mut arming = detection(100, 0);
        arming.readiness = Readiness::Arming as u32;
        let situation = |detection: &DetectionBelief, diagnosis: &FaultBelief| {
            let mut fusion = AlarmFusion::new(0.5);
            take(&mut fusion, Some(detection), Some(diagnosis));
            let Situation { alarm, p_fault, .. } = fusion.situation();
            (alarm, p_fault, fusion.alarm.t_ns())
        };
        assert_eq!(situation(&arming, &stands), (true, 0.75, 7));
        assert_eq!(situation(&detection(100, 0), &stands), (false, 0.0, 0));
        stands.run_id = 5;
        assert_eq!(situation(&arming, &stands), (false, 0.0, 0));
    }

    #[test]
    fn a_gap_counts_for_half_a_second_of_motion() {
        let mut fusion = AlarmFusion::new(0.5);
        take(&mut fusion, Some(&detection(1, 1)), Some(&diagnosis(1.0)));
        take(
            &mut fusion,
            Some(&detection(9_000, 1)),
            Some(&diagnosis(1.0)),
        );
        assert!(fusion.situation().alarm);
        take(
            &mut fusion,
            Some(&detection(9_600, 1)),
            Some(&diagnosis(1.0)),
        );
        assert!(!fusion.situation().alarm);
    }

    #[test]
    fn a_probability_that_is_none_is_no_word_of_health() {
        let mut fusion = AlarmFusion::new(0.5);
        take(&mut fusion, None, Some(&diagnosis(f64::NAN)));
        assert_eq!(fusion.p_nominal, 0.0);
        take(&mut fusion, None, Some(&diagnosis(0.25)));
        assert_eq!(fusion.p_nominal, 0.25);
        assert_eq!(fusion.faults, 0);
    }

    #[test]
    fn faults_are_those_of_a_reported_set_while_the_identifier_sees() {
        let mut fusion = AlarmFusion::new(0.5);
        let mut faults = |p, set_count, mode| {
            let mut diagnosis = FaultBelief {
                set_count,
                mode,
                ..FaultBelief::default()
            };
            (diagnosis.sets[0].p, diagnosis.sets[0].leaves) = (p, 0b110);
            fusion.take_diagnosis(&diagnosis);
            fusion.faults
        };
        assert_eq!(faults(0.5, 1, 0), 2);
        assert_eq!(faults(0.49, 1, 0), 0);
        assert_eq!(faults(0.9, 0, 0), 0);
        assert_eq!(faults(0.9, 1, MODE_BLIND), 0);
    }

    #[test]
    fn a_reset_or_a_new_run_ends_the_alarm() {
        let mut fusion = AlarmFusion::new(0.5);
        take(&mut fusion, Some(&detection(10, 1)), Some(&diagnosis(0.0)));
        fusion.take(Entry::Missed(9));
        assert!(fusion.situation().alarm);
        fusion.take(Entry::Reset);
        assert!(!fusion.situation().alarm);
        assert_eq!(
            (fusion.p_nominal, fusion.readiness),
            (1.0, Readiness::Arming as u32)
        );
        take(&mut fusion, Some(&detection(20, 1)), Some(&diagnosis(0.0)));
        assert!(fusion.situation().alarm);
        let mut next = detection(30, 0);
        next.run_id = 7;
        take(&mut fusion, Some(&next), Some(&diagnosis(0.0)));
        assert!(!fusion.situation().alarm);
        assert_eq!(fusion.run_id, 7);
    }

    #[test]
    fn only_going_on_is_slowed_and_only_while_the_detector_arms() {
        let mut fusion = AlarmFusion::new(0.25);
        let scale = |fusion: &AlarmFusion, kind: RecoveryKind| {
            let mut action = Action {
                kind: kind as u32,
                speed_scale: 0.8,
                ..Action::default()
            };
            fusion.write(&mut action);
            action.speed_scale
        };
        assert_eq!(scale(&fusion, RecoveryKind::GoOn), 0.2);
        assert_eq!(scale(&fusion, RecoveryKind::Compensate), 0.8);
        take(&mut fusion, Some(&detection(0, 0)), None);
        assert_eq!(scale(&fusion, RecoveryKind::GoOn), 0.8);
    }

    #[test]
    fn a_prediction_says_whether_the_detector_is_blind_and_nothing_else() {
        let mut fusion = AlarmFusion::new(0.5);
        let mut predicted = detection(5, 1);
        predicted.cause.kind = CauseKind::Missed as u32;
        predicted.blind = 2;
        let inputs = Inputs {
            diagnosis: None,
            detection: Some(&predicted),
        };
        assert!(matches!(
            fusion.take(Entry::Frame(inputs)),
            Entry::Missed(0)
        ));
        let situation = fusion.situation();
        assert!(situation.is_blind && !situation.alarm);
        let mut action = Action::default();
        fusion.write(&mut action);
        assert_eq!(action.blind, 2);
    }
}

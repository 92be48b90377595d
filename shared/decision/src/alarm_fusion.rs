//! The fused alarm and the detector's sight. The supervisor alone sees both stages, so it joins
//! them before it decides.

use vigil_blocks::{
    Action, Carryover, CauseKind, DetectionBelief, Entry, FaultBelief, MODE_BLIND, Readiness,
    RecoveryKind,
};
use vigil_checkpoint::Checkpoint;
use vigil_robot::DetectorAlarm;
use vigil_robot::fused_alarm::{FusedAlarm, StageBeliefs};

use crate::hearing::Hearing;
use crate::inputs::Inputs;

/// A set of faults is reported from this probability on: more likely than not, as every name.
const REPORTED: f64 = 0.5;

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
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Situation {
    /// The detector is blind: no belief counts.
    pub is_blind: bool,
    /// The fused alarm stands: before it, what has no name counts as nothing.
    pub alarm: bool,
    /// The detector's probability of a fault, also after its replacement.
    pub p_fault: f64,
    /// Whether the identifier is heard beside it.
    pub hearing: Hearing,
    /// The robot rests: nothing that it does would show a fault.
    pub rests: bool,
    /// The diagnosis of this entry cannot be used.
    pub is_refused: bool,
}

impl Situation {
    /// True while nothing is to be latched: what is wrong is not known well enough. `is_silent`
    /// says that no diagnosis has come for some cycles.
    pub(crate) const fn forbids_latching(&self, is_silent: bool) -> bool {
        let hearing = &self.hearing;
        !hearing.may_latch() || is_silent && hearing.is_heard() && self.alarm
    }
}

/// Follows detections and diagnoses.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct AlarmFusion {
    alarm: FusedAlarm,
    detected: DetectorAlarm,
    /// As in the last detection.
    blind: u32,
    readiness: u32,
    run_id: u64,
    p_nominal: f64,
    is_refused: bool,
    faults: u32,
    hearing: Hearing,
    arming_speed_scale: f64,
}

impl AlarmFusion {
    /// While the detector arms, the robot goes on at this share of its speed.
    pub(crate) fn new(arming_speed_scale: f64) -> Self {
        Self {
            alarm: FusedAlarm::default(),
            detected: DetectorAlarm::default(),
            blind: 0,
            readiness: Readiness::Arming as u32,
            run_id: 0,
            p_nominal: 1.0,
            is_refused: false,
            faults: 0,
            hearing: Hearing::default(),
            arming_speed_scale,
        }
    }

    /// Takes an entry, and returns what of it concerns the belief. A diagnosis that is not sound is
    /// none. A detection that only predicts says whether the detector is blind, and nothing else.
    pub(crate) fn take<'a>(
        &mut self,
        entry: Entry<Inputs<'a>>,
        is_sound: impl Fn(&FaultBelief) -> bool,
    ) -> Entry<Inputs<'a>> {
        let Entry::Frame(inputs) = entry else {
            if matches!(entry, Entry::Reset) {
                self.alarm.reset();
                self.detected = DetectorAlarm::default();
                self.readiness = Readiness::Arming as u32;
                (self.p_nominal, self.faults) = (1.0, 0);
                self.hearing.reset();
            }
            return entry;
        };
        let predicts = |d: &DetectionBelief| d.cause.kind() == Some(CauseKind::Missed);
        self.blind = inputs.detection.map_or(self.blind, |d| d.blind);
        let detection = inputs.detection.filter(|d| !predicts(d));
        let sound = inputs.diagnosis.filter(|it| is_sound(it));
        self.is_refused = inputs.diagnosis.is_some() && sound.is_none();
        if let Some(diagnosis) = sound {
            self.take_diagnosis(diagnosis);
        }
        if let Some(detection) = detection {
            self.fuse(detection, sound.is_some());
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
        self.hearing.take_diagnosis(diagnosis);
        let p = diagnosis.p[0];
        self.p_nominal = if p.is_finite() { p } else { 0.0 };
        let set = &diagnosis.sets[0];
        let is_named = diagnosis.set_count > 0 && set.p >= REPORTED;
        self.faults = match is_named && diagnosis.mode != MODE_BLIND {
            true => set.leaves.count_ones(),
            false => 0,
        };
    }

    fn fuse(&mut self, detection: &DetectionBelief, is_answered: bool) {
        if detection.run_id != self.run_id {
            self.alarm.reset();
            self.run_id = detection.run_id;
            self.hearing.begin_run();
        }
        self.readiness = detection.readiness;
        self.detected.take(detection);
        let passed_s = self.detected.passed_s();
        let stands = self.detected.stands();
        self.hearing.take_detection(stands, is_answered, passed_s);
        self.alarm.take(&StageBeliefs {
            t_ns: detection.header.t_capture_ns,
            moved_s: if self.rests() { 0.0 } else { passed_s },
            alarm: stands,
            alarm_t_ns: self.detected.t_ns(),
            // Nobody contradicts what was left before the first diagnosis.
            p_nominal: match self.hearing.is_heard() || self.hearing.is_new() {
                true => self.p_nominal,
                false => 0.0,
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
            hearing: self.hearing,
            rests: self.rests(),
            is_refused: self.is_refused,
        }
    }

    /// A detector that arms does not say whether the robot moves: while an alarm is held against
    /// it, nothing counts as shown.
    const fn rests(&self) -> bool {
        let arms = self.readiness == Readiness::Arming as u32;
        self.readiness == Readiness::NotExcited as u32 || arms && self.detected.is_held()
    }

    /// Goes on with the alarm that an earlier supervisor has left.
    pub(crate) fn restore(&mut self, left: &Carryover) {
        self.run_id = left.run_id;
        self.detected = DetectorAlarm::restored(left);
        self.alarm = FusedAlarm::restored(left);
        self.hearing = Hearing::beside(self.detected.stands());
    }

    /// The alarm, for the next supervisor.
    pub(crate) fn carryover(&self) -> Carryover {
        Carryover {
            detected_t_capture_ns: self.detected.t_ns(),
            p_fault: self.detected.p_fault(),
            alarm_t_capture_ns: self.alarm.t_ns(),
            alarm_count: self.alarm.count(),
            ..Carryover::default()
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
mod tests;

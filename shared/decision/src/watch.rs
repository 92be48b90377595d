//! What the supervisor, which alone hears both stages, makes of them before it decides: whether
//! anything is seen at all, and whether an alarm stands.

use vigil_blocks::{
    Action, CauseKind, DetectionBelief, Entry, FaultBelief, MODE_BLIND, Readiness, RecoveryKind,
};
use vigil_robot::fused_alarm::{FusedAlarm, StageOdds};

use crate::supervisor::Inputs;

/// Detections in a row without a diagnosis after which the identifier counts as lost: as a
/// service's input does.
const LOST_AFTER: u32 = 3;
/// A set of faults is reported from this probability on: more likely than not, as every name.
const REPORTED: f64 = 0.5;
/// Frames further apart than this, s, do not show what was between them: ten observations.
const STEP_MAX_S: f64 = 0.5;

/// What decisions depend on besides beliefs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Situation {
    /// Nothing is seen: no belief counts.
    pub is_blind: bool,
    /// The fused alarm stands: before it, what has no name counts as nothing.
    pub alarm: bool,
}

/// Follows detections and diagnoses.
#[derive(Debug, Clone)]
pub(crate) struct Watch {
    alarm: FusedAlarm,
    /// As the detector says them.
    blind: u32,
    readiness: u32,
    run_id: u64,
    t_ns: u64,
    p_nominal: f64,
    faults: u32,
    /// Detections since the last diagnosis.
    unanswered: u32,
    arming_speed_scale: f64,
}

impl Watch {
    /// While the detector arms, the robot goes on at this share of its speed.
    pub(crate) fn new(arming_speed_scale: f64) -> Self {
        Self {
            alarm: FusedAlarm::default(),
            blind: 0,
            readiness: Readiness::Arming as u32,
            run_id: 0,
            t_ns: 0,
            p_nominal: 1.0,
            faults: 0,
            unanswered: 0,
            arming_speed_scale,
        }
    }

    /// Takes an entry; what is left of it for a belief. Of a detection that only predicts, the
    /// detector's sight alone is news.
    pub(crate) fn take<'a>(&mut self, entry: Entry<Inputs<'a>>) -> Entry<Inputs<'a>> {
        let Entry::Frame(inputs) = entry else {
            if matches!(entry, Entry::Reset) {
                self.alarm.reset();
                self.readiness = Readiness::Arming as u32;
                (self.p_nominal, self.faults, self.unanswered) = (1.0, 0, 0);
            }
            return entry;
        };
        let predicts = |d: &DetectionBelief| d.cause.kind() == Some(CauseKind::Missed);
        self.blind = inputs.detection.map_or(self.blind, |d| d.blind);
        let detection = inputs.detection.filter(|d| !predicts(d));
        if let Some(diagnosis) = inputs.diagnosis {
            self.hear(diagnosis);
        }
        if let Some(detection) = detection {
            self.fuse(detection, inputs.diagnosis.is_some());
        }
        match (inputs.diagnosis, detection) {
            (None, None) => Entry::Missed(0),
            (diagnosis, detection) => Entry::Frame(Inputs {
                diagnosis,
                detection,
            }),
        }
    }

    fn hear(&mut self, diagnosis: &FaultBelief) {
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
        }
        self.unanswered = match is_answered {
            true => 0,
            false => self.unanswered.saturating_add(1),
        };
        let is_lost = self.unanswered >= LOST_AFTER;
        let t_ns = detection.header.t_capture_ns;
        let passed_s = t_ns.saturating_sub(self.t_ns) as f64 * 1e-9;
        (self.t_ns, self.readiness) = (t_ns, detection.readiness);
        let rests = self.readiness == Readiness::NotExcited as u32;
        self.alarm.take(&StageOdds {
            t_ns,
            moved_s: if rests { 0.0 } else { passed_s.min(STEP_MAX_S) },
            alarm: detection.alarm != 0,
            alarm_t_ns: detection.alarm_t_capture_ns,
            alarm_count: detection.alarm_count,
            p_nominal: if is_lost { 0.0 } else { self.p_nominal },
            faults: self.faults,
        });
    }

    /// What decisions depend on.
    pub(crate) const fn seen(&self) -> Situation {
        Situation {
            is_blind: self.blind != 0,
            alarm: self.alarm.stands(),
        }
    }

    /// Writes alarm and sight into the decision; while the detector arms, the robot goes on slowly.
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

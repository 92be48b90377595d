//! The fused alarm and the detector's sight. The supervisor alone sees both stages, so it joins
//! them before it decides.

use vigil_blocks::{
    Action, Carryover, CauseKind, DetectionBelief, Entry, FaultBelief, MODE_BLIND, Readiness,
    RecoveryKind,
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
/// For how long nobody is called once no identifier knows of an alarm, s. Chosen: longer than one
/// that is replaced takes to begin and to see how a robot in motion fails.
const RETURN_S: f64 = 5.0;

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
    /// An alarm does not stand, or the identifier knows of it. One that was replaced has to see
    /// something first: until then what was believed before stands.
    pub is_heard: bool,
    /// It is not, and has not been for some cycles: what is late now and then is not lost.
    pub is_lost: bool,
    /// Another one is waited for: before its first result what was believed stands.
    pub waits: bool,
    /// It has been heard for a while, or was not for so long that it is not waited for: help may be
    /// called.
    pub may_latch: bool,
    /// The robot rests: nothing that it does would show a fault.
    pub rests: bool,
    /// The diagnosis of this entry cannot be used.
    pub is_refused: bool,
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
    t_ns: u64,
    p_nominal: f64,
    /// The identifier knows of an alarm.
    is_identifying: bool,
    is_refused: bool,
    /// The identifier's epoch, and that of the one that was heard before the wait.
    epoch: u64,
    heard_epoch: u64,
    faults: u32,
    /// Detections since the last diagnosis.
    unanswered: u32,
    /// Detections beside an alarm in a row without an identifier that knows of it.
    unheard: u32,
    /// Time since an identifier is waited for, s; 0 while none is.
    waited_s: f64,
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
            t_ns: 0,
            p_nominal: 1.0,
            is_identifying: false,
            is_refused: false,
            epoch: 0,
            heard_epoch: 0,
            faults: 0,
            unanswered: 0,
            unheard: 0,
            waited_s: 0.0,
            arming_speed_scale,
        }
    }

    /// Takes an entry, and returns what of it concerns the belief. A diagnosis that is not sound is
    /// none. A detection that only predicts
    /// says whether the detector is blind, and nothing else.
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
                (self.p_nominal, self.faults, self.unanswered) = (1.0, 0, 0);
                (self.is_identifying, self.unheard, self.waited_s) = (false, 0, 0.0);
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
            let is_unanswered = u32::from(sound.is_none());
            self.unanswered = self.unanswered.saturating_add(is_unanswered);
            self.fuse(detection);
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
        self.unanswered = 0;
        self.epoch = diagnosis.header.epoch;
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

    fn fuse(&mut self, detection: &DetectionBelief) {
        if detection.run_id != self.run_id {
            self.alarm.reset();
            self.run_id = detection.run_id;
            (self.unheard, self.waited_s) = (0, 0.0);
        }
        let t_ns = detection.header.t_capture_ns;
        let passed_s = (t_ns.saturating_sub(self.t_ns) as f64 * 1e-9).min(STEP_MAX_S);
        (self.t_ns, self.readiness) = (t_ns, detection.readiness);
        self.detected.take(detection);
        let is_heard = self.is_heard();
        self.wait(is_heard, passed_s);
        self.alarm.take(&StageBeliefs {
            t_ns,
            moved_s: if self.rests() { 0.0 } else { passed_s },
            alarm: self.detected.stands(),
            alarm_t_ns: self.detected.t_ns(),
            p_nominal: if is_heard { self.p_nominal } else { 0.0 },
            faults: self.faults,
        });
    }

    /// What decisions depend on.
    pub(crate) fn situation(&self) -> Situation {
        Situation {
            is_blind: self.blind != 0,
            alarm: self.alarm.stands(),
            p_fault: self.detected.p_fault(),
            is_heard: self.is_heard(),
            is_lost: !self.is_heard() && (self.unheard >= LOST_AFTER || self.waited_s > 0.0),
            waits: self.waited_s > 0.0 && self.waited_s < RETURN_S,
            may_latch: match self.waited_s > 0.0 {
                true => self.waited_s >= RETURN_S,
                false => self.is_heard(),
            },
            rests: self.rests(),
            is_refused: self.is_refused,
        }
    }

    /// Another one that is heard in its place has not seen all yet: the wait goes on.
    fn wait(&mut self, is_heard: bool, passed_s: f64) {
        self.unheard = match is_heard {
            true => 0,
            false => self.unheard.saturating_add(1),
        };
        let is_another = self.epoch != self.heard_epoch;
        let waits = self.waited_s > 0.0 && self.waited_s < RETURN_S;
        let goes_on = self.detected.stands() && waits && (is_another || !is_heard);
        self.waited_s = match goes_on || self.unheard >= LOST_AFTER {
            true => self.waited_s + passed_s,
            false => 0.0,
        };
        if is_heard && self.waited_s == 0.0 {
            self.heard_epoch = self.epoch;
        }
    }

    const fn is_heard(&self) -> bool {
        let knows = self.is_identifying && self.unanswered < LOST_AFTER;
        knows || !self.detected.stands()
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

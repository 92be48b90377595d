//! Whether the identifier is heard beside an alarm, or another one is waited for.

use vigil_blocks::FaultBelief;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::detector_alarm::are_named;

/// Detections in a row without a diagnosis after which the identifier counts as lost, as every
/// input of a service does (`vigil_cycle`).
const LOST_AFTER: u32 = 3;
/// For how long nobody is called beside an alarm once an identifier is lost or a supervisor begins,
/// s. Chosen: longer than an identifier that is replaced takes to begin and to see how a robot in
/// motion fails.
const RETURN_S: f64 = 5.0;

/// Follows whether the identifier knows of an alarm that stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, CheckpointValue)]
pub(crate) struct Hearing {
    /// The detector's alarm stands.
    alarm: bool,
    /// The last diagnosis knows of an alarm.
    knows: bool,
    /// Of the last diagnosis, and of the identifier that was heard before the wait.
    epoch: u64,
    heard_epoch: u64,
    /// Detections since the last diagnosis.
    unanswered: u32,
    /// Detections beside an alarm in a row without an identifier that knows of it.
    unheard: u32,
    /// Identifier that knew of an alarm last, and the one whose loss began the wait.
    known_epoch: u64,
    lost_epoch: u64,
    /// Time since that loss, or since the supervisor began, s, while another one is waited for.
    waited_s: Option<f64>,
    /// It is waited for since one was lost.
    was_lost: bool,
}

impl Hearing {
    /// Beside this alarm of the detector, before any diagnosis. Who was heard before is not known:
    /// whoever is heard now may have begun just before.
    pub(crate) fn beside(alarm: bool) -> Self {
        Self {
            alarm,
            waited_s: alarm.then_some(0.0),
            ..Self::default()
        }
    }

    /// Takes a sound diagnosis. Another identifier than the one that is waited for has not seen how
    /// the alarm began: it may find a fault with a name, but nothing inexplicable, and no health.
    pub(crate) fn take_diagnosis(&mut self, diagnosis: &FaultBelief) {
        let is_another = diagnosis.header.epoch != self.epoch;
        if self.alarm && self.is_heard() && is_another {
            self.begin_wait();
        }
        self.unanswered = 0;
        self.epoch = diagnosis.header.epoch;
        let are_named = are_named(diagnosis.p[0], diagnosis.p_unknown);
        let may_tell = are_named || !self.waits() || self.epoch == self.heard_epoch;
        self.knows = diagnosis.identifying != 0 && may_tell;
        if self.knows {
            self.known_epoch = self.epoch;
        }
    }

    /// The identifier that knew of the alarm is lost. Each is waited for once, until one is heard
    /// for good: one that is heard now and then does not put off a call for ever.
    const fn begin_wait(&mut self) {
        if self.known_epoch != self.lost_epoch {
            self.lost_epoch = self.known_epoch;
            self.waited_s = Some(0.0);
        }
    }

    /// Takes a detection `passed_s` after the one before, beside the detector's alarm or none.
    pub(crate) fn take_detection(&mut self, alarm: bool, is_answered: bool, passed_s: f64) {
        self.alarm = alarm;
        let is_unanswered = u32::from(!is_answered);
        self.unanswered = self.unanswered.saturating_add(is_unanswered);
        let is_heard = self.is_heard();
        self.unheard = match is_heard {
            true => 0,
            false => self.unheard.saturating_add(1),
        };
        // Another one that is heard in its place has not seen all yet.
        let is_another = self.epoch != self.heard_epoch;
        let goes_on = alarm && self.waits() && (is_another || !is_heard);
        if self.unheard == LOST_AFTER {
            self.begin_wait();
        }
        self.waited_s = match goes_on || self.unheard >= LOST_AFTER {
            true => Some(self.waited_s.unwrap_or(0.0) + passed_s),
            false => None,
        };
        self.was_lost |= self.unheard >= LOST_AFTER;
        self.was_lost &= self.waited_s.is_some();
        if is_heard && self.waited_s.is_none() {
            (self.heard_epoch, self.lost_epoch) = (self.epoch, 0);
        }
    }

    /// Nothing is known but who was heard.
    pub(crate) fn reset(&mut self) {
        *self = Self {
            epoch: self.epoch,
            heard_epoch: self.heard_epoch,
            ..Self::default()
        };
    }

    /// Another run begins: nobody is waited for.
    pub(crate) const fn begin_run(&mut self) {
        (self.unheard, self.waited_s, self.was_lost) = (0, None, false);
    }

    /// An alarm does not stand, or the identifier knows of it. One that was replaced has to see
    /// something first: until then what was believed before stands.
    pub(crate) const fn is_heard(&self) -> bool {
        let knows = self.knows && self.unanswered < LOST_AFTER;
        knows || !self.alarm
    }

    /// An earlier supervisor was replaced just now: no diagnosis has come since, and none is lost.
    pub(crate) const fn is_new(&self) -> bool {
        self.waited_s.is_some() && self.epoch == 0 && !self.was_lost
    }

    /// It is not heard, but for a few cycles only.
    pub(crate) const fn is_late(&self) -> bool {
        !self.is_heard() && !self.is_lost()
    }

    /// It is not heard, and has not been for some cycles, or was lost before.
    pub(crate) const fn is_lost(&self) -> bool {
        !self.is_heard() && self.was_lost
    }

    /// Another one is waited for: before its first result what was believed stands.
    pub(crate) const fn waits(&self) -> bool {
        matches!(self.waited_s, Some(waited_s) if waited_s < RETURN_S)
    }

    /// It has been heard for a while, or was not for so long that it is not waited for: help may be
    /// called.
    pub(crate) const fn may_latch(&self) -> bool {
        !self.waits() && (self.waited_s.is_some() || self.is_heard())
    }
}

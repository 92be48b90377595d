//! Decision epochs: when one ends, and what was seen in it.
//!
//! Monitors speak every cycle, and a firing that is fed to the tracker at every cycle would count
//! many times. An epoch gathers a set: symptoms that rose in it, and those that still stand at its
//! end. A symptom that stood before and has gone says nothing about the state that the action led
//! to. An epoch ends when the robot reports the outcome of the action, when a symptom rises that
//! did not stand, or after a time. An error in position that goes on while the robot stops or
//! moves off (EPS, EPM) is the same error, and counts as what it was last.

use vigil_blocks::{ActionOutcome, DetectionBelief, Symptoms};

/// Symptoms of monitors.
const MONITORS: u32 = Symptoms::EPS | Symptoms::EPM | Symptoms::LD | Symptoms::SD;
/// The two forms of an error in position.
const POSITION: u32 = Symptoms::EPS | Symptoms::EPM;
/// Outcomes.
const OUTCOMES: u32 = Symptoms::BO | Symptoms::ALT | Symptoms::NNA;

/// What an epoch has gathered.
#[derive(Debug, Clone, Default)]
pub(crate) struct Epoch {
    began_ns: Option<u64>,
    standing: u32,
    risen: u32,
    outcomes: u32,
    is_answered: bool,
}

impl Epoch {
    /// Takes what the detector says, and whether the epoch ends: `decision_seq` is the decision
    /// whose outcome is waited for, `limit_ns` the longest epoch.
    pub(crate) fn take(
        &mut self,
        detection: &DetectionBelief,
        decision_seq: u64,
        limit_ns: u64,
    ) -> bool {
        let symptoms = detection.symptoms & MONITORS;
        let position = |set: u32| {
            if set & POSITION == 0 {
                set
            } else {
                set | POSITION
            }
        };
        let new = symptoms & !position(self.standing);
        self.risen |= new;
        if symptoms & POSITION != 0 && self.risen & POSITION != 0 {
            self.risen = self.risen & !POSITION | symptoms & POSITION;
        }
        self.standing = symptoms;
        let ended = [ActionOutcome::Succeeded, ActionOutcome::Failed].map(|o| o as u32);
        let answers = detection.action_seq == decision_seq
            && ended.contains(&detection.action_outcome)
            && !self.is_answered;
        if answers {
            self.is_answered = true;
            self.outcomes = detection.symptoms & OUTCOMES;
        }
        let t_ns = detection.header.t_capture_ns;
        let began_ns = *self.began_ns.get_or_insert(t_ns);
        // A jump back of the time begins a new epoch.
        let is_over = t_ns.checked_sub(began_ns).is_none_or(|ns| ns >= limit_ns);
        new != 0 || answers || is_over
    }

    /// The set of an epoch that ends now; the next begins.
    pub(crate) fn take_set(&mut self, t_ns: u64) -> u32 {
        let mut set = self.risen | self.standing | self.outcomes;
        if self.standing & POSITION != 0 {
            set = set & !POSITION | self.standing & POSITION;
        }
        (self.risen, self.outcomes) = (0, 0);
        self.began_ns = Some(t_ns);
        set
    }

    /// Another decision is waited for.
    pub(crate) const fn ask(&mut self) {
        self.is_answered = false;
    }

    /// Nothing has been seen.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn said(t_s: u64, symptoms: u32, outcome: (u64, ActionOutcome)) -> DetectionBelief {
        let mut detection = DetectionBelief {
            symptoms,
            action_seq: outcome.0,
            action_outcome: outcome.1 as u32,
            ..DetectionBelief::default()
        };
        detection.header.t_capture_ns = t_s * S;
        detection
    }

    #[test]
    fn a_symptom_ends_the_epoch_when_it_rises_and_counts_once_in_each() {
        let mut epoch = Epoch::default();
        let running = (1, ActionOutcome::Running);
        let mut take = |t_s, symptoms| {
            let over = epoch.take(&said(t_s, symptoms, running), 1, 10 * S);
            over.then(|| epoch.take_set(t_s * S))
        };
        assert_eq!(take(0, 0), None);
        assert_eq!(take(1, Symptoms::EPM), Some(Symptoms::EPM));
        // It stands: not new, but there at the end, in the form it then has.
        assert_eq!(take(2, Symptoms::EPM), None);
        assert_eq!(take(10, Symptoms::EPS), None);
        assert_eq!(take(11, Symptoms::EPS), Some(Symptoms::EPS));
        // It goes: what stood before and is gone says nothing about the epoch.
        assert_eq!(take(12, 0), None);
        assert_eq!(take(21, 0), Some(0));
        // Rises and goes at once.
        let both = Symptoms::EPM | Symptoms::LD;
        assert_eq!(take(22, both), Some(both));
        assert_eq!(take(23, 0), None);
        assert_eq!(take(32, 0), Some(0));
    }

    #[test]
    fn an_outcome_counts_once_and_only_that_of_the_decision() {
        let mut epoch = Epoch::default();
        let done = |seq| (seq, ActionOutcome::Succeeded);
        assert!(!epoch.take(&said(0, Symptoms::BO, done(6)), 7, 10 * S));
        assert!(epoch.take(&said(1, Symptoms::BO, done(7)), 7, 10 * S));
        assert_eq!(epoch.take_set(S), Symptoms::BO);
        assert!(!epoch.take(&said(2, Symptoms::BO, done(7)), 7, 10 * S));
        epoch.ask();
        assert!(epoch.take(&said(3, 0, (8, ActionOutcome::Failed)), 8, 10 * S));
        assert_eq!(epoch.take_set(3 * S), 0);
    }
}

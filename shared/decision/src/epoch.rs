//! Decision epochs: when one ends, and what was seen in it.
//!
//! Monitors speak every cycle, and a firing that is fed to the tracker at every cycle would count
//! many times. An epoch gathers a set: symptoms that rose in it, and an error in position that
//! still stands at its end: it is looked at in every cycle. A loop or a spin that stands says
//! nothing new: a robot that stands neither loops nor spins. A symptom that stood before and has
//! gone says nothing about the state that the action led to. An error in position that goes on
//! while the robot stops or moves off (EPS, EPM) is the same error, and counts as what it was last.
//!
//! An epoch ends when the robot reports the outcome of the action, when a symptom rises that did
//! not stand, or after a time. An action that the robot says is running is not ended by the usual
//! time, but by the longest that any action may last; a call for help, or a task given up, by none.

use std::collections::BTreeMap;

use vigil_blocks::{ActionOutcome, DetectionBelief, Symptoms};
use vigil_checkpoint::Checkpoint;

use crate::settings::{Counts, OwnSymptom};

/// The two forms of an error in position.
const POSITION: u32 = Symptoms::EPS | Symptoms::EPM;

/// Which symptoms count when, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SymptomKinds {
    /// Those that end an epoch when they rise.
    rising: u32,
    /// Those of them that count while they stand, too.
    standing: u32,
    /// Those that come with an outcome.
    pub(crate) outcomes: u32,
}

impl SymptomKinds {
    /// The paper's, and `own`.
    pub(crate) fn new(own: &BTreeMap<String, OwnSymptom>) -> Self {
        let of = |counts| {
            let bits = own.values().filter(|own| own.counts == counts);
            bits.fold(0, |set, own| set | own.set())
        };
        let standing = POSITION | of(Counts::Standing);
        Self {
            rising: standing | Symptoms::LD | Symptoms::SD | of(Counts::Rising),
            standing,
            outcomes: Symptoms::BO | Symptoms::ALT | Symptoms::NNA | of(Counts::Outcome),
        }
    }
}

/// How an epoch ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// The action is done; or nothing is said about it, and its time is over.
    Done,
    /// The robot says that it could not, or has been at it for longer than any action may last.
    Failed,
    /// The action goes on: a symptom has risen.
    Unfinished,
}

/// The longest epochs, ns; `None`: no time ends it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Of an action of which the robot says nothing, or that has no end.
    pub epoch_ns: Option<u64>,
    /// Of an action that runs; `None` also if the action has no end of its own.
    pub running_ns: Option<u64>,
    /// True if the action has an end of its own.
    pub has_end: bool,
}

/// What an epoch has gathered.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct Epoch {
    #[checkpoint(fixed)]
    kinds: SymptomKinds,
    began_ns: Option<u64>,
    standing: u32,
    risen: u32,
    outcomes: u32,
    is_answered: bool,
}

impl Epoch {
    /// Nothing has been seen yet.
    pub(crate) const fn new(kinds: SymptomKinds) -> Self {
        Self {
            kinds,
            began_ns: None,
            standing: 0,
            risen: 0,
            outcomes: 0,
            is_answered: false,
        }
    }

    /// Takes what the detector says, and how the epoch ends if it does: `decision_seq` is the
    /// decision whose outcome is waited for.
    pub(crate) fn take(
        &mut self,
        detection: &DetectionBelief,
        decision_seq: u64,
        limits: &Limits,
    ) -> Option<End> {
        let is_new = self.take_symptoms(detection.symptoms & self.kinds.rising);
        let outcome = |outcome: ActionOutcome| {
            detection.action_seq == decision_seq && detection.action_outcome == outcome as u32
        };
        let (done, failed) = (
            outcome(ActionOutcome::Succeeded),
            outcome(ActionOutcome::Failed),
        );
        if (done || failed) && !self.is_answered {
            self.is_answered = true;
            self.outcomes = detection.symptoms & self.kinds.outcomes;
            return Some(if done { End::Done } else { End::Failed });
        }
        let t_ns = detection.header.t_capture_ns;
        let began_ns = *self.began_ns.get_or_insert(t_ns);
        let runs = limits.has_end && outcome(ActionOutcome::Running);
        let limit_ns = if runs {
            limits.running_ns
        } else {
            limits.epoch_ns
        };
        // A jump back of the time begins a new epoch.
        let passed_ns = t_ns.checked_sub(began_ns).unwrap_or(u64::MAX);
        if limit_ns.is_some_and(|limit_ns| passed_ns >= limit_ns) {
            return Some(if runs { End::Failed } else { End::Done });
        }
        is_new.then_some(if limits.has_end {
            End::Unfinished
        } else {
            End::Done
        })
    }

    /// True if a symptom rises.
    fn take_symptoms(&mut self, symptoms: u32) -> bool {
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
        new != 0
    }

    /// The set of an epoch that ends now; the next begins. The time of an action that goes on does
    /// not begin anew.
    pub(crate) fn take_set(&mut self, t_ns: u64, end: End) -> u32 {
        let mut set = self.risen | self.outcomes;
        if self.standing & POSITION != 0 {
            set &= !POSITION;
        }
        set |= self.standing & self.kinds.standing;
        (self.risen, self.outcomes) = (0, 0);
        if end != End::Unfinished {
            self.began_ns = Some(t_ns);
        }
        set
    }

    /// Another decision begins, whose outcome is waited for.
    pub(crate) const fn begin(&mut self) {
        self.is_answered = false;
        self.began_ns = None;
    }

    /// Nothing has been seen.
    pub(crate) fn reset(&mut self) {
        *self = Self::new(self.kinds);
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

    fn epoch() -> Epoch {
        Epoch::new(SymptomKinds::new(&BTreeMap::new()))
    }

    const FOLLOWS: Limits = Limits {
        epoch_ns: Some(10 * S),
        running_ns: Some(30 * S),
        has_end: false,
    };
    const ENDS: Limits = Limits {
        has_end: true,
        ..FOLLOWS
    };
    const RUNNING: (u64, ActionOutcome) = (1, ActionOutcome::Running);

    #[test]
    fn a_symptom_ends_the_epoch_when_it_rises_and_counts_once_in_each() {
        let mut epoch = epoch();
        let mut take = |t_s, symptoms| {
            let end = epoch.take(&said(t_s, symptoms, RUNNING), 1, &FOLLOWS);
            end.map(|end| epoch.take_set(t_s * S, end))
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
        // A loop and a spin are news when they rise; then they only have not gone.
        let all = Symptoms::EPS | Symptoms::LD | Symptoms::SD;
        assert_eq!(take(33, all), Some(all));
        assert_eq!(take(43, all), Some(Symptoms::EPS));
    }

    #[test]
    fn a_symptom_of_the_users_own_counts_as_it_is_declared() {
        let own = [
            ("BUMP", 8, Counts::Rising),
            ("BATTERY", 9, Counts::Standing),
            ("DOCKED", 10, Counts::Outcome),
        ];
        let own = own.map(|(name, bit, counts)| (name.to_owned(), OwnSymptom { bit, counts }));
        let [bump, battery, docked] = [1 << 8, 1 << 9, 1 << 10];
        let mut epoch = Epoch::new(SymptomKinds::new(&own.into()));
        let mut take = |t_s, symptoms, outcome| {
            let end = epoch.take(&said(t_s, symptoms, (1, outcome)), 1, &ENDS);
            end.map(|end| epoch.take_set(t_s * S, end))
        };
        let all = bump | battery | docked;
        assert_eq!(take(0, all, ActionOutcome::Running), Some(bump | battery));
        assert_eq!(take(1, all, ActionOutcome::Running), None);
        let done = take(2, all, ActionOutcome::Succeeded);
        assert_eq!(done, Some(battery | docked), "the bump is no news");
    }

    #[test]
    fn an_outcome_counts_once_and_only_that_of_the_decision() {
        let mut epoch = epoch();
        let mut take = |t_s, symptoms, seq, outcome, decision| {
            epoch.take(&said(t_s, symptoms, (seq, outcome)), decision, &ENDS)
        };
        use ActionOutcome::{Failed, Succeeded};
        assert_eq!(take(0, Symptoms::BO, 6, Succeeded, 7), None);
        assert_eq!(take(1, Symptoms::BO, 7, Succeeded, 7), Some(End::Done));
        assert_eq!(epoch.take_set(S, End::Done), Symptoms::BO);
        let again = said(2, Symptoms::BO, (7, Succeeded));
        assert_eq!(epoch.take(&again, 7, &ENDS), None);
        epoch.begin();
        let failed = said(3, 0, (8, Failed));
        assert_eq!(epoch.take(&failed, 8, &ENDS), Some(End::Failed));
        assert_eq!(epoch.take_set(3 * S, End::Failed), 0);
    }

    #[test]
    fn what_runs_is_ended_by_the_longest_time_alone_and_what_is_held_by_none() {
        let mut epoch = epoch();
        let mut take = |t_s, symptoms, limits: &Limits| {
            let end = epoch.take(&said(t_s, symptoms, RUNNING), 1, limits);
            end.inspect(|end| _ = epoch.take_set(t_s * S, *end))
        };
        assert_eq!(take(0, 0, &ENDS), None);
        assert_eq!(take(12, 0, &ENDS), None);
        // A symptom meanwhile is worth a thought, but gives it no more time.
        assert_eq!(take(20, Symptoms::LD, &ENDS), Some(End::Unfinished));
        assert_eq!(take(29, Symptoms::LD, &ENDS), None);
        assert_eq!(take(30, Symptoms::LD, &ENDS), Some(End::Failed));
        let held = Limits {
            epoch_ns: None,
            running_ns: None,
            has_end: true,
        };
        assert_eq!(take(1_000_000, Symptoms::LD, &held), None);
    }

    #[test]
    fn an_action_of_which_the_robot_says_nothing_is_done_after_an_epoch() {
        let mut epoch = epoch();
        let mut take = |t_s| {
            let silent = said(t_s, 0, (0, ActionOutcome::None));
            epoch.take(&silent, 1, &ENDS)
        };
        assert_eq!([take(0), take(9), take(10)], [None, None, Some(End::Done)]);
    }
}

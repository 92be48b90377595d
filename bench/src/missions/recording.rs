//! Evidence of each epoch in a mission, with what was true, as steps of the decision model.
//!
//! The decision model's observation of an epoch is what its evidence speaks for most: the condition
//! whose probability rose most, if the belief moved at all. Whether more evidence comes nobody
//! sees: what is true is always given as the new state of its condition, and `vigil pomdp fit`
//! infers the rest.
//!
//! A step has no true state in which no alarm stands, or rises: before it the model has not begun.
//! Nor has one of a robot that stands, or with a fault that is still small.

use std::error::Error;

use vigil_blocks::{Action, RecoveryKind};
use vigil_decision::MOVED;
use vigil_decision::state_names::{NEW, SEVERAL, SEVERAL_DRIVABLE, UNKNOWN};
use vigil_missions::learning::Record;
use vigil_pomdp::Pomdp;

use super::breakdown::{Cause, PresentFault};
use super::rules::RuleOutput;

/// What is less than this share of what it grows to is not yet a fault of the model.
const SEVERE: f64 = 0.5;
/// Observation of an epoch in which nothing is told.
const NONE: &str = "none";

/// The beginning of an epoch.
struct EpochBegin {
    t_ns: u64,
    action: u32,
    belief: Vec<f64>,
    /// An alarm stands, and the robot moves.
    is_known: bool,
}

/// Follows the supervisor's action blocks from an alarm to a call for help.
pub(super) struct EvidenceRecorder<'a> {
    model: &'a Pomdp,
    epoch_ns: u64,
    /// For each state, the settled one of the same condition.
    settled: Vec<usize>,
    none: u32,
    began: Option<EpochBegin>,
    record: Record,
    records: Vec<Record>,
}

impl<'a> EvidenceRecorder<'a> {
    /// Of a model whose steps last `epoch_s`.
    ///
    /// # Errors
    /// A model that does not say which states are new.
    pub(super) fn new(model: &'a Pomdp, epoch_s: f64) -> Result<Self, Box<dyn Error>> {
        let names = model.states();
        let settled = names.iter().enumerate().map(|(state, name)| {
            let of = name.strip_suffix(NEW);
            of.and_then(|of| names.iter().position(|it| it == of))
                .unwrap_or(state)
        });
        let observed = |name: &str| model.observations().iter().position(|of| of == name);
        let none = observed(NONE).filter(|_| names.iter().any(|name| name.ends_with(NEW)));
        let none = none.ok_or(
            "a decision model with states of which evidence comes (`_NEW`) and an observation \
             `none` is wanted: one of `model = \"recovery\"`",
        )?;
        Ok(Self {
            settled: settled.collect(),
            none: none as u32,
            model,
            epoch_ns: (epoch_s * 1e9).round() as u64,
            began: None,
            record: Record::default(),
            records: Vec::new(),
        })
    }

    /// Takes the time of a frame, what is wrong then, and the action block after it.
    pub(super) fn take(&mut self, t_ns: u64, faults: &[PresentFault], action: &Action) {
        let calls = action.kind == RecoveryKind::CallForHelp as u32;
        if self.began.is_none() && (calls || action.alarm == 0) {
            return;
        }
        let belief = self.folded(action);
        let stands = action.kind == RecoveryKind::Stop as u32;
        let is_known = action.alarm != 0 && !stands;
        match &self.began {
            None => {
                let state = self.state(faults);
                self.record.labels.push(state);
            }
            Some(began) if t_ns < began.t_ns + self.epoch_ns && !calls => return,
            Some(began) => {
                let is_known = began.is_known && action.alarm != 0;
                let said = said(&began.belief, &belief);
                let seen = said.and_then(|condition| self.observation(condition));
                let state = self.state(faults).filter(|_| is_known);
                // An epoch that a call cuts short was no silent one.
                if !calls || seen.is_some() {
                    self.record.actions.push(began.action);
                    self.record.observations.push(seen.unwrap_or(self.none));
                    self.record.labels.push(state);
                }
            }
        }
        if calls {
            return self.end();
        }
        self.began = Some(EpochBegin {
            t_ns,
            action: action.action,
            belief,
            is_known,
        });
    }

    /// What was recorded, one record from an alarm to a call or the end.
    pub(super) fn finish(mut self) -> Vec<Record> {
        self.end();
        self.records
    }

    /// Probabilities of conditions: what is new and what has settled are one.
    fn folded(&self, action: &Action) -> Vec<f64> {
        let mut out = vec![0.0; self.settled.len()];
        for (settled, b) in self.settled.iter().zip(&action.belief) {
            out[*settled] += b;
        }
        out
    }

    fn end(&mut self) {
        self.began = None;
        let record = std::mem::take(&mut self.record);
        if !record.actions.is_empty() {
            self.records.push(record);
        }
    }

    /// The model's observation of evidence for a condition.
    fn observation(&self, condition: usize) -> Option<u32> {
        let name = format!("{}{NEW}", self.model.states()[condition]);
        let seen = self.model.observations().iter().position(|of| *of == name);
        seen.map(|seen| seen as u32)
    }

    /// The model's new state of what is wrong.
    fn state(&self, faults: &[PresentFault]) -> Option<u32> {
        let name = format!("{}{NEW}", truth(faults)?);
        let state = self.model.states().iter().position(|of| *of == name);
        state.map(|state| state as u32)
    }
}

/// The condition whose probability has risen most, if the belief has moved.
fn said(before: &[f64], after: &[f64]) -> Option<usize> {
    let rises = before
        .iter()
        .zip(after)
        .map(|(before, after)| after - before);
    let moved: f64 = rises.clone().filter(|rise| *rise > 0.0).sum();
    let most = rises.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    most.filter(|_| moved > MOVED)
        .map(|(condition, _)| condition)
}

/// The model's name of what is wrong.
fn truth(faults: &[PresentFault]) -> Option<&'static str> {
    if faults.iter().any(|fault| fault.severity < SEVERE) {
        return None;
    }
    match faults {
        [] => Some("ND"),
        [one] => Some(match one.cause {
            Cause::Stuck(_) => "STUCK",
            Cause::Encoder(_) => "ENCODER",
            Cause::Unmodelled => UNKNOWN,
        }),
        several => {
            let causes = several.iter().map(|fault| fault.cause);
            Some(match RuleOutput::limp_home(causes) {
                Some(_) => SEVERAL_DRIVABLE,
                None => SEVERAL,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPOCH_S: f64 = 0.1;

    fn model() -> Pomdp {
        let file = crate::root().join("config/rover.pomdp");
        Pomdp::parse(&std::fs::read_to_string(file).unwrap()).unwrap()
    }

    const fn fault(cause: Cause) -> PresentFault {
        PresentFault {
            cause,
            severity: 1.0,
        }
    }

    /// A rover with a stuck wheel.
    struct Rover<'a> {
        recorder: EvidenceRecorder<'a>,
        model: &'a Pomdp,
        t_ns: u64,
    }

    impl<'a> Rover<'a> {
        fn new(model: &'a Pomdp) -> Self {
            Self {
                recorder: EvidenceRecorder::new(model, EPOCH_S).unwrap(),
                model,
                t_ns: 0,
            }
        }

        /// These are its probabilities for a time.
        fn believes(&mut self, parts: &[(&str, f64)], (alarm, kind): (bool, RecoveryKind), s: f64) {
            let mut action = Action {
                alarm: u32::from(alarm),
                kind: kind as u32,
                ..Action::default()
            };
            for (name, p) in parts {
                let state = self.model.states().iter().position(|of| of == name);
                action.belief[state.unwrap()] = *p;
            }
            for _ in 0..(s * 100.0).round() as u64 {
                let stuck = fault(Cause::Stuck(0));
                self.recorder.take(self.t_ns, &[stuck], &action);
                self.t_ns += 10_000_000;
            }
        }

        /// Observations and true states of the steps, one list a record.
        fn steps(self) -> Vec<Vec<(String, Option<String>)>> {
            let model = self.model;
            let steps = |record: Record| {
                record.check(model).unwrap();
                let seen = record.observations.iter();
                let seen = seen.map(|o| model.observations()[*o as usize].clone());
                let labels = record.labels[1..].iter();
                let labels = labels.map(|l| l.map(|s| model.states()[s as usize].clone()));
                seen.zip(labels).collect()
            };
            self.recorder.finish().into_iter().map(steps).collect()
        }
    }

    const GOES_ON: (bool, RecoveryKind) = (true, RecoveryKind::GoOn);

    fn step(seen: &str, state: &str) -> (String, Option<String>) {
        (seen.to_owned(), Some(state.to_owned()))
    }

    #[test]
    fn steps_go_from_an_alarm_to_a_call() {
        let model = model();
        let mut rover = Rover::new(&model);
        rover.believes(&[("ND", 1.0)], (false, RecoveryKind::GoOn), 1.0);
        rover.believes(&[("UNKNOWN_NEW", 0.8), ("STUCK_NEW", 0.2)], GOES_ON, 0.1);
        // Too little to be told anything; that something has settled is no evidence; then it is.
        rover.believes(&[("UNKNOWN", 0.78), ("STUCK", 0.22)], GOES_ON, 0.1);
        rover.believes(&[("UNKNOWN_NEW", 0.1), ("STUCK_NEW", 0.9)], GOES_ON, 0.13);
        // The evidence that leads to a call counts, though its epoch is not over.
        let call = (true, RecoveryKind::CallForHelp);
        rover.believes(&[("UNKNOWN_NEW", 0.9), ("STUCK_NEW", 0.1)], call, 1.0);
        rover.believes(&[("ND", 1.0)], (false, RecoveryKind::GoOn), 1.0);
        let steps = rover.steps();
        let seen = ["none", "STUCK_NEW", "none", "UNKNOWN_NEW"];
        assert_eq!(steps, [seen.map(|seen| step(seen, "STUCK_NEW"))]);
    }

    #[test]
    fn nothing_is_known_without_an_alarm_or_of_a_robot_that_stands() {
        let model = model();
        let mut rover = Rover::new(&model);
        let stands = (true, RecoveryKind::Stop);
        let quiet = (false, RecoveryKind::GoOn);
        for told in [
            GOES_ON, GOES_ON, quiet, GOES_ON, GOES_ON, stands, GOES_ON, GOES_ON,
        ] {
            rover.believes(&[("STUCK", 1.0)], told, 0.1);
        }
        let steps = rover.steps();
        let known: Vec<bool> = steps[0].iter().map(|(_, state)| state.is_some()).collect();
        assert_eq!(known, [true, false, false, true, true, false, true]);
    }

    #[test]
    fn a_model_without_new_states_is_refused() {
        let file = crate::root().join("config/navigation.pomdp");
        let model = Pomdp::parse(&std::fs::read_to_string(file).unwrap()).unwrap();
        assert!(EvidenceRecorder::new(&model, EPOCH_S).is_err());
    }

    #[test]
    fn what_is_wrong_has_the_models_name() {
        let [lf, lm, rf] = [0, 1, 3].map(|wheel| fault(Cause::Stuck(wheel)));
        let encoder = fault(Cause::Encoder(0));
        let unmodelled = fault(Cause::Unmodelled);
        assert_eq!(truth(&[]), Some("ND"));
        assert_eq!(truth(&[lf]), Some("STUCK"));
        assert_eq!(truth(&[encoder]), Some("ENCODER"));
        assert_eq!(truth(&[unmodelled]), Some("UNKNOWN"));
        assert_eq!(truth(&[lf, rf]), Some("SEVERAL_DRIVABLE"));
        assert_eq!(truth(&[lf, lm]), Some("SEVERAL"));
        assert_eq!(truth(&[encoder, unmodelled]), Some("SEVERAL"));
        let small = PresentFault {
            severity: 0.4,
            ..lf
        };
        assert_eq!(truth(&[small]), None);
    }
}

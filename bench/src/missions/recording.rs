//! Evidence of each epoch in a mission, with what was true, as steps of the decision model.
//!
//! The decision model's observation of an epoch is what its evidence speaks for most: the condition
//! whose probability rose most, if the belief moved at all. A condition counts as new from when it
//! is there, or from the alarm, until nothing has been said of it for [`QUIET_S`]; then it has
//! settled. What is said later, the model holds impossible: such a step has no true state. Nor has
//! one in which no alarm stands, or rises: before it the model has not begun.
//!
//! So what is new is what more will be said of. Who waits cannot know that: chances that are
//! counted by it, of evidence and of its end, are a tenth too high in the rover's missions.

use vigil_blocks::{Action, RecoveryKind};
use vigil_missions::learning::Record;
use vigil_pomdp::Pomdp;

use super::breakdown::{Cause, PresentFault};
use super::rules::RuleOutput;

/// A belief that moves by less in an epoch has not been told anything (half the sum of absolute
/// differences): as much as the supervisor calls a move.
const MOVED: f64 = 0.05;
/// So long without evidence, and it has ended, s. Chosen: longer than what an identifier's window
/// holds; less would cut evidence in two.
const QUIET_S: f64 = 1.0;
/// What is less than this share of what it grows to is not yet a fault of the model.
const SEVERE: f64 = 0.5;
/// End of the name of a state of which evidence comes.
const NEW: &str = "_NEW";

/// An epoch.
struct EpochStep {
    action: u32,
    /// Name of what was true at its end; `None` for what the model does not have, and while no
    /// alarm stands.
    truth: Option<&'static str>,
    /// The condition that its evidence speaks for.
    said: Option<usize>,
}

/// The beginning of an epoch.
struct EpochBegin {
    t_ns: u64,
    action: u32,
    belief: Vec<f64>,
    alarm: bool,
}

/// Follows the supervisor's action blocks from an alarm to a call for help.
pub(super) struct EvidenceRecorder<'a> {
    model: &'a Pomdp,
    epoch_ns: u64,
    /// For each state, the settled one of the same condition.
    settled: Vec<usize>,
    began: Option<EpochBegin>,
    before: Option<&'static str>,
    steps: Vec<EpochStep>,
    records: Vec<Record>,
}

impl<'a> EvidenceRecorder<'a> {
    /// Of a model whose steps last `epoch_s`.
    pub(super) fn new(model: &'a Pomdp, epoch_s: f64) -> Self {
        let names = model.states();
        let settled = names.iter().enumerate().map(|(state, name)| {
            let of = name.strip_suffix(NEW);
            of.and_then(|of| names.iter().position(|it| it == of))
                .unwrap_or(state)
        });
        Self {
            settled: settled.collect(),
            model,
            epoch_ns: (epoch_s * 1e9).round() as u64,
            began: None,
            before: None,
            steps: Vec::new(),
            records: Vec::new(),
        }
    }

    /// Takes the time of a frame, what is wrong then, and the action block after it.
    pub(super) fn take(&mut self, t_ns: u64, faults: &[PresentFault], action: &Action) {
        if action.kind == RecoveryKind::CallForHelp as u32 {
            return self.end();
        }
        if self.began.is_none() && action.alarm == 0 {
            return;
        }
        let belief = self.folded(action);
        let alarm = action.alarm != 0;
        match &self.began {
            None => self.before = truth(faults),
            Some(began) if t_ns < began.t_ns + self.epoch_ns => return,
            Some(began) => self.steps.push(EpochStep {
                action: began.action,
                truth: truth(faults).filter(|_| began.alarm && alarm),
                said: said(&began.belief, &belief),
            }),
        }
        self.began = Some(EpochBegin {
            t_ns,
            action: action.action,
            belief,
            alarm,
        });
    }

    /// What was recorded, one record for each alarm.
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
        let steps = std::mem::take(&mut self.steps);
        if steps.is_empty() {
            return;
        }
        let quiet = (QUIET_S * 1e9) as usize / self.epoch_ns.max(1) as usize;
        let new_until = new_until(&steps, quiet);
        let mut record = Record::default();
        record.labels.push(self.state(self.before, true));
        for (at, step) in steps.iter().enumerate() {
            let is_new = at < new_until[at];
            let seen = match (is_new, step.said) {
                (true, Some(condition)) => {
                    format!("{}{NEW}", self.model.states()[condition])
                }
                (true, None) => "none".to_owned(),
                (false, _) => "settled".to_owned(),
            };
            let is_known = is_new || step.said.is_none();
            let observations = self.model.observations();
            let Some(seen) = observations.iter().position(|name| *name == seen) else {
                continue;
            };
            record.actions.push(step.action);
            record.observations.push(seen as u32);
            let truth = step.truth.filter(|_| is_known);
            record.labels.push(self.state(truth, is_new));
        }
        self.records.push(record);
    }

    /// The model's state of a condition.
    fn state(&self, truth: Option<&'static str>, is_new: bool) -> Option<u32> {
        let truth = truth?;
        let name = if is_new {
            format!("{truth}{NEW}")
        } else {
            truth.to_owned()
        };
        let state = self.model.states().iter().position(|of| *of == name)?;
        Some(state as u32)
    }
}

/// For each step, the one at which what is true in it settles: the first without evidence that is
/// followed by `quiet` others without.
fn new_until(steps: &[EpochStep], quiet: usize) -> Vec<usize> {
    let mut until = Vec::with_capacity(steps.len());
    while until.len() < steps.len() {
        let first = until.len();
        let same = steps[first..]
            .iter()
            .take_while(|step| step.truth == steps[first].truth);
        let (mut last, mut end) = (first, first);
        for step in same {
            if step.said.is_some() && end < last + quiet {
                last = end + 1;
            }
            end += 1;
        }
        until.resize(end, last);
    }
    until
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
            Cause::Unmodelled => "UNKNOWN",
        }),
        several => {
            let causes = several.iter().map(|fault| fault.cause);
            Some(match RuleOutput::limp_home(causes) {
                Some(_) => "SEVERAL_DRIVABLE",
                None => "SEVERAL",
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

    /// A rover with a stuck wheel that goes on, with an alarm.
    struct Rover<'a> {
        recorder: EvidenceRecorder<'a>,
        model: &'a Pomdp,
        t_ns: u64,
    }

    impl Rover<'_> {
        /// An epoch later these are its probabilities.
        fn believes(&mut self, parts: &[(&str, f64)], alarm: bool, kind: RecoveryKind) {
            let mut action = Action {
                alarm: u32::from(alarm),
                kind: kind as u32,
                ..Action::default()
            };
            for (name, p) in parts {
                let state = self.model.states().iter().position(|of| of == name);
                action.belief[state.unwrap()] = *p;
            }
            let stuck = PresentFault {
                cause: Cause::Stuck(0),
                severity: 1.0,
            };
            self.recorder.take(self.t_ns, &[stuck], &action);
            self.t_ns += (EPOCH_S * 1e9) as u64;
        }
    }

    fn names(model: &Pomdp, record: &Record) -> Vec<(String, Option<String>)> {
        let seen = record.observations.iter();
        let seen = seen.map(|o| model.observations()[*o as usize].clone());
        let labels = record.labels[1..].iter();
        let labels = labels.map(|label| label.map(|s| model.states()[s as usize].clone()));
        seen.zip(labels).collect()
    }

    #[test]
    fn evidence_is_new_from_the_alarm_until_it_is_quiet() {
        let model = model();
        let mut rover = Rover {
            recorder: EvidenceRecorder::new(&model, EPOCH_S),
            model: &model,
            t_ns: 0,
        };
        let go_on = RecoveryKind::GoOn;
        rover.believes(&[("ND", 1.0)], false, go_on);
        rover.believes(&[("UNKNOWN_NEW", 0.8), ("STUCK_NEW", 0.2)], true, go_on);
        // Too little to be told anything; that something has settled is no evidence; then it is.
        rover.believes(&[("UNKNOWN", 0.78), ("STUCK", 0.22)], true, go_on);
        rover.believes(&[("UNKNOWN_NEW", 0.1), ("STUCK_NEW", 0.9)], true, go_on);
        for _ in 0..20 {
            rover.believes(&[("UNKNOWN", 0.1), ("STUCK", 0.9)], true, go_on);
        }
        // Late news, which the model holds impossible.
        rover.believes(&[("UNKNOWN", 0.9), ("STUCK", 0.1)], true, go_on);
        rover.believes(&[("UNKNOWN", 0.9)], true, RecoveryKind::CallForHelp);
        let records = rover.recorder.finish();
        let [record] = records.as_slice() else {
            panic!("{records:?}");
        };
        let found = names(&model, record);
        let is = |at: usize, seen: &str, state: Option<&str>| {
            assert_eq!(
                found[at],
                (seen.to_owned(), state.map(str::to_owned)),
                "{at}"
            );
        };
        assert_eq!(found.len(), 23);
        is(0, "none", Some("STUCK_NEW"));
        is(1, "STUCK_NEW", Some("STUCK_NEW"));
        (2..22).for_each(|at| is(at, "settled", Some("STUCK")));
        is(22, "settled", None);
        record.check(&model).unwrap();
    }

    #[test]
    fn nothing_is_known_without_an_alarm() {
        let model = model();
        let mut rover = Rover {
            recorder: EvidenceRecorder::new(&model, EPOCH_S),
            model: &model,
            t_ns: 0,
        };
        for (p, alarm) in [
            (0.1, true),
            (0.9, true),
            (0.8, false),
            (0.9, true),
            (0.8, true),
        ] {
            rover.believes(&[("STUCK", p), ("ND", 1.0 - p)], alarm, RecoveryKind::GoOn);
        }
        let records = rover.recorder.finish();
        let known: Vec<bool> = records[0].labels.iter().map(Option::is_some).collect();
        assert_eq!(known, [true, true, false, false, true]);
    }
}

//! Names of what events are about.

use std::fmt;

use vigil_blocks::{
    ActionRejection, AnsweredWheels, Event, EventKind, FaultState, MODE_MULTIPLE, Rejection,
    SizeKind, Weighing,
};
use vigil_cycle::watchdog::WatchdogFinding;
use vigil_robot::FaultTree;
use vigil_robot::channel::evidence_name;
use vigil_robot::injection::{Change, WireChange};
use vigil_robot::publisher_check::Finding;
use vigil_setup::{Setup, fault_name};

use crate::entry::{NamedFault, NamedStep, TimelineEntry};
use crate::record::Record;
use crate::wall_clock::WallClock;
use crate::weighing::NamedWeighing;
use crate::words;

/// What an event carries, in words.
fn text_of(carried: Option<impl fmt::Display>) -> String {
    carried.map_or_else(|| "?".to_owned(), |it| it.to_string())
}

/// Gives names to what events are about.
pub(crate) struct Namer {
    pub(crate) tree: FaultTree,
    states: Vec<String>,
    pub(crate) actions: Vec<String>,
    pub(crate) observations: Vec<String>,
    /// The user's own, each with the set that holds it alone.
    symptoms: Vec<(String, u32)>,
    pub(crate) robot: vigil_robot::Description,
    clock: WallClock,
}

impl Namer {
    /// Names from a graph's models.
    pub(crate) fn new(setup: &Setup) -> Self {
        let symptoms = setup.file.supervisor.symptoms.iter();
        Self {
            tree: setup.tree.clone(),
            states: setup.decision.states().to_vec(),
            actions: setup.decision.actions().to_vec(),
            observations: setup.decision.observations().to_vec(),
            symptoms: symptoms
                .map(|(name, own)| (name.clone(), own.set()))
                .collect(),
            robot: setup.robot.clone(),
            clock: WallClock::now(),
        }
    }

    /// The event in words; its time counts from `origin_ns`.
    pub(crate) fn entry(&self, record: &Record, origin_ns: Option<u64>) -> TimelineEntry {
        let event = &record.event;
        let text = record.text.clone();
        let kind = EventKind::from_repr(event.kind);
        let since_s = |origin_ns: u64| (event.t_ns as f64 - origin_ns as f64) * 1e-9;
        let has_p = matches!(
            kind,
            Some(EventKind::Alarm | EventKind::Diagnosis | EventKind::Action)
        );
        TimelineEntry {
            t_s: origin_ns.map(|ns| (since_s(ns) * 1e6).round() * 1e-6),
            t_ns: event.t_ns,
            wall: self.clock.rfc3339(event.t_ns),
            service: record.service.as_str().to_owned(),
            event: kind.map_or("unknown", EventKind::name).to_owned(),
            what: text
                .or_else(|| Some(self.what(kind?, event)))
                .unwrap_or_default(),
            p: has_p.then_some(event.p),
            count: matches!(kind, Some(EventKind::Miss | EventKind::Rejected))
                .then_some(event.value),
            fault_set: (kind == Some(EventKind::Diagnosis) && event.what == MODE_MULTIPLE)
                .then(|| self.set(event.value)),
            weighing: self.weighing(event),
            step: self.step(event),
            fault: self.fault(event),
        }
    }

    fn step(&self, event: &Event) -> Option<NamedStep> {
        let name = |names: &[String], at: usize| names.get(at).cloned();
        (event.kind == EventKind::Step as u32).then(|| NamedStep {
            number: event.p as u64,
            belief: (event.value >> 32) as u32,
            action: name(&self.actions, event.what as usize).unwrap_or_else(|| "?".to_owned()),
            observation: name(&self.observations, event.value as u32 as usize),
        })
    }

    fn weighing(&self, event: &Event) -> Option<NamedWeighing> {
        let weighing = Weighing::from_event(event)?;
        Some(NamedWeighing::new(&weighing, &self.states, &self.actions))
    }

    /// Leaves, given as bits, joined by `+`.
    fn set(&self, leaves: u64) -> String {
        let nodes = self.tree.nodes().iter().enumerate();
        let names = nodes.filter(|(i, _)| leaves >> i & 1 == 1);
        let names: Vec<&str> = names.map(|(_, node)| node.name.as_str()).collect();
        names.join("+")
    }

    fn what(&self, kind: EventKind, event: &Event) -> String {
        match kind {
            EventKind::Diagnosis | EventKind::Cleared => self.mode(event.what),
            EventKind::Reason => {
                let (channel, evidence) =
                    (evidence_name(&self.robot, event.what as usize), event.p);
                let runner_up = self.tree.mode_name(event.value as u32);
                words::reason(&channel, evidence, runner_up)
            }
            EventKind::Size => {
                let kind = SizeKind::from_wire(event.what >> 8);
                let node = self.mode(event.what & 0xff);
                format!("{node} {}", kind.text(event.p, f64::from_bits(event.value)))
            }
            EventKind::Action | EventKind::Obeys => {
                let action = self.actions.get(event.what as usize);
                let action = action.map_or("?", String::as_str);
                let wheels = AnsweredWheels::from_event(event.value);
                self.robot.action_text(action, wheels)
            }
            EventKind::Injected | EventKind::Restored => {
                let wire = WireChange::from_event(kind == EventKind::Injected, event);
                Change::from_wire(&wire).map_or("?".into(), |change| change.text(&self.robot))
            }
            EventKind::Miss => words::cycles(event.value),
            EventKind::SafeStop => match ActionRejection::from_repr(event.what) {
                Some(ActionRejection::Nothing) => "no action".into(),
                Some(ActionRejection::Expired) => "the action has expired".into(),
                Some(ActionRejection::UnknownKind) => "the action's kind is unknown".into(),
                Some(ActionRejection::NotFinite) => "a parameter is not finite".into(),
                Some(ActionRejection::OutOfRange) => "the speed factor is out of range".into(),
                None => "?".into(),
            },
            EventKind::Run => event.value.to_string(),
            EventKind::Symptoms => words::symptoms(event.what, &self.symptoms),
            EventKind::ContextChanged => {
                let context = self.robot.context.get(event.what as usize);
                context.map_or_else(|| "?".into(), |context| context.name.clone())
            }
            EventKind::Outcome => words::outcome(event),
            EventKind::Degraded => words::degraded(event.what),
            EventKind::Rejected => {
                let cause = Rejection::from_repr(event.what).map_or("?", Rejection::as_str);
                format!("{} frames: {cause}", event.value)
            }
            EventKind::Publisher => Finding::from_wire(event.what, event.p)
                .map_or_else(|| "?".into(), |finding| finding.text(&self.robot)),
            EventKind::Blind => words::blind(event.what).into(),
            EventKind::BlindEnds => format!("after {:.1} s", event.value as f64 * 1e-9),
            EventKind::NotExcited => "the robot stands: the belief is held".into(),
            EventKind::Latched | EventKind::Released => {
                let action = self.actions.get(event.what as usize);
                let action = action.map_or("?", String::as_str);
                match kind {
                    EventKind::Latched => format!("{action}, until a new run or a reset"),
                    _ => action.to_owned(),
                }
            }
            EventKind::Weighed => text_of(self.weighing(event)),
            EventKind::Step => text_of(self.step(event)),
            EventKind::Fault => text_of(self.fault(event)),
            EventKind::Particles => format!("{} of {}", event.what, event.value),
            EventKind::Refused => words::refused(event.what).into(),
            EventKind::Watchdog => {
                let found = WatchdogFinding::from_repr(event.what);
                found.map_or("?", words::watchdog).into()
            }
            _ => String::new(),
        }
    }

    fn mode(&self, node: u32) -> String {
        self.tree.mode_name(node).to_owned()
    }

    fn fault(&self, event: &Event) -> Option<NamedFault> {
        let (source, what) = (event.what >> 16, event.what & 0xffff);
        let state = FaultState::from_repr(event.value as u32 & 0xff);
        (event.kind == EventKind::Fault as u32).then(|| NamedFault {
            number: event.value >> 8,
            name: fault_name(&self.tree, source, what).to_owned(),
            state: state.map_or("?", FaultState::name).to_owned(),
        })
    }
}

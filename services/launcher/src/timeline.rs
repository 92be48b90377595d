//! What happened, in order, in words.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use vigil_blocks::{
    ActionRejection, AnsweredWheels, Blindness, Event, EventKind, FaultState, MODE_MULTIPLE,
    Rejection, SizeKind, Weighing,
};
use vigil_cycle::failure::Failure;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::watchdog::WatchdogFinding;
use vigil_robot::FaultTree;
use vigil_robot::channel::evidence_name;
use vigil_robot::injection::{Change, WireChange};
use vigil_robot::publisher_check::Finding;
use vigil_setup::{Setup, fault_name};

use crate::weighing::NamedWeighing;
use crate::words;

/// An event in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TimelineEntry {
    /// Seconds since every service answered for the first time.
    pub t_s: f64,
    /// The service that says so; of `restarted` the one that was.
    pub service: &'static str,
    /// Kind of the event.
    pub event: &'static str,
    /// What it is about.
    pub what: String,
    /// Probability, where the event has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p: Option<f64>,
    /// Of a diagnosis of several faults: the most probable set, joined by `+`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault_set: Option<String>,
    /// Of what a decision was weighed from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighing: Option<NamedWeighing>,
    /// Of a step of the decision model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<NamedStep>,
    /// Of a change in the life of a fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<NamedFault>,
}

/// A fault that has another state, with its names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NamedFault {
    /// Counts the graph's faults, from 1.
    pub number: u64,
    /// Its name.
    pub name: String,
    /// Its state.
    pub state: &'static str,
}

impl fmt::Display for NamedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {}", self.name, self.state)
    }
}

/// A step of the decision model, with its names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NamedStep {
    /// From 1, since the supervisor started.
    pub number: u64,
    /// Steps of one belief have one number: it began anew between others.
    pub belief: u32,
    /// The action.
    pub action: String,
    /// What was observed after it; `None` for what the model does not have.
    pub observation: Option<String>,
}

impl fmt::Display for NamedStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let observation = self.observation.as_deref();
        write!(f, "{} {}", self.action, observation.unwrap_or("?"))
    }
}

impl TimelineEntry {
    /// False for what only programs read: each step of the decision model.
    pub const fn is_told(&self) -> bool {
        self.step.is_none()
    }
}

impl fmt::Display for TimelineEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            t_s,
            service,
            event,
            what,
            ..
        } = self;
        write!(f, "{t_s:9.3} s  {service:<10}  {event:<10}  {what}")?;
        if let Some(set) = &self.fault_set {
            write!(f, " {set}")?;
        }
        self.p.map_or(Ok(()), |p| write!(f, "  p={p:.3}"))
    }
}

/// An event as it came.
#[derive(Debug, Clone)]
struct Record {
    service: ServiceName,
    event: Event,
    /// What it says, if no block can carry that.
    text: Option<String>,
}

/// All events of a run.
pub struct Timeline {
    namer: Namer,
    records: Vec<Record>,
    shown: usize,
    overwritten: u64,
    origin_ns: Option<u64>,
    closed_ns: Option<u64>,
}

impl Timeline {
    /// An empty timeline of a graph with these models.
    pub fn new(setup: &Setup) -> Self {
        Self {
            namer: Namer::new(setup),
            origin_ns: None,
            records: Vec::new(),
            shown: 0,
            overwritten: 0,
            closed_ns: None,
        }
    }

    /// Adds an event, unless it lies in the stopping of the graph.
    pub fn add(&mut self, service: ServiceName, event: &Event) {
        if self
            .closed_ns
            .is_none_or(|closed_ns| event.t_ns <= closed_ns)
        {
            if event.kind == EventKind::Ready as u32 {
                self.begin(event.t_ns);
            }
            self.records.push(Record {
                service,
                event: *event,
                text: None,
            });
        }
    }

    /// Adds an assertion of a service that has failed, also while the graph is being stopped.
    pub fn add_failure(&mut self, service: ServiceName, failure: &Failure) {
        self.records.push(Record {
            service,
            event: Event {
                t_ns: failure.t_ns,
                kind: EventKind::Assertion as u32,
                ..Event::default()
            },
            text: Some(failure.to_string()),
        });
    }

    /// Adds that a service was started again.
    pub fn add_restart(&mut self, service: ServiceName, t_ns: u64) {
        let restart = Event {
            t_ns,
            kind: EventKind::Restarted as u32,
            ..Event::default()
        };
        self.add(service, &restart);
    }

    /// Events after `t_ns` are of no interest: the services are being stopped.
    pub const fn close(&mut self, t_ns: u64) {
        self.closed_ns = Some(t_ns);
    }

    /// Instant after which events are of no interest, ns, once it is known.
    pub const fn closed_ns(&self) -> Option<u64> {
        self.closed_ns
    }

    /// Counts events that were overwritten before they could be read.
    pub const fn add_overwritten(&mut self, count: u64) {
        self.overwritten += count;
    }

    /// Events that were overwritten before they could be read.
    pub const fn overwritten(&self) -> u64 {
        self.overwritten
    }

    /// Instant from which times count, ns: the first cycle in which every service answered.
    pub const fn origin_ns(&self) -> Option<u64> {
        self.origin_ns
    }

    /// The drive began at `origin_ns`, unless it had begun before.
    pub fn begin(&mut self, origin_ns: u64) {
        self.origin_ns.get_or_insert(origin_ns);
    }

    /// Scheduled instant of a recording's last frame, ns, once it has been played.
    pub fn recording_end_ns(&self) -> Option<u64> {
        self.first_record(EventKind::EndOfRecording)
            .map(|record| record.event.value)
    }

    /// False for what follows from the end of a recording alone: that input is missing.
    fn is_shown(&self, event: &Event) -> bool {
        use EventKind::{InputBack, InputLost, Miss};
        let is_missing = [Miss, InputLost, InputBack]
            .map(|kind| kind as u32)
            .contains(&event.kind);
        !is_missing
            || self
                .recording_end_ns()
                .is_none_or(|end_ns| event.t_ns <= end_ns)
    }

    /// What was broken and mended, in the words of `--inject`, with the time since the origin.
    pub fn changes(&self) -> Vec<String> {
        let mut entries = self.entries();
        entries.retain(|entry| ["injected", "restored"].contains(&entry.event));
        let spec = |entry: &TimelineEntry| format!("{}@{}", entry.what, entry.t_s.max(0.0));
        entries.iter().map(spec).collect()
    }

    /// Puts the newly added events in order; prints them to standard error if `show`.
    pub fn settle(&mut self, show: bool) {
        let origin_ns = self.origin_ns;
        self.records[self.shown..].sort_by_key(|record| record.event.t_ns);
        if show && origin_ns.is_some() {
            let new = self.records[self.shown..].iter();
            for record in new.filter(|record| self.is_shown(&record.event)) {
                let entry = self.namer.entry(record, origin_ns);
                if entry.is_told() {
                    tell!("{entry}");
                }
            }
        }
        if origin_ns.is_some() || !show {
            self.shown = self.records.len();
        }
    }

    fn first_record(&self, kind: EventKind) -> Option<&Record> {
        let mut records = self.records.iter();
        records.find(|record| record.event.kind == kind as u32)
    }

    /// Seconds for which the detector was blind, by cause, until `end_ns`.
    pub fn blind_s(&self, end_ns: u64) -> BTreeMap<&'static str, f64> {
        let mut sorted: Vec<&Event> = self.records.iter().map(|record| &record.event).collect();
        sorted.sort_by_key(|event| event.t_ns);
        blind_s(sorted.into_iter(), end_ns)
    }

    /// True if an event of this kind is there.
    pub fn has(&self, kind: EventKind) -> bool {
        self.first_record(kind).is_some()
    }

    /// Every event in words, in order.
    pub fn entries(&self) -> Vec<TimelineEntry> {
        let origin_ns = self.origin_ns;
        let mut sorted: Vec<&Record> = self.records.iter().collect();
        sorted.sort_by_key(|record| record.event.t_ns);
        sorted.retain(|record| self.is_shown(&record.event));
        let entry = |record: &&Record| self.namer.entry(record, origin_ns);
        sorted.iter().map(entry).collect()
    }
}

/// Adds up what lies between events of blindness.
fn blind_s<'a>(
    events: impl Iterator<Item = &'a Event>,
    end_ns: u64,
) -> BTreeMap<&'static str, f64> {
    let mut sums = BTreeMap::new();
    let mut since: Option<(u64, u32)> = None;
    let mut close = |since: &mut Option<(u64, u32)>, t_ns: u64| {
        if let Some((from_ns, cause)) = since.take() {
            let name = Blindness::from_repr(cause).map_or("unknown", Blindness::name);
            *sums.entry(name).or_insert(0.0) += t_ns.saturating_sub(from_ns) as f64 * 1e-9;
        }
    };
    for event in events.take_while(|event| event.t_ns <= end_ns) {
        match EventKind::from_repr(event.kind) {
            Some(EventKind::Blind) => {
                close(&mut since, event.t_ns);
                since = Some((event.t_ns, event.what));
            }
            Some(EventKind::BlindEnds) => close(&mut since, event.t_ns),
            _ => {}
        }
    }
    close(&mut since, end_ns);
    sums
}

/// What an event carries, in words.
fn text_of(carried: Option<impl fmt::Display>) -> String {
    carried.map_or_else(|| "?".to_owned(), |it| it.to_string())
}

/// Gives names to what events are about.
struct Namer {
    tree: FaultTree,
    states: Vec<String>,
    actions: Vec<String>,
    observations: Vec<String>,
    /// The user's own, each with the set that holds it alone.
    symptoms: Vec<(String, u32)>,
    robot: vigil_robot::Description,
}

impl Namer {
    /// Names from a graph's models.
    fn new(setup: &Setup) -> Self {
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
        }
    }

    fn entry(&self, record: &Record, origin_ns: Option<u64>) -> TimelineEntry {
        let event = &record.event;
        let text = record.text.clone();
        let kind = EventKind::from_repr(event.kind);
        let t_s = origin_ns.map_or(0.0, |origin| (event.t_ns as f64 - origin as f64) * 1e-9);
        let has_p = matches!(
            kind,
            Some(EventKind::Alarm | EventKind::Cleared | EventKind::Diagnosis | EventKind::Action)
        );
        TimelineEntry {
            t_s: (t_s * 1e6).round() * 1e-6,
            service: record.service.as_str(),
            event: kind.map_or("unknown", EventKind::name),
            what: text
                .or_else(|| Some(self.what(kind?, event)))
                .unwrap_or_default(),
            p: has_p.then_some(event.p),
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
                let runner_up = self.mode(event.value as u32);
                format!("{channel} says so by {evidence:.1} nat, against {runner_up}")
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
            EventKind::Miss => format!("{} cycles", event.value),
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
            state: state.map_or("?", FaultState::name),
        })
    }
}

#[cfg(test)]
mod tests;

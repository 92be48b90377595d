use vigil_robot::context_table::DeclaredContext;

use vigil_blocks::MODE_MULTIPLE;

use super::*;

const S: u64 = 1_000_000_000;

fn event(t_s: u64, kind: EventKind, what: u32, value: u64) -> Event {
    Event {
        t_ns: t_s * S,
        kind: kind as u32,
        what,
        p: 0.9,
        value,
    }
}

fn setup() -> Setup {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let config = std::path::PathBuf::from(format!("{root}/config/rover.toml"));
    vigil_setup::load_graph(&config, |_| {}).unwrap()
}

fn timeline() -> Timeline {
    Timeline::new(&setup())
}

#[test]
fn events_are_told_in_order_from_the_beginning_of_the_drive() {
    let mut timeline = timeline();
    timeline.add(ServiceName::Detector, &event(12, EventKind::Alarm, 0, 0));
    timeline.add(ServiceName::SensorSim, &event(10, EventKind::Ready, 0, 0));
    timeline.add(ServiceName::Supervisor, &event(13, EventKind::Miss, 0, 4));
    timeline.add_overwritten(ServiceName::Detector, 2);
    let lines: Vec<String> = timeline.entries().iter().map(ToString::to_string).collect();
    assert_eq!(
        lines,
        [
            "    0.000 s  sensor-sim  ready       ",
            "    2.000 s  detector    alarm         p=0.900",
            "    3.000 s  supervisor  miss        4 cycles",
        ]
    );
    assert_eq!(
        (timeline.origin_ns(), timeline.overwritten()),
        (Some(10 * S), 2)
    );
    timeline.begin(99);
    assert_eq!(timeline.origin_ns(), Some(10 * S), "it begins once");
}

#[test]
fn a_failed_assertion_is_told_even_while_the_graph_stops() {
    let mut timeline = timeline();
    timeline.begin(10 * S);
    timeline.close(11 * S);
    timeline.add(ServiceName::Detector, &event(12, EventKind::Alarm, 0, 0));
    let failure = Failure {
        t_ns: 12 * S,
        location: "deadline.rs:7:9".into(),
        work: "at input 5 of epoch 3".into(),
        message: "instants never go back".into(),
    };
    timeline.add_failure(ServiceName::Identifier, &failure);
    let entries = timeline.entries();
    assert_eq!(entries.len(), 1);
    assert_eq!(
        entries[0].to_string(),
        "    2.000 s  identifier  assertion   instants never go back (deadline.rs:7:9), \
         at input 5 of epoch 3"
    );
    assert_eq!(timeline.closed_ns(), Some(11 * S));
}

#[test]
fn misses_after_the_end_of_a_recording_are_no_events() {
    let mut timeline = timeline();
    let end = event(20, EventKind::EndOfRecording, 0, 20 * S);
    timeline.add(ServiceName::Detector, &event(19, EventKind::Miss, 0, 1));
    timeline.add(ServiceName::SensorSim, &end);
    timeline.add(ServiceName::Detector, &event(21, EventKind::Miss, 0, 1));
    let events: Vec<_> = timeline
        .entries()
        .into_iter()
        .map(|entry| entry.event)
        .collect();
    assert_eq!(events, ["miss", "end-of-recording"]);
    assert_eq!(timeline.recording_end_ns(), Some(20 * S));
}

#[test]
fn faults_are_named_and_changes_can_be_injected_again() {
    let mut timeline = timeline();
    timeline.begin(10 * S);
    let injection = vigil_robot::Injection::parse("stuck:RM@5", &timeline.namer.robot).unwrap();
    let (what, p, value) = injection.change.to_wire().event();
    let injected = Event {
        p,
        ..event(15, EventKind::Injected, what, value)
    };
    timeline.add(ServiceName::SensorSim, &injected);
    assert_eq!(timeline.changes(), ["stuck:RM@5"]);
    let leaf = |name: &str| timeline.namer.tree.index(name).unwrap();
    let (stuck, encoder) = (leaf("RM_STUCK"), leaf("LF_ENC"));
    let set = 1 << stuck | 1 << encoder;
    let several = event(16, EventKind::Diagnosis, MODE_MULTIPLE, set);
    let one = event(17, EventKind::Diagnosis, stuck as u32, 1 << stuck);
    timeline.add(ServiceName::Identifier, &several);
    timeline.add(ServiceName::Identifier, &one);
    let entries = timeline.entries();
    assert_eq!(entries[1].what, "MULTIPLE");
    let set = entries[1].fault_set.as_deref().unwrap();
    let mut names: Vec<&str> = set.split('+').collect();
    names.sort_unstable();
    assert_eq!(names, ["LF_ENC", "RM_STUCK"]);
    assert_eq!(
        (entries[2].what.as_str(), entries[2].p),
        ("RM_STUCK", Some(0.9))
    );
}

#[test]
fn blind_time_is_added_up_by_cause_until_the_end() {
    let event = |t_s: u64, kind: EventKind, what| Event {
        t_ns: t_s * 1_000_000_000,
        kind: kind as u32,
        what,
        ..Event::default()
    };
    let events = [
        event(1, EventKind::Blind, Blindness::Silence as u32),
        event(3, EventKind::Blind, Blindness::Clock as u32),
        event(4, EventKind::BlindEnds, 0),
        event(5, EventKind::Alarm, 0),
        event(6, EventKind::Blind, Blindness::Clock as u32),
        event(99, EventKind::BlindEnds, 0),
    ];
    let expected = BTreeMap::from([("clock", 1.0 + 2.0), ("silence", 2.0)]);
    assert_eq!(blind_s(events.iter(), 8_000_000_000), expected);
    assert_eq!(blind_s(events[3..4].iter(), 8_000_000_000), BTreeMap::new());
}

#[test]
fn a_change_that_is_no_fault_is_told_by_its_name() {
    let mut setup = setup();
    setup.robot.context = ["load", "ground"]
        .map(|name| DeclaredContext {
            name: name.to_owned(),
            shows: Vec::new(),
        })
        .to_vec();
    let mut timeline = Timeline::new(&setup);
    timeline.begin(10 * S);
    let kind = EventKind::ContextChanged;
    timeline.add(ServiceName::Detector, &event(12, kind, 1, 11 * S));
    timeline.add(ServiceName::Detector, &event(13, kind, 7, 11 * S));
    let entries = timeline.entries();
    let lines: Vec<String> = entries.iter().map(ToString::to_string).collect();
    assert_eq!(
        lines,
        [
            "    2.000 s  detector    context-changed  ground",
            "    3.000 s  detector    context-changed  ?",
        ]
    );
    let json = serde_json::to_value(&entries[0]).unwrap();
    assert_eq!(json["event"], "context-changed");
    assert_eq!(json["what"], "ground");
    assert!(json.get("p").is_none());
}

#[test]
fn steps_of_the_decision_model_are_for_programs_alone() {
    let mut timeline = timeline();
    timeline.begin(10 * S);
    let step = |value| Event {
        p: 7.0,
        ..event(12, EventKind::Step, 1, value)
    };
    timeline.add(ServiceName::Supervisor, &step(3 << 32));
    timeline.add(ServiceName::Supervisor, &step(u64::from(u32::MAX)));
    let entries = timeline.entries();
    let action = timeline.namer.actions[1].as_str();
    let observation = timeline.namer.observations[0].as_str();
    let named = entries[0].step.as_ref().unwrap();
    assert_eq!((named.number, named.belief), (7, 3));
    assert_eq!(named.action, action);
    assert_eq!(named.observation.as_deref(), Some(observation));
    assert_eq!(entries[0].what, format!("{action} {observation}"));
    assert_eq!(entries[1].step.as_ref().unwrap().observation, None);
    assert!(entries.iter().all(|entry| !entry.is_told()));
}

#[test]
fn events_wait_for_the_drive_unless_it_is_late_and_are_handed_out_once() {
    let mut timeline = timeline();
    let events = |timeline: &mut Timeline, is_late| {
        let new = timeline.take_new(is_late);
        let new = new.into_iter().map(|entry| (entry.event, entry.t_s));
        new.collect::<Vec<_>>()
    };
    timeline.add(ServiceName::Detector, &event(9, EventKind::Blind, 0, 0));
    assert_eq!(events(&mut timeline, false), []);
    assert_eq!(events(&mut timeline, true), [("blind".to_owned(), None)]);
    timeline.add(ServiceName::Detector, &event(12, EventKind::Alarm, 0, 0));
    timeline.add(ServiceName::SensorSim, &event(10, EventKind::Ready, 0, 0));
    let new = [
        ("ready".to_owned(), Some(0.0)),
        ("alarm".to_owned(), Some(2.0)),
    ];
    assert_eq!(events(&mut timeline, false), new);
    assert_eq!(events(&mut timeline, true), []);
}

#[test]
fn what_another_launcher_has_told_is_not_told_again_and_times_go_on() {
    let mut first = timeline();
    first.begin(10 * S);
    let alarm = event(12, EventKind::Alarm, 0, 0);
    first.add(ServiceName::Detector, &alarm);
    let mut second = timeline();
    for entry in first.take_new(false) {
        second.add_told(entry);
    }
    second.add_overwritten(ServiceName::Detector, 7);
    second.add(ServiceName::Detector, &alarm);
    second.add(ServiceName::Detector, &event(13, EventKind::Cleared, 0, 0));
    second.add(ServiceName::Supervisor, &event(11, EventKind::Miss, 0, 1));
    let new = second.take_new(false);
    let new: Vec<_> = new.iter().map(|e| (e.event.as_str(), e.t_s)).collect();
    assert_eq!(new, [("miss", Some(1.0)), ("cleared", Some(3.0))]);
    let mut own = second.entries()[0].clone();
    (own.t_ns, own.event) = (14 * S, "adopted".to_owned());
    second.add_own(own);
    let all = second.entries();
    let all: Vec<&str> = all.iter().map(|entry| entry.event.as_str()).collect();
    assert_eq!(all, ["miss", "alarm", "cleared", "adopted"]);
    assert!(second.take_new(false).is_empty());
    assert_eq!(second.overwritten(), 0);
    second.add_overwritten(ServiceName::Detector, 1);
    assert_eq!(second.overwritten(), 1);
}

#[test]
fn of_weeks_the_newest_events_and_all_changes_are_kept() {
    let mut timeline = timeline();
    timeline.begin(0);
    let broken = event(1, EventKind::Injected, 0, 0);
    timeline.add(ServiceName::SensorSim, &broken);
    let last = RECORDS_MAX as u64 + 10;
    for t_s in 2..=last {
        let miss = event(t_s, EventKind::Miss, 0, 1);
        timeline.add(ServiceName::Detector, &miss);
        if t_s % 1000 == 0 {
            timeline.take_new(true);
        }
    }
    assert!(timeline.take_new(true).len() < 1000);
    let entries = timeline.entries();
    assert_eq!(entries.len() as u64 + timeline.overwritten(), last);
    assert!(timeline.overwritten() > 0);
    let [first, second, ..] = entries.as_slice() else {
        panic!("{} are left", entries.len());
    };
    assert_eq!(
        (first.event.as_str(), second.event.as_str()),
        ("injected", "miss")
    );
    assert_eq!(entries.last().unwrap().t_s, Some(last as f64));
}

//! Views that tests look at.

use std::path::Path;

use vigil_blocks::{
    Action, Block, DetectionBelief, FaultBelief, FaultRecord, FaultSet, FaultSource, FaultState,
    Faults, Header, Health, OverallState, Readiness, SensorFrame, ServiceState, Severity, SizeKind,
    ValueKind,
};
use vigil_setup::{Setup, load_graph};
use vigil_timeline::TimelineEntry;

use super::View;
use crate::faults::document::Now;

/// The instant of every sample, ns.
pub const NOW_NS: u64 = 1_000_000_000_000;

/// The same on both clocks.
pub const NOW: Now = Now {
    monotonic_ns: NOW_NS,
    unix_s: 1.7e9,
};

/// The shipped rover.
pub fn setup() -> Setup {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    load_graph(&root.join("config/rover.toml"), |_| {}).unwrap()
}

/// A graph that drives well, and has done so for ten seconds.
pub fn healthy(setup: &Setup) -> View {
    let mut view = View {
        launcher: Some(4711),
        lives: [Some(true); 4],
        up_s: Some(62.0),
        ..View::default()
    };
    for cycle in 0..1000 {
        view.end_to_end.push(action_header(cycle));
    }
    for service in 0..4 {
        let block = health(service);
        for second in 0..60 {
            let now_ns = NOW_NS - second_ns(59 - second);
            view.histories.take_health(service, &block, now_ns);
        }
        view.health[service] = Some(Box::new(block));
    }
    believe(setup, &mut view, 0.0);
    view.frame = Some(Box::new(frame()));
    view.faults = Some(Box::new(faults(setup, OverallState::Ok)));
    view.action = Some(Box::new(action(setup, "go_on", "ND", "slow_down")));
    view.events = vec![event("sensor-sim", "ready", "")];
    view
}

/// The same, with its right middle wheel stuck for three minutes.
pub fn faulty(setup: &Setup) -> View {
    let mut view = healthy(setup);
    let mut faults = faults(setup, OverallState::Fault);
    faults.records[0] = stuck(setup);
    view.faults = Some(Box::new(faults));
    believe(setup, &mut view, 0.998);
    view.action = Some(Box::new(action(setup, "compensate", "STUCK", "go_on")));
    view.events.extend([
        event("detector", "alarm", ""),
        event("supervisor", "fault", "RM_STUCK is active"),
    ]);
    view
}

/// The same, but which wheel it is, is not known.
pub fn sided(setup: &Setup) -> View {
    let mut view = faulty(setup);
    let diagnosis = view.diagnosis.as_mut().unwrap();
    for (name, p) in [("RSS", 0.9), ("RM_STUCK", 0.5), ("RF_STUCK", 0.4)] {
        diagnosis.p[setup.tree.index(name).unwrap()] = p;
    }
    view.histories.take_diagnosis(diagnosis, NOW_NS);
    view
}

/// The same, but its processes are gone and its launcher too: nothing was heard for five seconds.
pub fn silent(setup: &Setup) -> View {
    let mut view = faulty(setup);
    view.launcher = None;
    view.lives = [Some(false); 4];
    let earlier_ns = NOW_NS - second_ns(5);
    for health in view.health.iter_mut().flatten() {
        health.header.t_publish_ns = earlier_ns;
    }
    view.action.as_mut().unwrap().valid_until_ns = earlier_ns;
    for header in [
        view.faults.as_mut().map(|block| block.header_mut()),
        view.frame.as_mut().map(|block| block.header_mut()),
        view.detection.as_mut().map(|block| block.header_mut()),
        view.diagnosis.as_mut().map(|block| block.header_mut()),
        view.action.as_mut().map(|block| block.header_mut()),
    ] {
        header.unwrap().t_publish_ns = earlier_ns;
    }
    view
}

const fn second_ns(seconds: u64) -> u64 {
    seconds * 1_000_000_000
}

fn header() -> Header {
    Header {
        epoch: 7,
        t_publish_ns: NOW_NS - 20_000_000,
        ..Header::default()
    }
}

fn action_header(cycle: u64) -> Header {
    let t_schedule_ns = NOW_NS - second_ns(10) + cycle * 10_000_000;
    Header {
        seq: cycle,
        t_schedule_ns,
        t_publish_ns: t_schedule_ns + 200_000 + cycle * 100,
        ..header()
    }
}

fn health(service: usize) -> Health {
    Health {
        header: header(),
        cycles: 1000,
        state: ServiceState::Running as u32,
        last_cycle_ns: 24_000,
        worst_cycle_ns: 1_529_000,
        budget_ns: 5_000_000,
        missed: u64::from(service == 2),
        policy: 1,
        priority: 50,
        ..Health::default()
    }
}

/// Both stages believe in the stuck wheel, since the last second.
fn believe(setup: &Setup, view: &mut View, p: f64) {
    let mut diagnosis = FaultBelief {
        header: header(),
        tree_hash: setup.tree.hash(),
        node_count: setup.tree.nodes().len() as u32,
        set_count: 2,
        p_unknown: 0.001,
        ..FaultBelief::default()
    };
    let wheel = setup.tree.index("RM_STUCK").unwrap();
    diagnosis.p[0] = 1.0 - p - diagnosis.p_unknown;
    diagnosis.p[wheel] = p;
    diagnosis.sets[0] = FaultSet {
        leaves: 1 << wheel,
        p,
    };
    if p > 0.5 {
        diagnosis.reported = wheel as u32;
    }
    let detection = DetectionBelief {
        header: header(),
        p_fault: p,
        alarm: u32::from(p > 0.5),
        alarm_count: u32::from(p > 0.5),
        readiness: Readiness::Armed as u32,
        ..DetectionBelief::default()
    };
    view.histories.take_detection(&detection, NOW_NS);
    view.histories.take_diagnosis(&diagnosis, NOW_NS);
    view.detection = Some(Box::new(detection));
    view.diagnosis = Some(Box::new(diagnosis));
}

fn frame() -> SensorFrame {
    let mut frame = SensorFrame {
        header: header(),
        ..SensorFrame::default()
    };
    (0..13).for_each(|channel| frame.set_channel(channel, 0.5));
    frame.set_command(0, 0.25);
    frame
}

fn faults(setup: &Setup, overall: OverallState) -> Faults {
    Faults {
        header: header(),
        tree_hash: setup.tree.hash(),
        overall: overall as u32,
        ..Faults::default()
    }
}

fn stuck(setup: &Setup) -> FaultRecord {
    let actions = setup.decision.actions();
    let is_meant = |name: &String| name == "compensate";
    FaultRecord {
        number: 1,
        first_ns: NOW_NS - second_ns(240),
        last_ns: NOW_NS,
        changed_ns: NOW_NS - second_ns(180),
        p: 0.998,
        evidence: 5.4,
        evidence_channel: 7,
        source: FaultSource::Robot as u32,
        what: setup.tree.index("RM_STUCK").unwrap() as u32,
        state: FaultState::Active as u32,
        severity: Severity::Fault as u32,
        count: 2,
        size_kind: SizeKind::Stuck as u32,
        runner_up: setup.tree.index("RM_ENC").unwrap() as u32,
        action: actions.iter().position(is_meant).unwrap() as u32,
        ..FaultRecord::default()
    }
}

/// It earns 1.5, and the second best 4.5 less.
fn action(setup: &Setup, action: &str, state: &str, second: &str) -> Action {
    let place = |names: &[String], name| names.iter().position(|it| it == name).unwrap();
    let (states, actions) = (setup.decision.states(), setup.decision.actions());
    let mut block = Action {
        header: header(),
        state_count: states.len() as u32,
        action_count: actions.len() as u32,
        action: place(actions, action) as u32,
        control_mode: 1,
        valid_until_ns: NOW_NS + 20_000_000,
        value_kind: ValueKind::Value as u32,
        value: [-90.0; vigil_blocks::DECISION_ACTIONS],
        ..Action::default()
    };
    block.value[place(actions, action)] = 1.5;
    block.value[place(actions, second)] = -3.0;
    block.belief[place(states, state)] = 0.75;
    block.belief[place(states, "UNKNOWN")] = 0.25;
    block
}

fn event(service: &str, event: &str, what: &str) -> TimelineEntry {
    TimelineEntry {
        t_s: Some(3.5),
        t_ns: NOW_NS - second_ns(2),
        wall: "2023-11-14T22:13:32.345Z".to_owned(),
        service: service.to_owned(),
        event: event.to_owned(),
        what: what.to_owned(),
        ..TimelineEntry::default()
    }
}

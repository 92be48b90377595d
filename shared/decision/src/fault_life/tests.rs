use proptest::prelude::*;
use vigil_blocks::{FaultSet, MODE_BLIND, MODE_MULTIPLE};
use vigil_robot::tree::Node;

use super::*;

const UNKNOWN: u32 = MODE_UNKNOWN;
const SIDE: u32 = 1;
const FRONT: u32 = 2;
const REAR: u32 = 3;
const OTHER: u32 = 4;
/// A cycle, ns.
const CYCLE_NS: u64 = 10_000_000;

fn tree() -> FaultTree {
    let node = |name: &str, parent: Option<usize>| Node {
        name: name.to_owned(),
        parent,
        fault: Some(name.to_owned()).filter(|_| !["ND", "SIDE"].contains(&name)),
    };
    let nodes = vec![
        node("ND", None),
        node("SIDE", None),
        node("FRONT", Some(1)),
        node("REAR", Some(1)),
        node("OTHER", None),
    ];
    FaultTree::new(nodes).unwrap()
}

/// A life, its time, and what is decided.
struct Story {
    life: FaultLife,
    now_ns: u64,
    decided: CycleDecision,
    observes: bool,
    silent_services: u32,
}

impl Story {
    fn new(settings: &FaultLifeSettings) -> Self {
        Self {
            life: FaultLife::new(settings, &tree()).unwrap(),
            now_ns: 50_000_000_000,
            decided: CycleDecision {
                kind: RecoveryKind::GoOn as u32,
                ..CycleDecision::default()
            },
            observes: true,
            silent_services: 0,
        }
    }

    /// So many seconds of a reported mode.
    fn report(&mut self, reported: u32, seconds: f64) {
        let belief = belief(reported);
        self.pass(Some(&belief), seconds);
    }

    fn pass(&mut self, belief: Option<&FaultBelief>, seconds: f64) {
        for _ in 0..(seconds * 100.0).round() as u64 {
            self.now_ns += CYCLE_NS;
            self.life.step(LifeInput {
                now_ns: self.now_ns,
                observed: belief.filter(|_| self.observes),
                decided: self.decided,
                silent_services: self.silent_services,
            });
        }
    }

    fn block(&self) -> Box<Faults> {
        let mut block = Box::default();
        self.life.write(&mut block, 7);
        block
    }

    /// What is kept: what, in which state, how often active; by number.
    fn kept(&self) -> Vec<(u32, FaultState, u32)> {
        let block = self.block();
        let mut kept: Vec<&FaultRecord> = block.kept().collect();
        kept.sort_by_key(|record| record.number);
        let of = |it: &&FaultRecord| (it.what, it.state().unwrap(), it.count);
        kept.iter().map(of).collect()
    }

    fn overall(&self) -> OverallState {
        OverallState::from_repr(self.block().overall).unwrap()
    }

    fn changes(&mut self) -> Vec<(u32, FaultState)> {
        let mut changes = Vec::new();
        while let Some(record) = self.life.take_change() {
            changes.push((record.what, record.state().unwrap()));
        }
        changes
    }
}

fn belief(reported: u32) -> Box<FaultBelief> {
    let mut belief = Box::<FaultBelief>::default();
    (belief.reported, belief.mode) = (reported, reported);
    belief.p_unknown = 0.75;
    belief.p[FRONT as usize] = 0.9;
    belief.channel_evidence[3] = 5.5;
    belief
}

fn shipped() -> FaultLifeSettings {
    FaultLifeSettings::default()
}

use FaultState::{Acknowledged, Active, Cleared, Latched, Pending};

#[test]
fn a_fault_is_pending_active_latched_and_cleared_by_an_acknowledgement() {
    let mut story = Story::new(&shipped());
    story.report(0, 1.0);
    assert_eq!((story.kept(), story.overall()), (vec![], OverallState::Ok));
    story.report(FRONT, 0.29);
    assert_eq!(story.kept(), [(FRONT, Pending, 0)]);
    assert_eq!(
        (story.changes(), story.overall()),
        (vec![], OverallState::Ok)
    );
    story.report(FRONT, 0.03);
    assert_eq!(story.kept(), [(FRONT, Active, 1)]);
    assert_eq!(story.changes(), [(FRONT, Active)]);
    assert_eq!(story.overall(), OverallState::Fault);
    story.decided.kind = RecoveryKind::CallForHelp as u32;
    story.report(FRONT, 1.0);
    assert_eq!(story.overall(), OverallState::SafeStop);
    story.decided.kind = RecoveryKind::GoOn as u32;
    story.report(0, 4.9);
    assert_eq!(story.kept(), [(FRONT, Active, 1)]);
    story.report(0, 0.2);
    assert_eq!(story.kept(), [(FRONT, Latched, 1)]);
    assert_eq!(story.overall(), OverallState::Fault);
    assert!(story.life.obey(LifeOrder::Acknowledge(1), story.now_ns));
    assert_eq!(story.kept(), [(FRONT, Cleared, 1)]);
    story.report(0, 0.01);
    assert_eq!(story.overall(), OverallState::Ok);
    assert_eq!(story.changes(), [(FRONT, Cleared)]);
    assert!(story.life.obey(LifeOrder::Clear, story.now_ns));
    assert_eq!(story.kept(), []);
}

#[test]
fn one_that_somebody_knows_of_is_cleared_when_it_is_over() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    assert!(story.life.obey(LifeOrder::Acknowledge(0), story.now_ns));
    assert_eq!(story.kept(), [(FRONT, Acknowledged, 1)]);
    // Who has acknowledged all has nothing left to acknowledge.
    assert!(!story.life.obey(LifeOrder::Acknowledge(0), story.now_ns));
    assert!(!story.life.obey(LifeOrder::Acknowledge(9), story.now_ns));
    story.report(0, 6.0);
    assert_eq!(story.kept(), [(FRONT, Cleared, 1)]);
    // It comes again: nobody knows of that.
    story.report(FRONT, 1.0);
    assert_eq!(story.kept(), [(FRONT, Active, 2)]);
}

#[test]
fn without_a_latch_a_fault_clears_itself() {
    let settings = FaultLifeSettings {
        latch: false,
        ..shipped()
    };
    let mut story = Story::new(&settings);
    story.report(FRONT, 1.0);
    story.report(0, 6.0);
    assert_eq!(story.kept(), [(FRONT, Cleared, 1)]);
}

#[test]
fn what_was_too_short_to_be_told_leaves_nothing() {
    let mut story = Story::new(&shipped());
    story.report(UNKNOWN, 0.2);
    story.report(0, 4.9);
    assert_eq!(story.kept(), [(UNKNOWN, Pending, 0)]);
    story.report(0, 0.2);
    assert_eq!((story.kept(), story.changes()), (vec![], vec![]));
}

#[test]
fn a_report_that_flickers_is_one_fault_and_active_once() {
    let mut story = Story::new(&shipped());
    for _ in 0..300 {
        story.report(UNKNOWN, 0.1);
        story.report(0, 1.9);
    }
    assert_eq!(story.kept(), [(UNKNOWN, Active, 1)]);
    assert_eq!(story.changes(), [(UNKNOWN, Active)]);
}

#[test]
fn a_fault_that_gets_a_name_is_the_same_fault() {
    let mut story = Story::new(&shipped());
    story.report(UNKNOWN, 1.0);
    assert_eq!(story.changes(), [(UNKNOWN, Active)]);
    story.report(SIDE, 1.0);
    story.report(FRONT, 1.0);
    assert_eq!(story.kept(), [(FRONT, Active, 1)]);
    assert_eq!(story.block().fault_count, 1);
    assert_eq!(story.changes(), [(FRONT, Active)]);
}

#[test]
fn a_name_holds_while_its_fault_has_none_for_a_moment_but_not_for_ever() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    story.report(UNKNOWN, 9.0);
    story.report(SIDE, 0.5);
    assert_eq!(story.kept(), [(FRONT, Active, 1)]);
    story.report(FRONT, 1.0);
    // Half a minute of another opinion is another fault.
    story.report(UNKNOWN, 30.0);
    assert_eq!(story.kept(), [(FRONT, Latched, 1), (UNKNOWN, Active, 1)]);
}

#[test]
fn another_name_is_another_fault_and_a_node_elsewhere_is_no_coarser_one() {
    let mut story = Story::new(&shipped());
    story.report(OTHER, 1.0);
    story.report(SIDE, 6.0);
    assert_eq!(story.kept(), [(OTHER, Latched, 1), (SIDE, Active, 1)]);
    story.report(REAR, 1.0);
    assert_eq!(story.kept(), [(OTHER, Latched, 1), (REAR, Active, 1)]);
}

#[test]
fn each_fault_of_a_set_has_a_life() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    let mut both = belief(MODE_MULTIPLE);
    (both.set_count, both.channel_evidence[5]) = (2, 9.0);
    both.sets[1] = FaultSet {
        leaves: 1 << FRONT | 1 << OTHER,
        p: 0.4,
    };
    both.reported = FRONT;
    story.pass(Some(&both), 0.1);
    both.reported = MODE_MULTIPLE;
    story.pass(Some(&both), 1.0);
    assert_eq!(story.kept(), [(FRONT, Active, 1), (OTHER, Active, 1)]);
    let block = story.block();
    let reasons: Vec<u32> = block.kept().map(|it| it.evidence_channel).collect();
    assert_eq!(reasons, [3, 5]);
    // The report is held, but the sets speak of none.
    both.set_count = 1;
    story.pass(Some(&both), 6.0);
    assert_eq!(story.kept(), [(FRONT, Active, 1), (OTHER, Active, 1)]);
    story.report(OTHER, 6.0);
    assert_eq!(story.kept(), [(FRONT, Latched, 1), (OTHER, Active, 1)]);
}

#[test]
fn blindness_and_silent_services_are_faults_of_their_own_and_no_fault_of_the_robot_is_over() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    (story.decided.blind, story.observes) = (1, false);
    story.decided.kind = RecoveryKind::Stop as u32;
    let blind = belief(MODE_BLIND);
    story.pass(Some(&blind), 20.0);
    story.decided.blind = 3;
    story.pass(Some(&blind), 1.0);
    assert_eq!(story.kept(), [(FRONT, Active, 1), (3, Active, 1)]);
    assert_eq!(story.overall(), OverallState::Stale);
    story.decided = CycleDecision {
        kind: RecoveryKind::GoOn as u32,
        ..CycleDecision::default()
    };
    (story.observes, story.silent_services) = (true, 1 << 2);
    story.report(0, 6.0);
    // The identifier is the third service.
    let expected = [(FRONT, Latched, 1), (3, Cleared, 1), (2, Active, 1)];
    assert_eq!(story.kept(), expected);
    let sources: Vec<u32> = story.block().kept().map(|it| it.source).collect();
    assert_eq!(sources, [1, 2, 3]);
}

#[test]
fn nothing_is_over_and_nothing_lasts_while_nothing_is_seen_of_the_robot() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    assert!(story.life.obey(LifeOrder::Acknowledge(0), story.now_ns));
    let last_ns = story.block().records[0].last_ns;
    // A filter that was started again says that all is well until it is armed.
    story.observes = false;
    story.report(0, 60.0);
    story.report(OTHER, 60.0);
    assert_eq!(story.kept(), [(FRONT, Acknowledged, 1)]);
    assert_eq!(story.block().records[0].last_ns, last_ns);
    story.observes = true;
    story.report(0, 6.0);
    assert_eq!(story.kept(), [(FRONT, Cleared, 1)]);
}

#[test]
fn a_fault_that_comes_again_without_a_name_is_the_same_fault_once_it_has_one() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    story.report(0, 6.0);
    story.life.obey(LifeOrder::Acknowledge(0), story.now_ns);
    let first_ns = story.block().records[0].first_ns;
    story.report(UNKNOWN, 1.0);
    assert_eq!(story.kept(), [(FRONT, Cleared, 1), (UNKNOWN, Active, 1)]);
    let revision = story.life.revision();
    story.report(FRONT, 0.01);
    assert_ne!(story.life.revision(), revision, "a new name is news");
    story.report(FRONT, 10.0);
    assert_eq!(story.kept(), [(FRONT, Active, 2)]);
    let block = story.block();
    assert_eq!(block.kept().next().unwrap().first_ns, first_ns);
}

#[test]
fn rules_by_name_hold_for_their_fault() {
    let mut settings = shipped();
    let rule = FaultRule {
        debounce_s: Some(2.0),
        latch: Some(false),
        severity: Some(RuleSeverity::Warning),
        ..FaultRule::default()
    };
    settings.rules.insert("OTHER".into(), rule);
    // What it does not name stays: nothing latches that is of the input, and it is a warning.
    let input = FaultRule {
        clear_s: Some(1.0),
        ..FaultRule::default()
    };
    settings.rules.insert("INPUT".into(), input);
    let mut story = Story::new(&settings);
    story.report(OTHER, 1.9);
    assert_eq!(story.kept(), [(OTHER, Pending, 0)]);
    story.report(OTHER, 0.2);
    assert_eq!(story.overall(), OverallState::Degraded);
    story.report(0, 6.0);
    assert_eq!(story.kept(), [(OTHER, Cleared, 1)]);
    story.decided.blind = 1;
    story.pass(None, 1.0);
    story.decided.blind = 0;
    story.pass(None, 1.1);
    assert_eq!(story.kept(), [(OTHER, Cleared, 1), (1, Cleared, 1)]);
    settings.rules.insert("LEFT".into(), FaultRule::default());
    let error = FaultLife::new(&settings, &tree()).err().unwrap();
    let told = "faults.rules.LEFT: there is no such fault; there are SIDE, FRONT, REAR, OTHER, \
                UNKNOWN, INPUT, sensor-sim, detector, identifier, supervisor";
    assert_eq!(error.to_string(), told);
}

#[test]
fn a_record_says_when_why_and_what_was_measured_at_the_onset() {
    let mut story = Story::new(&shipped());
    for k in 0..2000_u64 {
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = 9_000_000_000 + k * 1_000_000;
        frame.set_channel(0, k as f64);
        frame.set_command(1, 0.5);
        story.life.see(&frame);
    }
    let mut found = belief(FRONT);
    (found.onset_t_capture_ns, found.alarm_t_capture_ns) = (10_204_000_000, 10_500_000_000);
    (found.size[FRONT as usize], found.size_sd[FRONT as usize]) = (0.4, 0.1);
    found.runner_up = REAR;
    let begins_ns = story.now_ns + CYCLE_NS;
    story.decided.action = 3;
    story.pass(Some(&found), 1.0);
    let block = story.block();
    let record = block.kept().next().unwrap();
    assert_eq!((record.first_ns, record.last_ns), (begins_ns, story.now_ns));
    assert_eq!((record.p, record.size, record.size_sd), (0.9, 0.4, 0.1));
    assert_eq!((record.evidence_channel, record.evidence), (3, 5.5));
    assert_eq!((record.runner_up, record.action), (REAR, 3));
    // Of the frames one each 10 ms is kept: 10.20 s is nearest.
    assert_eq!(record.frame_t_capture_ns, 10_200_000_000);
    assert_eq!((record.channel[0], record.command[1]), (1200.0, 0.5));
    assert_eq!((record.channel_valid, record.command_valid), (1, 2));
    assert_eq!((block.tree_hash, block.fault_count), (7, 1));
    // Without any onset it is the newest frame; of a clock that was set back, none before.
    let mut frame = SensorFrame::default();
    frame.header.t_capture_ns = 500;
    frame.set_channel(0, -1.0);
    story.life.see(&frame);
    story.report(OTHER, 1.0);
    let block = story.block();
    let other = block.kept().find(|it| it.what == OTHER).unwrap();
    assert_eq!((other.frame_t_capture_ns, other.channel[0]), (500, -1.0));
}

#[test]
fn another_goes_on_where_one_has_stopped() {
    let mut story = Story::new(&shipped());
    story.report(FRONT, 1.0);
    story.changes();
    let left = story.block();
    let mut next = Story::new(&shipped());
    next.now_ns = story.now_ns + 3_000_000_000;
    next.life.restore(&left);
    assert_eq!(next.kept(), [(FRONT, Active, 1)]);
    next.report(FRONT, 1.0);
    assert_eq!(next.kept(), [(FRONT, Active, 1)]);
    assert_eq!(next.changes(), []);
    next.report(OTHER, 6.0);
    assert_eq!(next.block().fault_count, 2);
    assert!(next.life.revision() > story.life.revision());
}

#[test]
fn what_is_active_is_one_diagnosis() {
    let mut story = Story::new(&shipped());
    story.silent_services = 1;
    assert!(story.life.diagnosis(7).is_none());
    story.report(FRONT, 1.0);
    let told = story.life.diagnosis(7).unwrap();
    assert_eq!((told.tree_hash, told.identifying), (7, 1));
    assert_eq!((told.p[0], told.p[FRONT as usize]), (1.0 - 0.9, 0.9));
    assert_eq!((told.sets[0].leaves, told.set_count), (1 << FRONT, 1));
    let mut story = Story::new(&shipped());
    story.report(UNKNOWN, 1.0);
    let told = story.life.diagnosis(7).unwrap();
    assert_eq!((told.p_unknown, told.set_count), (0.75, 0));
    story.report(0, 60.0);
    assert!(story.life.diagnosis(7).is_none());
}

#[test]
fn where_no_place_is_free_the_oldest_cleared_fault_gives_way_and_no_other() {
    let mut story = Story::new(&shipped());
    for _ in 0..FAULTS {
        story.report(FRONT, 1.0);
        story.report(0, 6.0);
    }
    // One fault, many times.
    assert_eq!(story.kept(), [(FRONT, Latched, FAULTS as u32)]);
    let mut left = story.block();
    for (k, record) in left.records.iter_mut().enumerate() {
        *record = FaultRecord {
            number: k as u64 + 1,
            source: FaultSource::Robot as u32,
            what: 40 + k as u32,
            state: if k == 5 { Cleared } else { Latched } as u32,
            ..FaultRecord::default()
        };
    }
    let mut full = Story::new(&shipped());
    full.life.restore(&left);
    full.report(OTHER, 1.0);
    assert_eq!(
        (full.block().records[5].what, full.block().dropped_count),
        (OTHER, 0)
    );
    full.report(FRONT, 1.0);
    full.report(FRONT, 1.0);
    assert_eq!(full.block().dropped_count, 1);
    assert_eq!(full.kept().len(), FAULTS);
    full.report(0, 0.01);
    assert_eq!(full.block().dropped_count, 0);
}

proptest! {
    #[test]
    fn no_input_breaks_it(
        steps in prop::collection::vec(any::<(u32, u64, u64, [u32; 4], f64)>(), 1..60),
        records in prop::collection::vec(any::<(u64, u32, u32, u32)>(), FAULTS),
    ) {
        let mut life = FaultLife::new(&shipped(), &tree()).unwrap();
        let mut left = Box::<Faults>::default();
        for (record, (number, source, what, state)) in left.records.iter_mut().zip(records) {
            (record.number, record.source) = (number, source % 5);
            (record.what, record.state) = (what, state % 7);
        }
        (left.revision, left.fault_count) = (u64::MAX, u64::MAX);
        life.restore(&left);
        prop_assert!(life.diagnosis(7).is_none_or(|told| told.set_count <= 1));
        for (reported, now_ns, leaves, words, p) in steps {
            let mut belief = belief(reported % 8);
            if reported % 3 == 0 {
                belief.reported = reported;
            }
            belief.sets[0].leaves = leaves;
            belief.p_unknown = p;
            let [action, kind, blind, silent_services] = words;
            let decided = CycleDecision { action, kind, blind: blind % 3 };
            belief.set_count = action;
            life.step(LifeInput {
                now_ns,
                observed: Some(&*belief).filter(|_| kind % 4 != 0),
                decided,
                silent_services,
            });
            life.obey(LifeOrder::Acknowledge(u64::from(blind % 4)), now_ns);
            while life.take_change().is_some() {}
        }
        let mut block = Box::<Faults>::default();
        life.write(&mut block, 0);
        prop_assert!(block.kept().count() <= FAULTS);
    }
}

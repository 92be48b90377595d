//! Alarms, the life of faults, and the action that stands.

use std::collections::BTreeMap;

use vigil_blocks::{
    Action, DetectionBelief, FaultRecord, FaultSource, FaultState, Faults, MODE_UNKNOWN,
    OverallState, RecoveryKind,
};
use vigil_pages::bands::{Bar, Row};
use vigil_pages::colour::Colour;
use vigil_setup::{Setup, fault_name};

use crate::spans::{Span, Spans};

/// An alarm that rose at most so long before a fault was seen is about it, s. Chosen: longer than
/// blocks of faults are apart and an identifier takes for a first doubt.
const ALARM_BEFORE_S: f64 = 1.0;

/// The life of one fault.
#[derive(Debug)]
pub(crate) struct FaultLife {
    pub(crate) name: String,
    pub(crate) colour: Colour,
    /// Which state it had when.
    pub(crate) states: Spans<FaultState>,
    pub(crate) source: u32,
    pub(crate) what: u32,
    /// Its highest probability.
    pub(crate) p: f64,
    /// Since when it was present when it first became active, s; below 0 before the recording.
    pub(crate) since_s: Option<f64>,
}

/// What was decided and told of faults.
#[derive(Debug, Default)]
pub(crate) struct Lives {
    detector_alarm: Spans<()>,
    standing_alarm: Spans<()>,
    faults: BTreeMap<(u32, u32), FaultLife>,
    /// Of each fault that is present, by its number: since when, s.
    began_s: BTreeMap<u64, f64>,
    action: Spans<(String, bool)>,
    overall: Option<OverallState>,
}

/// True while the fault is there.
pub(crate) const fn is_present(state: FaultState) -> bool {
    matches!(state, FaultState::Active | FaultState::Acknowledged)
}

/// Colour of a fault.
const fn colour(source: u32, what: u32) -> Colour {
    match FaultSource::from_repr(source) {
        Some(FaultSource::Robot) if what == MODE_UNKNOWN => Colour::Unknown,
        Some(FaultSource::Robot) => Colour::node(what as usize),
        _ => Colour::Soft,
    }
}

impl Lives {
    /// Takes a belief of the detector.
    pub(crate) fn take_detection(&mut self, t_s: f64, belief: &DetectionBelief) {
        self.detector_alarm
            .take(t_s, (belief.alarm == 1).then_some(()));
    }

    /// Takes an action of the graph's decision model.
    pub(crate) fn take_action(&mut self, t_s: f64, action: &Action, setup: &Setup) {
        self.standing_alarm
            .take(t_s, (action.alarm == 1).then_some(()));
        let name = setup.decision.actions().get(action.action as usize);
        let name = name.map_or("?", String::as_str);
        let name = match action.kind == RecoveryKind::None as u32 {
            true => "nothing decided: stop".to_owned(),
            false => setup.robot.action_text(name, action.answered()),
        };
        let is_plain = action.kind == RecoveryKind::GoOn as u32;
        self.action.take(t_s, Some((name, is_plain)));
    }

    /// Takes the faults.
    pub(crate) fn take_faults(&mut self, t_s: f64, faults: &Faults, setup: &Setup) {
        self.overall = OverallState::from_repr(faults.overall);
        for life in self.faults.values_mut() {
            let is_kept = |record: &FaultRecord| {
                (record.source, record.what) == (life.source, life.what)
                    && record.state() != Some(FaultState::Cleared)
            };
            if !faults.kept().any(is_kept) {
                life.states.take(t_s, None);
            }
        }
        self.follow_presence(t_s, faults);
        for record in faults.kept() {
            let Some(state) = record.state().filter(|it| *it != FaultState::Cleared) else {
                continue;
            };
            let (source, what) = (record.source, record.what);
            let life = self
                .faults
                .entry((source, what))
                .or_insert_with(|| FaultLife {
                    name: fault_name(&setup.tree, source, what).to_owned(),
                    colour: colour(source, what),
                    states: Spans::default(),
                    source,
                    what,
                    p: 0.0,
                    since_s: None,
                });
            life.states.take(t_s, Some(state));
            if record.p.is_finite() {
                life.p = life.p.max(record.p);
            }
            if is_present(state) && life.since_s.is_none() {
                life.since_s = Some(self.began_s.get(&record.number).copied().unwrap_or(t_s));
            }
        }
    }

    /// Follows since when each fault is present without a break, by its number: what was unknown
    /// and has a name since is the same fault.
    fn follow_presence(&mut self, t_s: f64, faults: &Faults) {
        let is_there = |record: &&FaultRecord| {
            let state = record.state();
            state.is_some_and(|state| state == FaultState::Pending || is_present(state))
        };
        self.began_s.retain(|number, _| {
            let mut there = faults.kept().filter(is_there);
            there.any(|record| record.number == *number)
        });
        // An alarm that rose just before is about it.
        let alarm = self.standing_alarm.all().last().map(|span| span.from_s);
        let alarm_s = alarm.filter(|from_s| t_s - from_s <= ALARM_BEFORE_S);
        for record in faults.kept().filter(is_there) {
            let is_of_robot = record.source == FaultSource::Robot as u32;
            // Told of before the recording began, or before this block. The only time of one that
            // was acknowledged may be long ago; of others, when it was is not known.
            let then_ns = match record.state() {
                Some(FaultState::Active) => record.changed_ns,
                Some(FaultState::Acknowledged) if record.count == 1 => record.first_ns,
                Some(FaultState::Acknowledged) => record.changed_ns,
                _ => 0,
            };
            let age_ns = faults.header.t_publish_ns.saturating_sub(then_ns);
            let seen_s = match then_ns {
                0 => t_s,
                _ => t_s - age_ns as f64 * 1e-9,
            };
            let began_s = alarm_s
                .filter(|_| is_of_robot)
                .unwrap_or(seen_s)
                .min(seen_s);
            self.began_s.entry(record.number).or_insert(began_s);
        }
    }

    /// All faults, those that were present first before others.
    pub(crate) fn faults(&self) -> Vec<&FaultLife> {
        let mut all: Vec<&FaultLife> = self.faults.values().collect();
        let begin = |life: &FaultLife| life.states.all().first().map_or(0.0, |span| span.from_s);
        all.sort_by(|a, b| begin(a).total_cmp(&begin(b)));
        all
    }

    /// From when to when an alarm stood, s: the supervisor's, or else the detector's.
    pub(crate) fn alarms(&self) -> Vec<[f64; 2]> {
        let spans = match self.action.all().is_empty() {
            true => self.detector_alarm.all(),
            false => self.standing_alarm.all(),
        };
        spans.iter().map(|span| [span.from_s, span.to_s]).collect()
    }

    /// The actions in their order, each with when it began, s.
    pub(crate) fn actions(&self) -> Vec<(&str, f64)> {
        let all = self.action.all().iter();
        all.map(|span| (span.value.0.as_str(), span.from_s))
            .collect()
    }

    /// The action at the end.
    pub(crate) fn last_action(&self) -> Option<&str> {
        self.action.last().map(|action| action.0.as_str())
    }

    /// The overall state at the end.
    pub(crate) const fn overall(&self) -> Option<OverallState> {
        self.overall
    }

    /// True if the supervisor told of faults at all.
    pub(crate) const fn is_told(&self) -> bool {
        self.overall.is_some()
    }

    /// A row for each kind of alarm, each fault, and the action.
    pub(crate) fn rows(&self) -> Vec<Row> {
        let alarm = |span: &Span<()>| Bar {
            span: [span.from_s, span.to_s],
            colour: Colour::Alarm,
            opacity: 0.5,
            text: "alarm".to_owned(),
        };
        let row = |name: &str, bars: Vec<Bar>| Row {
            name: name.to_owned(),
            bars,
            ticks: Vec::new(),
        };
        let bars = |spans: &Spans<()>| spans.all().iter().map(alarm).collect::<Vec<Bar>>();
        let mut rows = vec![row("alarm of the detector", bars(&self.detector_alarm))];
        rows.push(row("alarm of the supervisor", bars(&self.standing_alarm)));
        let faults = self.faults();
        rows.extend(faults.iter().map(|life| {
            let bars = life.states.all().iter().map(|span| life.bar(span));
            row(&format!("fault {}", life.name), bars.collect())
        }));
        if faults.is_empty() {
            rows.push(row("faults: none", Vec::new()));
        }
        let action = |span: &Span<(String, bool)>| Bar {
            span: [span.from_s, span.to_s],
            colour: if span.value.1 {
                Colour::Healthy
            } else {
                Colour::Ink
            },
            opacity: 0.22,
            text: span.value.0.clone(),
        };
        rows.push(row(
            "action that stands",
            self.action.all().iter().map(action).collect(),
        ));
        rows
    }

    /// How many spans are not drawn because a value flickered.
    pub(crate) fn left_out(&self) -> usize {
        let faults = self.faults.values().map(|life| life.states.left_out);
        let alarms = self.detector_alarm.left_out + self.standing_alarm.left_out;
        alarms + self.action.left_out + faults.sum::<usize>()
    }
}

impl FaultLife {
    fn bar(&self, span: &Span<FaultState>) -> Bar {
        let opacity = match span.value {
            FaultState::Pending | FaultState::Cleared => 0.12,
            FaultState::Active => 0.65,
            FaultState::Acknowledged => 0.45,
            FaultState::Latched => 0.25,
        };
        Bar {
            span: [span.from_s, span.to_s],
            colour: self.colour,
            opacity,
            text: span.value.name().to_owned(),
        }
    }

    /// True if it was present at any time of the recording.
    pub(crate) const fn was_present(&self) -> bool {
        self.since_s.is_some()
    }

    /// From when to when it was present, s.
    pub(crate) fn presence(&self) -> Vec<[f64; 2]> {
        let spans = self.states.all().iter();
        let present = spans.filter(|span| is_present(span.value));
        present.map(|span| [span.from_s, span.to_s]).collect()
    }
}

#[cfg(test)]
mod tests {
    use vigil_blocks::Header;

    use super::*;

    const NS: f64 = 1e9;
    /// When the recording began, by the graph's clock, s.
    const BEGAN_S: f64 = 5000.0;

    /// One fault at `t_s` of the recording, in this state since `since_s`.
    fn faults(t_s: f64, what: u32, state: FaultState, since_s: f64, count: u32) -> Faults {
        let at_ns = |t_s: f64| ((BEGAN_S + t_s) * NS) as u64;
        let mut faults = Faults {
            header: Header {
                t_publish_ns: at_ns(t_s),
                ..Header::default()
            },
            ..Faults::default()
        };
        faults.records[0] = FaultRecord {
            number: 1,
            source: FaultSource::Robot as u32,
            what,
            state: state as u32,
            first_ns: at_ns(since_s),
            changed_ns: at_ns(since_s),
            count,
            // Of a publisher with a clock of its own.
            frame_t_capture_ns: 7,
            ..FaultRecord::default()
        };
        faults
    }

    fn since_s(blocks: &[(f64, Faults)], alarm_s: Option<f64>) -> f64 {
        let mut lives = Lives::default();
        let setup = vigil_setup::load_graph(
            std::path::Path::new(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../config/rover.toml"
            )),
            |_| {},
        );
        let setup = setup.unwrap();
        for (t_s, faults) in blocks {
            let action = Action {
                alarm: u32::from(alarm_s.is_some_and(|alarm_s| *t_s >= alarm_s)),
                ..Action::default()
            };
            lives.take_action(*t_s, &action, &setup);
            lives.take_faults(*t_s, faults, &setup);
        }
        let told = lives.faults();
        told.iter()
            .filter_map(|life| life.since_s)
            .reduce(f64::min)
            .unwrap()
    }

    #[test]
    fn a_fault_began_when_it_was_seen_first_or_with_the_alarm_just_before() {
        use FaultState::{Active, Pending};
        let blocks = |from_s: f64| {
            let pending = faults(from_s, MODE_UNKNOWN, Pending, from_s, 0);
            let named = faults(from_s + 0.5, 1, Active, from_s + 0.5, 1);
            [(from_s, pending), (from_s + 0.5, named)]
        };
        assert_eq!(since_s(&blocks(10.0), None), 10.0);
        assert_eq!(since_s(&blocks(10.0), Some(10.0)), 10.0);
        // A pending one that was gone is another matter.
        let [first, _] = blocks(3.0);
        let [second, third] = blocks(40.0);
        let gone = (5.0, Faults::default());
        let all = [first, gone, second, third];
        assert_eq!(since_s(&all, None), 40.0);
    }

    #[test]
    fn one_that_was_told_before_the_recording_began_then() {
        use FaultState::{Acknowledged, Active};
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-3, "{found}");
        near(
            since_s(&[(0.0, faults(0.0, 1, Active, -30.0, 3))], None),
            -30.0,
        );
        near(
            since_s(&[(0.0, faults(0.0, 1, Acknowledged, -60.0, 1))], None),
            -60.0,
        );
    }
}

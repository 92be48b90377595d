//! All that is known of a graph, with names: for programs, and for those who draw it.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::OverallState;
use vigil_setup::Setup;
use vigil_timeline::{TimelineEntry, WallClock};

use super::belief::{Detector, Diagnosis};
use super::decision::Decision;
use super::input::Input;
use super::service::Service;
use super::state::GraphState;
use crate::faults::document::{self as faults, NamedFault, Now};
use crate::watch::{Percentiles, View};

/// Without a block for so long nothing is known.
const STALE_S: f64 = 1.0;
/// Newest events that are told.
const EVENTS: usize = 20;

/// How a graph is.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Name of the graph.
    pub graph: String,
    /// In one word.
    pub state: GraphState,
    /// What the supervisor says; `stale` while it says nothing.
    pub overall: &'static str,
    /// Why it is not known how the robot is; null while it is.
    pub unknown_because: Option<String>,
    /// Process id; null without one.
    pub launcher: Option<u32>,
    /// By the calendar: RFC 3339, UTC.
    pub wall: String,
    /// Since the graph's start.
    pub up_s: Option<f64>,
    /// Of the schedule.
    pub rate_hz: f64,
    /// Where the configuration was read from.
    pub config: String,
    /// Those that are kept; the newest change first.
    pub faults: Vec<NamedFault>,
    /// What is present beside them, and has no place.
    pub faults_dropped: u32,
    /// What the detector believes; null before it has said anything.
    pub detector: Option<Detector>,
    /// What the identifier believes.
    pub diagnosis: Option<Diagnosis>,
    /// What the supervisor does.
    pub decision: Option<Decision>,
    /// The services, in the order of the data.
    pub services: Vec<Service>,
    /// How long actions take; null before the second one.
    pub end_to_end: Option<Percentiles>,
    /// What of the frames can be used; null before the first one.
    pub input: Option<Input>,
    /// The newest events but missed cycles, which are counted in `services`; the newest last.
    pub events: Vec<TimelineEntry>,
}

impl Document {
    /// A view with the names that a configuration gives.
    pub fn new(view: &View, setup: &Setup, now: Now) -> Self {
        let now_ns = now.monotonic_ns;
        let age_s = |at_ns: u64| now_ns.saturating_sub(at_ns) as f64 * 1e-9;
        let fresh = view.faults.as_ref().filter(|block| {
            let is_of_tree = block.tree_hash == setup.tree.hash();
            is_of_tree && age_s(block.header.t_publish_ns) <= STALE_S
        });
        let overall = fresh.and_then(|block| OverallState::from_repr(block.overall));
        let faults = view.faults.as_ref().filter(|block| {
            // Names of another tree would be wrong.
            block.tree_hash == setup.tree.hash()
        });
        let faults = faults.map(|block| faults::Document::at(block, setup, now));
        let silent_s = STALE_S.max(3.0 / setup.file.graph.rate_hz);
        let detector = view
            .detection
            .as_ref()
            .map(|block| Detector::new(block, now, silent_s));
        let state = match view.has_ended {
            true => GraphState::Ended,
            false => GraphState::new(overall, view.launcher.is_some()),
        };
        let blind = detector.as_ref().and_then(|it| it.blind);
        let unknown_because = match (view.has_ended, overall, blind) {
            (true, ..) => Some("the graph runs no longer".to_owned()),
            (_, Some(OverallState::Stale), Some(cause)) => Some(format!("BLIND: {cause}")),
            (_, Some(OverallState::Stale), None) => Some("nothing is seen".to_owned()),
            (_, None, _) => Some(silence(view, age_s)),
            _ => None,
        };
        let from = view.events.len().saturating_sub(EVENTS);
        Self {
            schema_version: 1,
            graph: setup.file.graph.name.clone(),
            state,
            overall: overall.unwrap_or(OverallState::Stale).name(),
            unknown_because,
            launcher: view.launcher,
            wall: WallClock::now().rfc3339(now_ns),
            up_s: view.up_s.map(f64::round),
            rate_hz: setup.file.graph.rate_hz,
            config: setup.path.display().to_string(),
            faults_dropped: faults.as_ref().map_or(0, |it| it.dropped),
            faults: faults.map(|it| it.faults).unwrap_or_default(),
            detector,
            diagnosis: view
                .diagnosis
                .as_ref()
                .filter(|block| block.tree_hash == setup.tree.hash())
                .map(|block| Diagnosis::new(block, &setup.tree)),
            decision: view
                .action
                .as_ref()
                .map(|block| Decision::new(block, setup, now_ns)),
            services: Service::all(view, now_ns),
            end_to_end: view.end_to_end.percentiles(now_ns),
            input: view
                .frame
                .as_ref()
                .map(|frame| Input::new(frame, &setup.robot, view)),
            events: view.events[from..].to_vec(),
        }
    }

    /// True if what is told is of the past: the graph has ended, or nobody says anything.
    pub fn is_past(&self) -> bool {
        let silent = self.services.iter().all(|service| !service.is_well());
        self.state == GraphState::Ended || self.state == GraphState::Stale && silent
    }

    /// Actions a second, at present.
    pub fn present_rate_hz(&self) -> f64 {
        let times = self.end_to_end.as_ref();
        let times = times.filter(|times| !times.have_ended());
        times.map_or(0.0, |times| times.rate_hz)
    }

    /// The state in words, and that nobody looks after the graph.
    pub fn state_text(&self) -> String {
        let is_said = [GraphState::Unsupervised, GraphState::Ended].contains(&self.state);
        match self.launcher.is_none() && !is_said {
            true => format!("{}, UNSUPERVISED", self.state.word()),
            false => self.state.word().to_owned(),
        }
    }

    /// Faults as people look after them: those that are present first, what is over last.
    pub fn faults_in_order(&self) -> Vec<&NamedFault> {
        let rank = |fault: &&NamedFault| match fault.state {
            "active" => 0,
            "acknowledged" => 1,
            "latched" => 2,
            "pending" => 3,
            _ => 4,
        };
        let mut faults: Vec<&NamedFault> = self.faults.iter().collect();
        faults.sort_by_key(rank);
        faults
    }
}

/// That the supervisor is silent, and for how long.
fn silence(view: &View, age_s: impl Fn(u64) -> f64) -> String {
    let action = view.action.as_ref().map(|block| block.header.t_publish_ns);
    let faults = view.faults.as_ref().map(|block| block.header.t_publish_ns);
    // What was kept in the file was never sent.
    let heard = action.max(faults).filter(|at_ns| *at_ns > 0);
    let who = match view.newest_ns() {
        Some(newest_ns) if age_s(newest_ns) <= STALE_S => "the supervisor has",
        _ => "all services have",
    };
    heard.map_or_else(
        || "the supervisor says nothing".to_owned(),
        |at_ns| format!("{who} been silent for {:.1} s", age_s(at_ns)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::sample::{self, NOW, setup};

    #[test]
    fn state_is_of_the_faults_unless_nobody_says_them_or_nobody_looks_after_the_graph() {
        let setup = setup();
        let of = |view: &View| {
            let document = Document::new(view, &setup, NOW);
            (document.state, document.state_text(), document.is_past())
        };
        let mut view = sample::healthy(&setup);
        assert_eq!(of(&view), (GraphState::Ok, "OK".to_owned(), false));
        view.launcher = None;
        let unsupervised = "UNSUPERVISED".to_owned();
        assert_eq!(of(&view), (GraphState::Unsupervised, unsupervised, false));
        let mut faulty = sample::faulty(&setup);
        assert_eq!(of(&faulty), (GraphState::Fault, "FAULT".to_owned(), false));
        faulty.launcher = None;
        assert_eq!(of(&faulty).1, "FAULT, UNSUPERVISED");
        let silent = sample::silent(&setup);
        let stale = "STALE, UNSUPERVISED".to_owned();
        assert_eq!(of(&silent), (GraphState::Stale, stale, true));
        faulty.has_ended = true;
        assert_eq!(of(&faulty), (GraphState::Ended, "ENDED".to_owned(), true));
    }

    #[test]
    fn a_supervisor_alone_that_is_silent_is_told_and_the_rest_is_of_the_present() {
        let setup = setup();
        let mut view = sample::healthy(&setup);
        let silent = sample::silent(&setup);
        (view.faults, view.action) = (silent.faults, silent.action);
        let document = Document::new(&view, &setup, NOW);
        assert_eq!(document.state, GraphState::Stale);
        assert!(!document.is_past());
        let because = document.unknown_because.unwrap();
        assert_eq!(because, "the supervisor has been silent for 5.0 s");
        // Of another tree, names would be wrong.
        let mut view = sample::faulty(&setup);
        view.faults.as_mut().unwrap().tree_hash = 1;
        let document = Document::new(&view, &setup, NOW);
        assert_eq!(
            (document.state, document.faults),
            (GraphState::Stale, vec![])
        );
    }

    #[test]
    fn a_frame_without_a_channel_and_refused_frames_are_told_by_cause() {
        let setup = setup();
        let mut view = sample::healthy(&setup);
        let frame = view.frame.as_mut().unwrap();
        frame.channel_valid &= !1;
        let sensor = view.health[0].as_mut().unwrap();
        sensor.rejected[vigil_blocks::Rejection::Corrupt as usize] = 3;
        let input = Document::new(&view, &setup, NOW).input.unwrap();
        assert_eq!(
            input.text(),
            "12 of 13 channels valid; MISSING x; REJECTED 3 corrupt"
        );
        assert!(input.is_wrong());
    }

    #[test]
    fn a_program_finds_each_part_under_its_name() {
        let setup = setup();
        let document = Document::new(&sample::faulty(&setup), &setup, NOW);
        let json = serde_json::to_value(&document).unwrap();
        assert_eq!(json["schema_version"], 1);
        assert_eq!(json["state"], "fault");
        assert_eq!(json["faults"][0]["name"], "RM_STUCK");
        assert_eq!(json["diagnosis"]["nodes"][0]["p"], 0.998);
        assert_eq!(json["decision"]["weighing"]["second"]["action"], "go_on");
        assert_eq!(json["services"][2]["health"]["missed"], 1);
        assert_eq!(json["end_to_end"]["rate_hz"], 100.0);
        assert_eq!(json["input"]["valid"], 13);
        assert_eq!(json["events"][1]["event"], "alarm");
    }
}

//! A recording, read to its end, and the page of it.

use std::path::Path as FilePath;

use vigil_blocks::{
    Action, DetectionBelief, FaultBelief, FaultSource, Faults, Health, MODE_UNKNOWN, SensorFrame,
};
use vigil_cycle::topic::Topic;
use vigil_flight::{FlightError, FlightReader, Recorded, read_block, read_header};
use vigil_pages::bands::{Bands, Row};
use vigil_pages::chart::Axis;
use vigil_pages::page::{Section, page as html, remark, table, titled};
use vigil_robot::channel::hash;
use vigil_setup::Setup;
use vigil_timeline::WallClock;

use crate::belief::{Beliefs, WIDTH};
use crate::events::{Events, time_of_day};
use crate::gaps::Gaps;
use crate::health::Healths;
use crate::latency::Latencies;
use crate::lives::{FaultLife, Lives};
use crate::measured::Measured;
use crate::path::Path;
use crate::verdict::{FaultFinding, FaultKind, FileEnd, Findings};

/// How long before a fault became active an action counts as done about it, s.
const ANSWER_S: f64 = 0.5;

/// What is kept of a recording.
struct Recording {
    setup: Setup,
    robot_hash: u64,
    /// When the first block or event was, since 1970, ns.
    origin_ns: Option<u64>,
    end_s: f64,
    frames: u64,
    /// Blocks about other models than the document's, or of another version.
    strange: u64,
    beliefs: Beliefs,
    lives: Lives,
    events: Events,
    measured: Measured,
    path: Path,
    latencies: Latencies,
    healths: Healths,
    gaps: Gaps,
}

/// How reading ended.
struct Ending {
    end: FileEnd,
    /// What is wrong with the file.
    damage: Option<String>,
}

/// Makes the page of a recording.
///
/// # Errors
/// A file that is no recording, or without what its graph ran on. A file that is cut short or
/// damaged has a page of what comes before.
pub fn page(path: &FilePath) -> Result<String, FlightError> {
    let mut reader = FlightReader::open(path)?;
    let mut recording = Recording::new(reader.setup()?);
    let ending = recording.read(&mut reader)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let facts = recording.facts(&name, &reader, &ending);
    let verdict = recording.findings(ending.end).verdict();
    Ok(html(
        &format!("Vigil: {name}"),
        &verdict,
        &recording.sections(&facts),
    ))
}

impl Recording {
    fn new(setup: Setup) -> Self {
        Self {
            robot_hash: hash(&setup.robot),
            path: Path::new(&setup.robot),
            measured: Measured::new(&setup.robot),
            setup,
            origin_ns: None,
            end_s: 0.0,
            frames: 0,
            strange: 0,
            beliefs: Beliefs::default(),
            lives: Lives::default(),
            events: Events::default(),
            latencies: Latencies::default(),
            healths: Healths::default(),
            gaps: Gaps::default(),
        }
    }

    /// Takes all that can be read.
    fn read(&mut self, reader: &mut FlightReader) -> Result<Ending, FlightError> {
        let damage = loop {
            match reader.next() {
                Ok(None) => break None,
                Ok(Some(Recorded::Event { log_time_ns, entry })) => {
                    let t_s = self.since_origin(log_time_ns);
                    let clock = WallClock::ahead_by(i128::from(log_time_ns)).rfc3339(0);
                    self.events.take(t_s, &clock, &entry);
                }
                Ok(Some(Recorded::Block {
                    topic,
                    log_time_ns,
                    bytes,
                })) => {
                    let t_s = self.since_origin(log_time_ns);
                    self.strange += u64::from(self.take(t_s.max(0.0), topic, bytes).is_none());
                }
                Err(error @ FlightError::Damaged { .. }) => break Some(error.to_string()),
                Err(error) => return Err(error),
            }
        };
        Ok(Ending {
            end: match damage {
                Some(_) => FileEnd::Damaged,
                None if reader.is_cut() => FileEnd::Cut,
                None => FileEnd::Whole,
            },
            damage,
        })
    }

    /// Seconds since the first block or event of the file; events may be from before that.
    fn since_origin(&mut self, log_time_ns: u64) -> f64 {
        let origin_ns = *self.origin_ns.get_or_insert(log_time_ns);
        let since_ns = i128::from(log_time_ns) - i128::from(origin_ns);
        let t_s = since_ns as f64 * 1e-9;
        self.end_s = self.end_s.max(t_s);
        t_s
    }

    /// Takes a block; `None` if it says nothing that can be named.
    fn take(&mut self, t_s: f64, topic: Topic, bytes: &[u8]) -> Option<()> {
        let setup = &self.setup;
        self.gaps.take(t_s, topic, &read_header(bytes)?);
        match topic {
            Topic::Sensor => {
                let frame: SensorFrame = read_block(bytes)?;
                self.frames += 1;
                let is_ours = frame.robot_hash == self.robot_hash;
                is_ours.then(|| {
                    self.path.take(t_s, &frame);
                    self.measured.take(t_s, &frame);
                })?;
            }
            Topic::Detection => {
                let belief: DetectionBelief = read_block(bytes)?;
                self.beliefs.take_detection(t_s, &belief);
                self.lives.take_detection(t_s, &belief);
            }
            Topic::Diagnosis => {
                let belief: FaultBelief = read_block(bytes)?;
                let is_ours = belief.tree_hash == setup.tree.hash();
                is_ours.then(|| self.beliefs.take(t_s, &belief, &setup.tree))?;
            }
            Topic::Action => {
                let action: Action = read_block(bytes)?;
                self.latencies.take(t_s, &action);
                let is_ours = action.model_hash == setup.decision.hash();
                is_ours.then(|| self.lives.take_action(t_s, &action, setup))?;
            }
            Topic::Faults => {
                let faults: Faults = read_block(bytes)?;
                let is_ours = faults.tree_hash == setup.tree.hash();
                is_ours.then(|| self.lives.take_faults(t_s, &faults, setup))?;
            }
            Topic::Health(service) => {
                let health: Health = read_block(bytes)?;
                self.healths.take(t_s, service, &health);
            }
            Topic::DetectionParticles
            | Topic::DiagnosisParticles
            | Topic::Truth
            | Topic::Control(_)
            | Topic::Journal(_)
            | Topic::Checkpoint(_) => {}
        }
        Some(())
    }

    /// An instant by the calendar.
    fn clock(&self, t_s: f64) -> String {
        let origin_ns = i128::from(self.origin_ns.unwrap_or_default());
        WallClock::ahead_by(origin_ns).rfc3339((t_s.max(0.0) * 1e9) as u64)
    }

    fn findings(&self, end: FileEnd) -> Findings {
        let lives = self.lives.faults();
        let present = lives.iter().filter(|life| life.was_present());
        let faults: Vec<FaultFinding> = present.map(|life| self.finding(life)).collect();
        let first_s = faults.iter().map(|fault| fault.since_s).reduce(f64::min);
        let is_answer = |since_s: f64| first_s.is_some_and(|first_s| since_s >= first_s - ANSWER_S);
        let actions = self.lives.actions().into_iter();
        Findings {
            duration_s: self.end_s,
            is_diagnosed: self.beliefs.is_there() || self.lives.is_told(),
            faults,
            alarms_s: self
                .lives
                .alarms()
                .iter()
                .map(|[from_s, _]| *from_s)
                .collect(),
            actions: actions
                .filter(|(_, since_s)| is_answer(*since_s))
                .map(|(name, since_s)| (name.to_owned(), since_s))
                .collect(),
            last_action: self.lives.last_action().map(str::to_owned),
            overall: self.lives.overall(),
            end,
        }
    }

    fn finding(&self, life: &FaultLife) -> FaultFinding {
        let since_s = life.since_s.unwrap_or_default();
        let presence = life.presence();
        let is_present = life
            .states
            .last()
            .is_some_and(|it| crate::lives::is_present(*it));
        let until_s = presence.last().map(|[_, to_s]| *to_s);
        FaultFinding {
            kind: match FaultSource::from_repr(life.source) {
                Some(FaultSource::Robot) if life.what == MODE_UNKNOWN => FaultKind::Unknown,
                Some(FaultSource::Input) => FaultKind::Input,
                Some(FaultSource::Service) => FaultKind::Service,
                _ => FaultKind::Part,
            },
            name: life.name.clone(),
            since_s,
            clock: time_of_day(&self.clock(since_s))
                .get(..8)
                .unwrap_or("?")
                .to_owned(),
            until_s: until_s.filter(|_| !is_present),
            p: life.p,
            state: life.states.last().copied(),
        }
    }

    /// What was recorded, name and value.
    fn facts(&self, name: &str, reader: &FlightReader, ending: &Ending) -> Vec<Vec<String>> {
        let file = &self.setup.file;
        let about = |key: &str| reader.about().get(key).cloned();
        let rate = match self.end_s > 0.0 {
            true => format!(
                "{} Hz configured, {:.1} Hz recorded",
                file.graph.rate_hz,
                self.frames.saturating_sub(1) as f64 / self.end_s
            ),
            false => format!("{} Hz configured", file.graph.rate_hz),
        };
        let began = match self.origin_ns {
            Some(_) => self.clock(0.0).replace('T', " ").replace('Z', " UTC"),
            None => "nothing was recorded".to_owned(),
        };
        let count = |count: u64| (count > 0).then(|| count.to_string());
        let is_counted = |text: &String| text != "0";
        let all = [
            ("file", Some(name.to_owned())),
            ("graph", Some(file.graph.name.clone())),
            ("robot", Some(self.setup.robot.name.clone())),
            ("began", Some(began)),
            ("duration", Some(format!("{:.1} s", self.end_s))),
            ("rate", Some(rate)),
            ("frames", Some(self.frames.to_string())),
            ("why it was recorded", about("reason")),
            ("in words", about("what")),
            ("when that was", about("when")),
            (
                "all causes",
                about("causes")
                    .filter(|causes| causes.contains('\n'))
                    .map(|causes| causes.replace('\n', "; ")),
            ),
            (
                "blocks lost before recording",
                about("lost").filter(is_counted),
            ),
            ("gaps of the black box", about("gaps").filter(is_counted)),
            (
                "of another version, not shown",
                count(reader.foreign_count()),
            ),
            ("about other models, not shown", count(self.strange)),
            ("the file", ending.damage.clone()),
            ("configuration", Some(format!("{:016x}", self.setup.hash))),
        ];
        let row = |(name, value): (&str, Option<String>)| Some(vec![name.to_owned(), value?]);
        all.into_iter().filter_map(row).collect()
    }

    fn sections(&self, facts: &[Vec<String>]) -> Vec<Section> {
        let time = Axis::linear("time since the beginning, s", self.end_s, 10.0);
        let (faults, alarms) = (self.lives.faults(), self.lives.alarms());
        let section = |id, heading, about: &str, inside| Section {
            id,
            heading,
            about: about.to_owned(),
            inside,
        };
        let latency = self.latencies.charts(&time, self.healths.deadline_ns());
        vec![
            section("facts", "What was recorded", "", table(&["", ""], facts)),
            section(
                "timeline",
                "Timeline",
                TIMELINE,
                self.timeline(&time, &alarms),
            ),
            section(
                "measured",
                "Commands and measurements",
                MEASURED,
                self.measured.charts(&time),
            ),
            section("events", "Events", EVENTS, self.events.table()),
            section("path", "Path", PATH, self.path.chart(&faults, &alarms)),
            section(
                "latency",
                "Latency",
                LATENCY,
                latency + &self.healths.charts(&time),
            ),
            section(
                "health",
                "Health of the services",
                HEALTH,
                self.healths.tables(),
            ),
            section("gaps", "Missing blocks", GAPS, self.gaps.tables()),
        ]
    }

    fn timeline(&self, time: &Axis, alarms: &[[f64; 2]]) -> String {
        let mut rows: Vec<Row> = self.lives.rows();
        rows.push(self.events.row());
        let caption = "Alarms, faults, the action that stands, and events";
        let bands = Bands {
            caption: caption.to_owned(),
            width: WIDTH,
            x: time.clone(),
            rows,
        };
        let mut inside = self.beliefs.charts(&self.setup.tree, time, alarms);
        inside.push_str(&titled(caption, "", &bands.svg()));
        let left_out = self.lives.left_out();
        if left_out > 0 {
            inside.push_str(&remark(&format!(
                "{left_out} further changes are not drawn."
            )));
        }
        inside
    }
}

const TIMELINE: &str = "All charts have the same axis of time. A fault has one colour everywhere, \
                        in every page. It is drawn if it was ever more probable than 0.05.";
const MEASURED: &str =
    "What the robot was told to do, and what its sensors said, as the graph took it.";
const EVENTS: &str = "What the services told, in the order of time. Missed cycles are ticks in the \
                      timeline, and are counted with the health of the services.";
const PATH: &str = "The measured pose in the plane; both axes have the same scale. Arrows show the \
                    direction, dots the start, the end and each alarm.";
const LATENCY: &str = "From the instant at which a cycle was due to the publication of its action; \
                       over time, each column shows the actions of that time, and one late action \
                       alone is seen. Then what each service needs for a cycle, as its health says \
                       20 times a second.";
const HEALTH: &str = "Counted within the recording; the longest cycle is that since the service's \
                      start.";
const GAPS: &str = "Of each topic, by the sequence numbers of its writer. Of particles only some \
                    are recorded.";

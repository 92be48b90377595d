//! One mission in a corridor, driven by Vigil as it ships: four processes, in real time.

use std::error::Error;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use toml::Table;
use vigil_blocks::{BlockId, RecoveryKind, SensorFrame, Truth};
use vigil_cycle::port::Link;
use vigil_cycle::{Graph, Receiver, Topic, signal};
use vigil_setup::Setup;

use super::drive::setup_of;
use super::plan::CorridorPlan;
use super::score::{CorridorScore, Step, Tally, pose_error};
use super::{CorridorGraph, LIMIT_S};
use crate::missions::{PresentFault, RuleOutput};
use crate::{find_models, in_folder, program};

/// Interval at which blocks are taken: an eighth of a queue of 100 Hz.
const POLL: Duration = Duration::from_millis(20);
/// A graph that says nothing for so long has failed.
const SILENCE: Duration = Duration::from_secs(60);

/// A mission of the live graph, measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LiveMission {
    /// What it brought.
    pub score: CorridorScore,
    /// Cycles that it took.
    pub cycles: u64,
    /// Cycles that a service missed, by its own fault or that of one before it.
    pub missed: u64,
}

/// Drives a mission with a graph of its own, whose simulator says what is true.
///
/// # Errors
/// A graph that cannot be started, falls silent, or ends by itself.
pub fn drive_live(
    graph: &CorridorGraph,
    plan: &CorridorPlan,
) -> Result<LiveMission, Box<dyn Error>> {
    let mut setup = setup_of(graph, plan);
    setup.file.graph.name = format!("live-{}-{}", std::process::id(), plan.seed);
    let name = setup.file.graph.name.clone();
    in_folder(&name, |folder| {
        let mut running = RunningGraph::start(&setup, plan, folder)?;
        let watched = watch(graph, plan, &setup, &mut running);
        let missed = running.stop();
        let (score, cycles) = watched?;
        Ok(LiveMission {
            score,
            cycles,
            missed: missed?,
        })
    })
}

/// Takes the mission's blocks until it ends.
fn watch(
    graph: &CorridorGraph,
    plan: &CorridorPlan,
    setup: &Setup,
    running: &mut RunningGraph,
) -> Result<(CorridorScore, u64), Box<dyn Error>> {
    let link = running.join(setup)?;
    let mut view = View::new(&link)?;
    let mut judge = Judge::new(graph, plan);
    let mut heard = Instant::now();
    loop {
        while let Some((frame, truth)) = view.take() {
            heard = Instant::now();
            if judge.take(frame, truth) {
                return Ok((judge.tally.score, judge.cycles));
            }
        }
        running.demand_alive()?;
        if heard.elapsed() > SILENCE {
            return Err(format!("mission {}: no truth for {SILENCE:?}", plan.seed).into());
        }
        std::thread::sleep(POLL);
    }
}

/// A launched graph; stopped when dropped.
struct RunningGraph {
    launcher: Child,
    printed: PathBuf,
    errors: PathBuf,
}

impl RunningGraph {
    fn start(setup: &Setup, plan: &CorridorPlan, folder: &Path) -> Result<Self, Box<dyn Error>> {
        let [config, printed, errors] =
            ["graph.toml", "printed.json", "errors.txt"].map(|name| folder.join(name));
        let mut file = Table::try_from(&setup.file)?;
        find_models(&mut file)?;
        fs::write(&config, file.to_string())?;
        let mut command = Command::new(program("vigil-launcher")?);
        command.arg("--config").arg(&config);
        command.args(["--json", "--no-blackbox"]);
        if let Some(fault) = &plan.hardware {
            let injection = format!("{}@{}", fault.change, fault.at_s);
            command.args(["--inject", &injection]);
        }
        let launcher = command
            .stdin(Stdio::null())
            .stdout(File::create(&printed)?)
            .stderr(File::create(&errors)?)
            .spawn()?;
        Ok(Self {
            launcher,
            printed,
            errors,
        })
    }

    /// An observer's link, once the services have been started.
    fn join(&mut self, setup: &Setup) -> Result<Graph, Box<dyn Error>> {
        let (domain, began) = (setup.domain()?, Instant::now());
        while !domain.processes_file().exists() {
            self.demand_alive()?;
            if began.elapsed() > SILENCE {
                return Err(format!("no graph after {SILENCE:?}").into());
            }
            std::thread::sleep(POLL);
        }
        Ok(Graph::SharedMemory(Link::join(&domain, "bench")?))
    }

    fn demand_alive(&mut self) -> Result<(), Box<dyn Error>> {
        match self.launcher.try_wait()? {
            None => Ok(()),
            Some(status) => {
                let errors = fs::read_to_string(&self.errors).unwrap_or_default();
                Err(format!("the graph ended with {status}\n{errors}").into())
            }
        }
    }

    /// Stops it; the cycles that its services have missed.
    fn stop(&mut self) -> Result<u64, Box<dyn Error>> {
        signal::terminate(self.launcher.id());
        self.launcher.wait()?;
        let summary: Value = serde_json::from_reader(File::open(&self.printed)?)?;
        let services = summary["services"].as_object().into_iter().flatten();
        Ok(services.filter_map(|(_, it)| it["missed"].as_u64()).sum())
    }
}

impl Drop for RunningGraph {
    fn drop(&mut self) {
        // An error of the view leaves it running.
        if matches!(self.launcher.try_wait(), Ok(None)) {
            signal::terminate(self.launcher.id());
            let _ = self.launcher.wait();
        }
    }
}

/// Frames with what was true when they were measured.
struct View {
    frames: Box<dyn Receiver<SensorFrame>>,
    truths: Box<dyn Receiver<Truth>>,
    frame: Box<SensorFrame>,
}

impl View {
    fn new(graph: &Graph) -> Result<Self, Box<dyn Error>> {
        Ok(Self {
            frames: graph.receiver(Topic::Sensor)?,
            truths: graph.receiver(Topic::Truth)?,
            frame: Box::default(),
        })
    }

    /// The next truth whose frame is there too.
    fn take(&mut self) -> Option<(&SensorFrame, &Truth)> {
        loop {
            let wanted = self.truths.take_next()?.cause.frame();
            if self.find(wanted) {
                return self.truths.held().map(|truth| (&*self.frame, truth));
            }
        }
    }

    /// Takes frames until this one, which was sent before its truth.
    fn find(&mut self, wanted: BlockId) -> bool {
        let precedes = |frame: &SensorFrame| {
            frame.header.epoch != wanted.epoch || frame.header.seq < wanted.seq
        };
        while precedes(&self.frame) {
            match self.frames.take_next() {
                Some(frame) => *self.frame = *frame,
                None => return false,
            }
        }
        self.frame.header.id() == wanted
    }
}

/// Adds up what a mission brings.
struct Judge<'a> {
    graph: &'a CorridorGraph,
    plan: &'a CorridorPlan,
    limit_ns: u64,
    fault: Vec<PresentFault>,
    /// Time and pose of the truth before; `None` until the first action is obeyed.
    before: Option<(u64, [f64; 3])>,
    began_ns: u64,
    tally: Tally,
    cycles: u64,
}

impl<'a> Judge<'a> {
    fn new(graph: &'a CorridorGraph, plan: &'a CorridorPlan) -> Self {
        let fault = plan.hardware.iter().map(|it| PresentFault {
            cause: it.cause,
            severity: 1.0,
        });
        Self {
            graph,
            plan,
            limit_ns: (LIMIT_S * 1e9) as u64,
            fault: fault.collect(),
            before: None,
            began_ns: 0,
            tally: Tally::default(),
            cycles: 0,
        }
    }

    /// True if the mission has ended.
    fn take(&mut self, frame: &SensorFrame, truth: &Truth) -> bool {
        let now_ns = truth.header.t_capture_ns;
        if self.before.is_none() && truth.obeyed == RecoveryKind::None as u32 {
            self.began_ns = now_ns;
            return false;
        }
        let (before_ns, before) = self.before.unwrap_or((self.began_ns, truth.pose));
        self.before = Some((now_ns, truth.pose));
        let [x, y, _] = truth.pose;
        let obeyed = RuleOutput {
            kind: RecoveryKind::from_repr(truth.obeyed).unwrap_or(RecoveryKind::None),
            wheels: truth.answered(),
        };
        let faults = match truth.is_disturbed {
            0 => &[],
            _ => self.fault.as_slice(),
        };
        self.cycles += 1;
        self.tally.add(
            &self.graph.file.prices,
            &self.graph.faults,
            &Step {
                faults,
                obeyed,
                moved_m: (x - before[0]).hypot(y - before[1]),
                pose_error: pose_error(frame, truth.pose),
                touches: truth.touches != 0,
                planned_m_s: self.plan.navigation.speed_m_s,
                dt_s: now_ns.saturating_sub(before_ns) as f64 * 1e-9,
            },
        );
        if truth.at_goal != 0 {
            let off_goal_m = self.plan.off_goal_m(truth.pose);
            self.tally.arrive(&self.graph.file.prices, off_goal_m);
        }
        truth.at_goal != 0
            || obeyed.kind == RecoveryKind::GiveUp
            || now_ns.saturating_sub(self.began_ns) >= self.limit_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::Cause;
    use crate::variation::Variation;

    #[test]
    fn a_mission_is_judged_from_the_first_order_to_the_goal() {
        let graph = CorridorGraph::read(Variation::default(), None).unwrap();
        let mut plans = (0..).map(|seed| graph.plan(seed));
        let is_stuck = |plan: &CorridorPlan| {
            let cause = plan.hardware.as_ref().map(|it| it.cause);
            matches!(cause, Some(Cause::Stuck(_)))
        };
        let plan = plans.find(is_stuck).unwrap();
        let goal = *plan.navigation.path.last().unwrap();
        let mut judge = Judge::new(&graph, &plan);
        let mut k = 0;
        let mut pass = |cycles: u64, change: &dyn Fn(&mut Truth)| {
            let mut has_ended = false;
            for _ in 0..cycles {
                k += 1;
                let mut truth = Truth {
                    pose: [goal[0], goal[1], 0.0],
                    obeyed: RecoveryKind::GoOn as u32,
                    ..Truth::default()
                };
                truth.header.t_capture_ns = k * 10_000_000;
                change(&mut truth);
                let mut frame = SensorFrame::default();
                frame.channel[..3].copy_from_slice(&truth.pose);
                has_ended = judge.take(&frame, &truth);
            }
            has_ended
        };
        // It waits a second for its services: no part of the mission.
        assert!(!pass(100, &|truth| truth.obeyed = RecoveryKind::None as u32));
        assert!(!pass(100, &|_| ()));
        assert!(!pass(100, &|truth| truth.is_disturbed = 1));
        let calls = |truth: &mut Truth| truth.obeyed = RecoveryKind::CallForHelp as u32;
        assert!(!pass(100, &calls));
        assert!(pass(1, &|truth| truth.at_goal = 1));
        let score = judge.tally.score;
        assert_eq!((judge.cycles, score.done, score.calls), (301, 1.0, 1.0));
        assert!((score.time_s - 3.01).abs() < 1e-9, "{}", score.time_s);
        // Nothing was driven: time, one call, and the goal.
        let prices = &graph.file.prices;
        let points = prices.goal - prices.call - 3.01 * prices.time_1_s;
        assert!((score.points - points).abs() < 1e-9, "{}", score.points);
    }

    #[test]
    fn a_mission_ends_when_it_is_given_up_and_at_the_limit() {
        let graph = CorridorGraph::read(Variation::default(), None).unwrap();
        let plan = graph.plan(1);
        let frame = SensorFrame::default();
        let truth = |obeyed: RecoveryKind, t_s: f64| {
            let mut truth = Truth {
                obeyed: obeyed as u32,
                ..Truth::default()
            };
            truth.header.t_capture_ns = (t_s * 1e9) as u64;
            truth
        };
        let mut judge = Judge::new(&graph, &plan);
        assert!(!judge.take(&frame, &truth(RecoveryKind::None, 1.0)));
        assert!(!judge.take(&frame, &truth(RecoveryKind::GoOn, LIMIT_S)));
        assert!(judge.take(&frame, &truth(RecoveryKind::GoOn, LIMIT_S + 1.0)));
        let mut judge = Judge::new(&graph, &plan);
        assert!(judge.take(&frame, &truth(RecoveryKind::GiveUp, 1.0)));
    }
}

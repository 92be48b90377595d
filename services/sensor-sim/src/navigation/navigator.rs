//! From requested actions to commands.

use vigil_blocks::{ActionOutcome, RecoveryKind, SensorFrame};
use vigil_robot::ChannelMap;
use vigil_setup::graph_file::Navigation;

use super::faults::NavigationFaults;
use super::lane::Lane;
use super::map::Map;
use super::path::Path;
use super::task::{Task, symptoms_of};
use crate::drive::DriveCommand;

/// An action of the supervisor, as the navigation needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActionRequest {
    /// What the robot is to do.
    pub kind: RecoveryKind,
    /// The decision behind it; another one restarts the task.
    pub decision: DecisionId,
    /// Factor on the speed, 0..1.
    pub speed_scale: f64,
}

/// A decision of one start of the supervisor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DecisionId {
    /// Epoch of the supervisor; 0 for no decision.
    pub epoch: u64,
    /// Number of the decision in that epoch.
    pub seq: u64,
}

/// A person has come: every fault ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Help {
    /// Where the robot is set, x m, y m, yaw rad; `None` if it stays where it is.
    pub place: Option<[f64; 3]>,
}

/// What becomes an event in the timeline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NavigatorEvent {
    /// An action is done, or has failed.
    Ended(RecoveryKind, ActionOutcome),
    /// The robot is at its goal.
    Goal,
}

/// The robot's navigation, and the world around it.
#[derive(Debug, Clone)]
pub struct Navigator {
    channels: ChannelMap,
    pub(super) settings: Navigation,
    pub(super) map: Map,
    pub(super) faults: NavigationFaults,
    pub(super) path: Path,
    pub(super) alternative: Option<Path>,
    pub(super) lane: Lane,
    /// Pose as measured: what the robot knows.
    pub(super) pose: [f64; 3],
    /// Distance along the path, m.
    pub(super) along_m: f64,
    /// Steering of the last command, 1/m.
    pub(super) curvature_1_m: f64,
    /// Where the plan is, m along the path.
    pub(super) planned_m: f64,
    /// Distance along the path of what blocked it last, m.
    pub(super) block_m: Option<f64>,
    /// How long the way has been free since, s.
    pub(super) free_s: f64,
    pub(super) task: Task,
    kind: RecoveryKind,
    decision: DecisionId,
    outcome: ActionOutcome,
    symptoms: u32,
    resets: u32,
    pub(super) t_s: f64,
    pub(super) took_alternative: bool,
    /// Something is within the bumper's reach.
    pub(super) touched: bool,
    pub(super) at_goal: bool,
    /// Help that has come and was not reported yet.
    help: Option<Help>,
    /// The robot's pose was corrected and this was not reported yet.
    was_relocalised: bool,
    /// With the next pose the plan restarts where the robot is.
    pub(super) restarts: bool,
    pub(super) event: Option<NavigatorEvent>,
}

impl Navigator {
    /// For a checked configuration, with frames of this channel map.
    #[must_use]
    pub fn new(settings: &Navigation, channels: ChannelMap) -> Self {
        let other = &settings.alternative;
        Self {
            channels,
            map: Map::new(settings),
            faults: NavigationFaults::new(&settings.trouble),
            path: Path::new(&settings.path),
            alternative: (other.len() > 1).then(|| Path::new(other)),
            lane: Lane::default(),
            pose: [0.0; 3],
            along_m: 0.0,
            curvature_1_m: 0.0,
            planned_m: 0.0,
            block_m: None,
            free_s: 0.0,
            task: Task::Stand,
            kind: RecoveryKind::None,
            decision: DecisionId::default(),
            outcome: ActionOutcome::None,
            symptoms: 0,
            resets: 0,
            t_s: 0.0,
            took_alternative: false,
            touched: false,
            at_goal: false,
            help: None,
            was_relocalised: false,
            restarts: false,
            event: None,
            settings: settings.clone(),
        }
    }

    /// The command after `dt_s`, before the action's speed factor. Without a valid action the robot
    /// stands. `true_pose` decides what the robot touches and where a navigation fault starts.
    pub fn plan(
        &mut self,
        dt_s: f64,
        request: Option<ActionRequest>,
        true_pose: [f64; 3],
    ) -> DriveCommand {
        let Some(request) = request else {
            return self.stand();
        };
        self.t_s += dt_s;
        self.faults.apply_due(self.t_s, true_pose);
        self.find_along();
        self.touched = self.touches(true_pose, true);
        if request.decision != self.decision {
            (self.decision, self.kind) = (request.decision, request.kind);
            self.outcome = ActionOutcome::Running;
            self.symptoms = 0;
            self.task = Task::begin(request.kind, [self.pose[0], self.pose[1]]);
            // The simulated rover has no action of its own: it has done it by standing.
            let is_done = [RecoveryKind::Stop, RecoveryKind::GiveUp, RecoveryKind::Own];
            if is_done.contains(&request.kind) {
                self.end(true);
            }
        }
        let command = self.pursue(dt_s, request.speed_scale, true_pose);
        let hits = match command.speed_m_s {
            forward if forward > 0.0 => self.touched,
            back if back < 0.0 => self.touches(true_pose, false),
            _ => false,
        };
        if hits { self.stand() } else { command }
    }

    /// Writes pose, planned pose, outcome and symptoms into a measured frame, and takes its own
    /// pose from it.
    pub fn report(&mut self, frame: &mut SensorFrame) {
        if let Some(pose) = self.channels.pose(frame) {
            self.pose = self.faults.to_believed(pose);
            self.channels.set_pose(frame, self.pose);
            if std::mem::take(&mut self.restarts) {
                self.restart();
            }
        }
        let planned = match self.task {
            // A manoeuvre away from the path is its own plan.
            Task::Back { .. } => self.pose,
            _ => self
                .path
                .beside(self.planned_m, self.lane.at(self.planned_m)),
        };
        frame.set_planned(planned);
        frame.pose_reset_count = self.resets;
        frame.action_outcome = self.outcome as u32;
        frame.symptoms |= self.symptoms;
    }

    /// What happened in the last cycle, once.
    pub const fn take_event(&mut self) -> Option<NavigatorEvent> {
        self.event.take()
    }

    /// True if something ahead is within the bumper's reach.
    #[must_use]
    pub const fn is_touching(&self) -> bool {
        self.touched
    }

    /// Help that has come, once.
    pub const fn take_help(&mut self) -> Option<Help> {
        self.help.take()
    }

    /// True once after the robot's pose was corrected.
    pub fn take_relocalisation(&mut self) -> bool {
        std::mem::take(&mut self.was_relocalised)
    }

    fn pursue(&mut self, dt_s: f64, scale: f64, true_pose: [f64; 3]) -> DriveCommand {
        let (think_s, help_s) = (self.settings.think_s, self.settings.help_s);
        match &mut self.task {
            Task::Stand => {}
            Task::Follow => return self.follow(dt_s, scale),
            Task::Look { passed_s } => {
                *passed_s += dt_s;
                let passed_s = *passed_s;
                return self.look(passed_s);
            }
            Task::Pass {
                end_m,
                passed_s,
                is_phantom,
            } => {
                *passed_s += dt_s;
                let (end_m, is_phantom, passed_s) = (*end_m, *is_phantom, *passed_s);
                return self.pass(end_m, is_phantom, passed_s, dt_s * scale);
            }
            Task::Back { from, passed_s } => {
                *passed_s += dt_s;
                let (from, passed_s) = (*from, *passed_s);
                return self.back(from, passed_s);
            }
            Task::Plan { passed_s } => {
                *passed_s += dt_s;
                if *passed_s >= think_s {
                    self.replan();
                }
            }
            Task::Locate { passed_s } => {
                *passed_s += dt_s;
                if *passed_s >= think_s {
                    self.relocalise();
                    self.end(true);
                }
            }
            Task::Wait { passed_s } => {
                *passed_s += dt_s;
                if *passed_s >= help_s {
                    self.map.clear();
                    self.faults.repair_sensor();
                    self.relocalise();
                    self.help = Some(Help {
                        place: self.place_with_room(true_pose),
                    });
                    self.end(true);
                }
            }
        }
        self.stand()
    }

    fn relocalise(&mut self) {
        if self.faults.relocalise() {
            self.resets = self.resets.wrapping_add(1);
            self.was_relocalised = true;
            // The obstacle was placed by the wrong pose.
            self.block_m = None;
        }
        self.restarts = true;
    }

    /// The action is done or has failed. After an opening the robot follows its path again.
    pub(super) fn end(&mut self, succeeded: bool) {
        self.outcome = match succeeded {
            true => ActionOutcome::Succeeded,
            false => ActionOutcome::Failed,
        };
        self.symptoms = symptoms_of(self.kind, succeeded);
        let follows = succeeded && self.kind == RecoveryKind::GoThrough;
        self.task = if follows { Task::Follow } else { Task::Stand };
        self.event = Some(NavigatorEvent::Ended(self.kind, self.outcome));
    }

    /// No speed; the steering stays.
    pub(super) const fn stand(&self) -> DriveCommand {
        DriveCommand {
            curvature_1_m: self.curvature_1_m,
            speed_m_s: 0.0,
        }
    }
}

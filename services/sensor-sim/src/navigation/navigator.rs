//! From orders to commands.

use vigil_blocks::{ActionOutcome, RecoveryKind, SensorFrame, Valid};
use vigil_setup::schema::Navigation;

use super::lane::Lane;
use super::map::Map;
use super::path::Path;
use super::task::{Task, said};
use super::troubles::Troubles;
use crate::DriveCommand;

/// What the robot is to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// What.
    pub kind: RecoveryKind,
    /// Writer and number of the decision; another one begins anew.
    pub decision: (u64, u64),
    /// Factor on the speed, 0..1.
    pub speed_scale: f64,
}

/// What is worth telling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NavigatorEvent {
    /// An order is done, or cannot be.
    Ended(RecoveryKind, ActionOutcome),
    /// The robot is at its goal.
    Goal,
}

/// The robot's navigation, and the world around it.
#[derive(Debug, Clone)]
pub struct Navigator {
    pub(super) settings: Navigation,
    pub(super) map: Map,
    pub(super) troubles: Troubles,
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
    pub(super) task: Task,
    kind: RecoveryKind,
    decision: (u64, u64),
    outcome: ActionOutcome,
    symptoms: u32,
    resets: u32,
    pub(super) t_s: f64,
    pub(super) took_alternative: bool,
    /// Something is within the bumper's reach.
    pub(super) touched: bool,
    pub(super) at_goal: bool,
    is_helped: bool,
    /// The robot has found itself elsewhere.
    is_found: bool,
    /// The plan begins anew where the robot is, with the next pose.
    pub(super) is_anew: bool,
    pub(super) happening: Option<NavigatorEvent>,
}

impl Navigator {
    /// For a checked configuration.
    #[must_use]
    pub fn new(settings: &Navigation) -> Self {
        let other = &settings.alternative;
        Self {
            map: Map::new(settings),
            troubles: Troubles::new(&settings.trouble),
            path: Path::new(&settings.path),
            alternative: (other.len() > 1).then(|| Path::new(other)),
            lane: Lane::default(),
            pose: [0.0; 3],
            along_m: 0.0,
            curvature_1_m: 0.0,
            planned_m: 0.0,
            block_m: None,
            task: Task::Stand,
            kind: RecoveryKind::None,
            decision: (0, 0),
            outcome: ActionOutcome::None,
            symptoms: 0,
            resets: 0,
            t_s: 0.0,
            took_alternative: false,
            touched: false,
            at_goal: false,
            is_helped: false,
            is_found: false,
            is_anew: false,
            happening: None,
            settings: settings.clone(),
        }
    }

    /// The command that follows from an order (`None`: no valid action, the robot stands) after
    /// `dt_s`, for a robot whose true pose is `truth`: speed before the order's factor.
    pub fn plan(&mut self, dt_s: f64, order: Option<Order>, truth: [f64; 3]) -> DriveCommand {
        let Some(order) = order else {
            return self.stand();
        };
        self.t_s += dt_s;
        self.troubles.strike(self.t_s, truth);
        self.find_along();
        self.touched = self.touches(truth, true);
        if order.decision != self.decision {
            (self.decision, self.kind) = (order.decision, order.kind);
            self.outcome = ActionOutcome::Running;
            self.symptoms = 0;
            self.task = Task::begin(order.kind, [self.pose[0], self.pose[1]]);
            if matches!(order.kind, RecoveryKind::Stop | RecoveryKind::GiveUp) {
                self.end(true);
            }
        }
        let command = self.pursue(dt_s, order.speed_scale);
        let hits = match command.speed_m_s {
            forward if forward > 0.0 => self.touched,
            back if back < 0.0 => self.touches(truth, false),
            _ => false,
        };
        if hits { self.stand() } else { command }
    }

    /// Writes what the navigation knows into a frame that holds the true pose as measured, and
    /// learns the pose from it.
    pub fn report(&mut self, frame: &mut SensorFrame) {
        if frame.has(Valid::POSE) {
            frame.pose = self.troubles.believed(frame.pose);
            self.pose = frame.pose;
            if std::mem::take(&mut self.is_anew) {
                self.begin_anew();
            }
        }
        frame.planned_pose = match self.task {
            // A manoeuvre away from the path is its own plan.
            Task::Back { .. } => self.pose,
            _ => self
                .path
                .beside(self.planned_m, self.lane.at(self.planned_m)),
        };
        frame.valid |= Valid::PLANNED_POSE;
        frame.pose_reset_count = self.resets;
        frame.action_outcome = self.outcome as u32;
        frame.symptoms |= self.symptoms;
    }

    /// What happened in the last cycle, once.
    pub const fn happening(&mut self) -> Option<NavigatorEvent> {
        self.happening.take()
    }

    /// True once, when help has come: whatever is broken is to be mended.
    pub fn helped(&mut self) -> bool {
        std::mem::take(&mut self.is_helped)
    }

    /// True once, when the robot has found itself elsewhere than it believed to be.
    pub fn found(&mut self) -> bool {
        std::mem::take(&mut self.is_found)
    }

    fn pursue(&mut self, dt_s: f64, scale: f64) -> DriveCommand {
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
                let (opening, passed_s) = ((*end_m, *is_phantom), *passed_s);
                return self.pass(opening, passed_s, dt_s * scale);
            }
            Task::Back { from, passed_s } => {
                *passed_s += dt_s;
                let (from, passed_s) = (*from, *passed_s);
                return self.back(from, passed_s);
            }
            Task::Plan { passed_s } => {
                *passed_s += dt_s;
                if *passed_s >= think_s {
                    self.plan_anew();
                }
            }
            Task::Locate { passed_s } => {
                *passed_s += dt_s;
                if *passed_s >= think_s {
                    self.find_place();
                    self.end(true);
                }
            }
            Task::Wait { passed_s } => {
                *passed_s += dt_s;
                if *passed_s >= help_s {
                    self.map.clear();
                    self.troubles.mend_sensor();
                    self.find_place();
                    self.is_helped = true;
                    self.end(true);
                }
            }
        }
        self.stand()
    }

    fn find_place(&mut self) {
        if self.troubles.find_place() {
            self.resets = self.resets.wrapping_add(1);
            self.is_found = true;
            // What blocked was seen from elsewhere.
            self.block_m = None;
        }
        self.is_anew = true;
    }

    /// The order is done, or cannot be. An opening behind it, the robot follows its path.
    pub(super) fn end(&mut self, succeeded: bool) {
        self.outcome = match succeeded {
            true => ActionOutcome::Succeeded,
            false => ActionOutcome::Failed,
        };
        self.symptoms = said(self.kind, succeeded);
        let follows = succeeded && self.kind == RecoveryKind::GoThrough;
        self.task = if follows { Task::Follow } else { Task::Stand };
        self.happening = Some(NavigatorEvent::Ended(self.kind, self.outcome));
    }

    /// No speed; the steering stays.
    pub(super) const fn stand(&self) -> DriveCommand {
        DriveCommand {
            curvature_1_m: self.curvature_1_m,
            speed_m_s: 0.0,
        }
    }
}

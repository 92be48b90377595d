//! The navigator's manoeuvres: follow, look, pass, back, replan. The constants are chosen by hand
//! for a robot less than a metre wide; they shape the simulated drive, no verdict.

use vigil_setup::graph_file::Navigation;

use super::lane::Lane;
use super::navigator::{Navigator, NavigatorEvent};
use super::path::distance;
use super::task::Task;
use crate::drive::DriveCommand;

/// Step in which the way ahead is looked at, m.
const LOOK_STEP_M: f64 = 0.05;
/// The same where many ways are looked at: twice as coarse, half the work.
pub(super) const SEARCH_STEP_M: f64 = 0.1;
/// A way that was blocked counts as free after this long, s. A shorter time has the plan begin anew
/// with every flicker of the range sensor.
const FREE_S: f64 = 1.0;
/// Room that a person leaves about a robot that is set on its path, m.
const ROOM_M: f64 = 0.2;
/// Reach of the bumper, m: what is this near stops the robot, whatever its sensors say.
pub(super) const BUMPER_M: f64 = 0.08;
/// Share of the speed in an opening and in moving away.
const CAREFUL: f64 = 0.75;
/// Below this share of the speed the robot stands: it would creep for seconds before `stop_m`. With
/// a larger share it stands farther from the obstacle.
const CREEP: f64 = 0.05;
/// Steps of 0.1 m to either side in which an opening is looked for.
pub(super) const SIDE_STEPS: i32 = 20;
/// Free way that an opening must offer beyond what blocks, m.
pub(super) const BEYOND_M: f64 = 0.6;
/// A robot farther from its lane than this, m, is neither at its goal nor past an opening.
const NEAR_M: f64 = 0.4;
/// The robot is at its goal within this distance along the path, m.
const AT_GOAL_M: f64 = 0.1;
/// Way before the goal on which it slows down, m, to a fifth at [`AT_GOAL_M`]. Shorter brakes
/// harder, longer takes more time.
const SLOW_AT_GOAL_M: f64 = 0.5;
/// A robot behind its plan makes up this share of the way per second, 1/s, at most `HURRY` of its
/// speed faster. Larger shares make the speed jump with every small lag; smaller ones leave the
/// robot behind its plan for longer.
const MAKE_UP_1_S: f64 = 0.5;
const HURRY: f64 = 0.25;
/// A robot that is off its path comes back to it so far ahead, m. Shorter turns it hard towards the
/// path; longer leaves more of the path out.
const JOIN_M: f64 = 1.5;
/// From one cycle to the next the robot comes no farther along its path than this, m.
const SEARCH_M: f64 = 1.0;

impl Navigator {
    /// Along the path with the plan; slower before an obstacle, and never into it.
    pub(super) fn follow(&mut self, dt_s: f64, scale: f64) -> DriveCommand {
        let (slow_m, stop_m) = (self.settings.slow_m, self.settings.stop_m);
        let free_m = if self.touched {
            0.0
        } else {
            self.free_way(slow_m)
        };
        if free_m < slow_m {
            self.block_m = Some(self.along_m + free_m);
            self.free_s = 0.0;
        } else if self.block_m.is_some() {
            // A way that flickers is not free.
            self.free_s += dt_s;
            if self.free_s >= FREE_S {
                // The way is free again: the plan goes on from here.
                self.block_m = None;
                self.planned_m = self.along_m;
            }
        }
        let length_m = self.path.length_m();
        let step_m = self.settings.speed_m_s * scale * dt_s;
        self.planned_m = (self.planned_m + step_m).min(length_m);
        let left_m = length_m - self.along_m;
        let is_near = self.off_path_m() <= NEAR_M;
        if left_m <= AT_GOAL_M && is_near {
            if !std::mem::replace(&mut self.at_goal, true) {
                self.event = Some(NavigatorEvent::Goal);
            }
            return self.stand();
        }
        let room = ((free_m - stop_m) / (slow_m - stop_m)).clamp(0.0, 1.0);
        let behind_m = self.planned_m - self.along_m;
        let hurry = 1.0 + (MAKE_UP_1_S * behind_m / self.settings.speed_m_s).clamp(-HURRY, HURRY);
        let near = (left_m / SLOW_AT_GOAL_M).clamp(0.2, 1.0);
        self.steer(if room < CREEP {
            0.0
        } else {
            room * hurry * near
        })
    }

    /// Stands and looks for an opening.
    pub(super) fn look(&mut self, passed_s: f64) -> DriveCommand {
        // Where nothing is known to block, an opening is as long as the way that the robot sees.
        let seen_m = self.along_m + self.settings.slow_m;
        let block_m = self.block_m.unwrap_or(seen_m).max(self.along_m);
        // What lies beyond the goal is in nobody's way.
        let end_m = (block_m + BEYOND_M).min(self.path.length_m());
        if let Some((lane, end_m)) = self.opening(end_m) {
            let is_phantom = self.sees_phantom(end_m);
            self.lane = lane;
            self.planned_m = self.along_m;
            self.task = Task::Pass {
                end_m,
                passed_s: 0.0,
                is_phantom,
            };
        } else if passed_s >= self.settings.look_s {
            self.end(false);
        }
        self.stand()
    }

    /// Carefully through the opening, then back to the path; `is_phantom` if the obstacle was a
    /// phantom.
    pub(super) fn pass(
        &mut self,
        end_m: f64,
        is_phantom: bool,
        passed_s: f64,
        dt_s: f64,
    ) -> DriveCommand {
        let step_m = CAREFUL * self.settings.speed_m_s * dt_s;
        self.planned_m = (self.planned_m + step_m).min(end_m);
        if passed_s >= Navigation::PASS_MAX_S {
            self.end(false);
            return self.stand();
        }
        let is_behind = self.along_m >= end_m.min(self.path.length_m() - AT_GOAL_M);
        if is_behind && self.off_path_m() <= NEAR_M {
            self.block_m = None;
            if is_phantom {
                // The robot has driven through it, so it is not there.
                self.faults.phantom = None;
            }
            self.planned_m = self.along_m;
            self.lane = self.lane.change(self.along_m, 0.0);
            self.end(true);
        }
        self.steer(CAREFUL)
    }

    /// Straight back until it has come far enough, or something is there.
    pub(super) fn back(&mut self, from: [f64; 2], passed_s: f64) -> DriveCommand {
        let here = [self.pose[0], self.pose[1]];
        if distance(from, here) >= self.settings.away_m || passed_s >= Navigation::AWAY_MAX_S {
            let moved = distance(from, here) >= 0.5 * self.settings.away_m;
            self.restarts = true;
            self.end(moved);
            return self.stand();
        }
        self.curvature_1_m = 0.0;
        DriveCommand {
            curvature_1_m: 0.0,
            speed_m_s: -CAREFUL * self.settings.speed_m_s,
        }
    }

    /// Replans from here: along the alternative, once, if the way is blocked, else along the same
    /// path.
    pub(super) fn replan(&mut self) {
        self.faults.wrong_heading_rad = 0.0;
        let slow_m = self.settings.slow_m;
        if self.block_m.is_some() || self.free_way(slow_m) < slow_m {
            let alternative = self.alternative.as_mut().filter(|_| !self.took_alternative);
            let Some(alternative) = alternative else {
                return self.end(false);
            };
            std::mem::swap(&mut self.path, alternative);
            self.took_alternative = true;
            self.block_m = None;
        }
        self.lane = Lane::default();
        self.restarts = true;
        self.end(true);
    }

    /// Where the robot believes to be along its path: not far from where it was.
    pub(super) fn find_along(&mut self) {
        let here = [self.pose[0], self.pose[1]];
        let (from_m, to_m) = (self.along_m - SEARCH_M, self.along_m + SEARCH_M);
        self.along_m = self.path.nearest(here, from_m.max(0.0), to_m);
    }

    /// How far from its lane the robot believes to be, m.
    fn off_path_m(&self) -> f64 {
        let [x, y, _] = self.path.beside(self.along_m, self.lane.at(self.along_m));
        distance([x, y], [self.pose[0], self.pose[1]])
    }

    /// True if the robot runs into something, or farther into it, if it goes on. What it has run
    /// into does not hold it back.
    pub(super) fn touches(&self, true_pose: [f64; 3], is_forward: bool) -> bool {
        let reach_m = if is_forward { BUMPER_M } else { -BUMPER_M };
        let [x, y, yaw_rad] = true_pose;
        let (sin, cos) = yaw_rad.sin_cos();
        let there_m = self
            .map
            .clearance_m([x + reach_m * cos, y + reach_m * sin], self.t_s);
        there_m < 0.0 && there_m < self.map.clearance_m([x, y], self.t_s)
    }

    /// Where a person sets a robot that has run into something or is off its path: on the path,
    /// where there is room. `None` for a robot that stands well.
    pub(super) fn place_with_room(&self, true_pose: [f64; 3]) -> Option<[f64; 3]> {
        let here = [true_pose[0], true_pose[1]];
        let along_m = self.path.nearest(here, 0.0, self.path.length_m());
        let [x, y, _] = self.path.at(along_m);
        let clearance_m = |place| self.map.clearance_m(place, self.t_s);
        if clearance_m(here) >= BUMPER_M && distance([x, y], here) <= NEAR_M {
            return None;
        }
        let left_m = self.path.length_m() - along_m;
        let steps = 0..=(left_m / SEARCH_STEP_M) as u32;
        let mut places = steps.map(|step| self.path.at(along_m + f64::from(step) * SEARCH_STEP_M));
        places.find(|[x, y, _]| clearance_m([*x, *y]) >= ROOM_M)
    }

    /// Restarts the plan here; a robot that is off its path first returns to it.
    pub(super) fn restart(&mut self) {
        let here = [self.pose[0], self.pose[1]];
        self.along_m = self.path.nearest(here, 0.0, self.path.length_m());
        if self.off_path_m() > NEAR_M {
            self.lane = Lane::default();
            let length_m = self.path.length_m();
            self.path.join(here, self.along_m + JOIN_M);
            self.along_m = 0.0;
            // What blocks is as far from the goal as it was.
            let longer_m = self.path.length_m() - length_m;
            self.block_m = self.block_m.map(|block_m| block_m + longer_m);
        }
        self.planned_m = self.along_m;
    }

    /// Free way on the lane as the range sensor measures it, up to `most_m`.
    fn free_way(&self, most_m: f64) -> f64 {
        if self.faults.is_blind {
            return most_m;
        }
        let is_free = |ahead_m: f64| {
            let along_m = self.along_m + ahead_m;
            let [x, y, _] = self.path.beside(along_m, self.lane.at(along_m));
            self.map.is_free(self.faults.to_true([x, y]), self.t_s) && !self.is_phantom([x, y])
        };
        // What lies beyond the goal is in nobody's way.
        let left_m = self.path.length_m() - self.along_m;
        let steps = (most_m.min(left_m) / LOOK_STEP_M) as u32;
        let blocked = (0..=steps).find(|step| !is_free(f64::from(*step) * LOOK_STEP_M));
        blocked.map_or(most_m, |step| f64::from(step) * LOOK_STEP_M)
    }

    /// True if the range sensor sees the robot touch a phantom at `place`.
    pub(super) fn is_phantom(&self, place: [f64; 2]) -> bool {
        let phantom = self.faults.phantom;
        phantom.is_some_and(|at| self.map.touches_phantom(at, place))
    }

    /// True if a phantom is on the robot's lane up to `end_m`.
    fn sees_phantom(&self, end_m: f64) -> bool {
        let steps = ((end_m - self.along_m) / SEARCH_STEP_M).ceil() as u32;
        (0..=steps).any(|step| {
            let along_m = self.along_m + f64::from(step) * SEARCH_STEP_M;
            let [x, y, _] = self.path.beside(along_m, self.lane.at(along_m));
            self.is_phantom([x, y])
        })
    }

    /// The lane nearest to the path on which the way is free up to `end_m`, as a close look tells,
    /// and where it has passed.
    pub(super) fn opening(&self, end_m: f64) -> Option<(Lane, f64)> {
        let sides = (0..=SIDE_STEPS).flat_map(|side| [side, -side]);
        sides.into_iter().find_map(|side| {
            let left_m = f64::from(side) * SEARCH_STEP_M;
            let lane = self.lane.change(self.along_m, left_m);
            let end_m = end_m.max(lane.end_m());
            let steps = ((end_m - self.along_m) / SEARCH_STEP_M).ceil() as u32;
            let is_free = |step: u32| {
                let along_m = self.along_m + f64::from(step) * SEARCH_STEP_M;
                let [x, y, _] = self.path.beside(along_m, lane.at(along_m));
                self.map.is_free(self.faults.to_true([x, y]), self.t_s)
            };
            (0..=steps).all(is_free).then_some((lane, end_m))
        })
    }

    /// Along the lane at a share of the speed.
    fn steer(&mut self, share: f64) -> DriveCommand {
        let turned_rad = self.faults.wrong_heading_rad;
        self.curvature_1_m = self
            .lane
            .pursue(&self.path, self.along_m, self.pose, turned_rad);
        DriveCommand {
            curvature_1_m: self.curvature_1_m,
            speed_m_s: share * self.settings.speed_m_s,
        }
    }
}

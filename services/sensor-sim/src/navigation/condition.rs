//! What is truly wrong with the navigation, for tests and labels; no filter gets it.

use super::behaviour::{BEYOND_M, BUMPER_M, SEARCH_STEP_M, SIDE_STEPS};
use super::navigator::Navigator;

/// The way ahead, as far as the robot looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WayAhead {
    /// Nothing is in the way.
    Free,
    /// Something seems to be or is in the way, and there is a way past it.
    Passable,
    /// There is a way past it, but the robot is too near to take it.
    TooNear,
    /// Nothing leads past what is in the way.
    Filled,
    /// The same, and it leaves by itself.
    Crowded,
}

/// What is truly wrong with the navigation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NavigationCondition {
    /// The way ahead.
    pub way: WayAhead,
    /// Another path leads to the goal: it was not taken yet, and nothing is in its way.
    pub has_other_way: bool,
    /// The robot touches something.
    pub touches: bool,
    /// The believed pose is wrong.
    pub is_lost: bool,
    /// The robot steers into another direction than its path's.
    pub heads_wrong: bool,
}

impl Navigator {
    /// What is wrong while the robot is at the true `pose`; of the way, up to `range_m` ahead.
    #[must_use]
    pub fn condition(&self, pose: [f64; 3], range_m: f64) -> NavigationCondition {
        NavigationCondition {
            way: self.way_ahead(range_m),
            has_other_way: self.has_other_way(),
            touches: self.map.clearance_m([pose[0], pose[1]], self.t_s) < BUMPER_M,
            is_lost: self.faults.is_lost(),
            heads_wrong: self.faults.wrong_heading_rad != 0.0,
        }
    }

    /// What is in the way on the lane, whatever the range sensor makes of it.
    fn way_ahead(&self, range_m: f64) -> WayAhead {
        let length_m = self.path.length_m();
        let places = |from_m: f64, to_m: f64| {
            let steps = 0..=((to_m - from_m) / SEARCH_STEP_M) as u32;
            steps.map(move |step| from_m + f64::from(step) * SEARCH_STEP_M)
        };
        let is_blocked = |along_m: &f64| {
            let [x, y, _] = self.path.beside(*along_m, self.lane.at(*along_m));
            let is_free = self.map.is_free(self.faults.to_true([x, y]), self.t_s);
            !is_free || self.is_phantom([x, y])
        };
        let end_m = (self.along_m + range_m).min(length_m);
        let Some(block_m) = places(self.along_m, end_m).find(is_blocked) else {
            return WayAhead::Free;
        };
        let behind_m = places(block_m, length_m).find(|along_m| !is_blocked(along_m));
        let behind_m = behind_m.map_or(length_m, |behind_m| behind_m + BEYOND_M);
        let behind_m = behind_m.min(length_m);
        let is_free = |along_m: f64, side: i32| {
            let left_m = f64::from(side) * SEARCH_STEP_M;
            let [x, y, _] = self.path.beside(along_m, left_m);
            self.map.is_free(self.faults.to_true([x, y]), self.t_s)
        };
        // Behind the block the robot could come there from the path: no wall is between.
        let mut sides = (-SIDE_STEPS..=SIDE_STEPS).filter(|side| {
            let side = *side;
            (side.min(0)..=side.max(0)).all(|between| is_free(behind_m, between))
                && places(block_m, behind_m).all(|along_m| is_free(along_m, side))
        });
        match self.opening(behind_m) {
            Some(_) => WayAhead::Passable,
            None if sides.next().is_some() => WayAhead::TooNear,
            None if self.map.is_crowded(self.t_s) => WayAhead::Crowded,
            None => WayAhead::Filled,
        }
    }

    /// True if a path that was not taken yet leads to the goal.
    fn has_other_way(&self) -> bool {
        let other = self.alternative.as_ref().filter(|_| !self.took_alternative);
        other.is_some_and(|path| {
            let steps = 0..=(path.length_m() / SEARCH_STEP_M) as u32;
            let mut places = steps.map(|step| path.at(f64::from(step) * SEARCH_STEP_M));
            places.all(|[x, y, _]| self.map.is_free([x, y], self.t_s))
        })
    }
}

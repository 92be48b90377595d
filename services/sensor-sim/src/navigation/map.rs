//! What stands in the world, and what the range sensor makes of it.

use vigil_setup::graph_file::{Navigation, Obstacle};

use super::path::distance;

/// Radius of a phantom, m. Chosen by hand: it blocks half of a corridor of two metres.
const PHANTOM_RADIUS_M: f64 = 0.5;

/// Walls, obstacles, people.
#[derive(Debug, Clone)]
pub(super) struct Map {
    walls: Vec<[f64; 4]>,
    obstacles: Vec<Obstacle>,
    body_radius_m: f64,
    /// A person has cleared the way.
    is_cleared: bool,
}

impl Map {
    pub(super) fn new(settings: &Navigation) -> Self {
        Self {
            walls: settings.walls.clone(),
            obstacles: settings.obstacle.clone(),
            body_radius_m: settings.body_radius_m,
            is_cleared: false,
        }
    }

    /// Takes away what stands in the way.
    pub(super) const fn clear(&mut self) {
        self.is_cleared = true;
    }

    /// True if the robot's disc touches nothing with its centre at `place`.
    pub(super) fn is_free(&self, place: [f64; 2], t_s: f64) -> bool {
        let wall = |wall: &[f64; 4]| distance_to(wall, place) >= self.body_radius_m;
        let obstacle =
            |o: &Obstacle| distance([o.x_m, o.y_m], place) >= self.body_radius_m + o.radius_m;
        let mut there = self.obstacles.iter().filter(|it| self.is_there(it, t_s));
        self.walls.iter().all(wall) && there.all(obstacle)
    }

    /// Distance of the robot's disc at `place` from what is nearest, m; negative inside it.
    pub(super) fn clearance_m(&self, place: [f64; 2], t_s: f64) -> f64 {
        let walls = self.walls.iter().map(|wall| distance_to(wall, place));
        let there = self.obstacles.iter().filter(|it| self.is_there(it, t_s));
        let obstacles = there.map(|it| distance([it.x_m, it.y_m], place) - it.radius_m);
        walls.chain(obstacles).fold(f64::INFINITY, f64::min) - self.body_radius_m
    }

    /// True if something is there that leaves by itself.
    pub(super) fn is_crowded(&self, t_s: f64) -> bool {
        let leaves = |it: &Obstacle| it.until_s.is_some() && self.is_there(it, t_s);
        self.obstacles.iter().any(leaves)
    }

    fn is_there(&self, obstacle: &Obstacle, t_s: f64) -> bool {
        let has_left = obstacle.until_s.is_some_and(|end_s| t_s >= end_s);
        !self.is_cleared && obstacle.from_s <= t_s && !has_left
    }

    /// True if the robot's disc at `place` touches the phantom at `phantom`.
    pub(super) fn touches_phantom(&self, phantom: [f64; 2], place: [f64; 2]) -> bool {
        distance(phantom, place) < self.body_radius_m + PHANTOM_RADIUS_M
    }
}

/// Distance of `place` to a wall.
fn distance_to(wall: &[f64; 4], place: [f64; 2]) -> f64 {
    let [x, y, to_x, to_y] = *wall;
    let (along_x, along_y) = (to_x - x, to_y - y);
    let square = along_x * along_x + along_y * along_y;
    let share = if square > 0.0 {
        (((place[0] - x) * along_x + (place[1] - y) * along_y) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    distance([x + share * along_x, y + share * along_y], place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_is_free_up_to_touching() {
        let map = Map {
            walls: vec![[0.0, 1.0, 4.0, 1.0]],
            obstacles: vec![Obstacle {
                x_m: 2.0,
                y_m: -1.0,
                radius_m: 0.5,
                from_s: 1.0,
                until_s: Some(3.0),
            }],
            body_radius_m: 0.25,
            is_cleared: false,
        };
        assert!(map.is_free([2.0, 0.75], 0.0) && !map.is_free([2.0, 0.76], 0.0));
        // Round the wall's end.
        assert!(map.is_free([4.25, 1.0], 0.0) && !map.is_free([4.24, 1.0], 0.0));
        for (t_s, free) in [(0.9, true), (1.0, false), (2.9, false), (3.0, true)] {
            assert_eq!(map.is_free([2.0, -0.26], t_s), free, "{t_s}");
            assert!(map.is_free([2.0, -0.25], t_s));
        }
        // Inside the wall by .05 m, and as far from the obstacle as its radius leaves.
        assert!((map.clearance_m([0.0, 0.8], 0.0) + 0.05).abs() < 1e-12);
        assert!((map.clearance_m([2.0, -0.2], 1.0) - 0.05).abs() < 1e-12);
        assert!((map.clearance_m([2.0, -0.2], 3.0) - 0.95).abs() < 1e-12);
        let cleared = Map {
            is_cleared: true,
            ..map
        };
        assert!(cleared.is_free([2.0, -0.26], 2.0) && !cleared.is_free([2.0, 0.76], 2.0));
    }
}

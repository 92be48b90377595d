//! A path of straight pieces, by the distance along it.

use vigil_robot::kinematics::wrap_angle;

/// Radius to which corners are rounded, m: what a rover can drive with room to steer.
const CORNER_M: f64 = 1.0;
/// Straight pieces of a rounded corner: a quarter turn of [`CORNER_M`] strays 2 mm from its arc,
/// less than the pose's noise of 5 mm. Fewer turn the plan's heading in steps above 7.5 degrees.
const CORNER_PIECES: u32 = 12;
/// Points that joining adds at most: where the robot is, and where it meets the path.
const JOINS: usize = 2;
/// Share of a piece that one rounded corner may take: less than half, as both its ends have one.
const SHARE_MAX: f64 = 0.49;

/// Points and their distances from the first, m. Nothing is allocated after the start.
#[derive(Debug, Clone)]
pub(super) struct Path {
    points: Vec<[f64; 2]>,
    along_m: Vec<f64>,
}

impl Path {
    /// From the first of `points` to the last; the corners between are rounded.
    pub(super) fn new(points: &[[f64; 2]]) -> Self {
        let capacity = points.len() * (CORNER_PIECES as usize + 1) + JOINS;
        let mut path = Self {
            points: Vec::with_capacity(capacity),
            along_m: Vec::with_capacity(capacity),
        };
        for (i, point) in points.iter().enumerate() {
            let next = points.get(i + 1).filter(|_| i > 0);
            match next {
                Some(next) => path.round(points[i - 1], *point, *next),
                None => path.push(*point),
            }
        }
        path
    }

    /// A corner as an arc of [`CORNER_M`], or smaller where the pieces are short: points of the
    /// circle that touches both pieces.
    fn round(&mut self, before: [f64; 2], corner: [f64; 2], next: [f64; 2]) {
        let (from_m, to_m) = (distance(before, corner), distance(corner, next));
        let heading = |a: [f64; 2], b: [f64; 2]| (b[1] - a[1]).atan2(b[0] - a[0]);
        let start = heading(before, corner);
        let turn = wrap_angle(heading(corner, next) - start);
        let half = (turn.abs() / 2.0).tan();
        let tangent_m = (CORNER_M * half).min(SHARE_MAX * from_m.min(to_m));
        if half < 1e-9 {
            return self.push(corner);
        }
        let radius_m = (tangent_m / half).copysign(turn);
        let (sin, cos) = start.sin_cos();
        let first = [corner[0] - tangent_m * cos, corner[1] - tangent_m * sin];
        let centre = [first[0] - radius_m * sin, first[1] + radius_m * cos];
        for piece in 0..=CORNER_PIECES {
            let angle = start + turn * f64::from(piece) / f64::from(CORNER_PIECES);
            let (sin, cos) = angle.sin_cos();
            self.push([centre[0] + radius_m * sin, centre[1] - radius_m * cos]);
        }
    }

    fn push(&mut self, point: [f64; 2]) {
        let before = self.points.last().zip(self.along_m.last());
        let along_m = before.map_or(0.0, |(last, along_m)| along_m + distance(*last, point));
        self.points.push(point);
        self.along_m.push(along_m);
    }

    pub(super) fn length_m(&self) -> f64 {
        self.along_m.last().copied().unwrap_or(0.0)
    }

    /// x, y and heading at a distance along; beyond the ends, straight on.
    pub(super) fn at(&self, along_m: f64) -> [f64; 3] {
        let pieces = self.points.windows(2).zip(self.along_m.windows(2));
        let mut found = [0.0; 3];
        for (points, along) in pieces {
            let ([from, to], [start_m, end_m]) = (points, along) else {
                continue;
            };
            let heading = (to[1] - from[1]).atan2(to[0] - from[0]);
            let (sin, cos) = heading.sin_cos();
            let rest_m = along_m - start_m;
            found = [from[0] + rest_m * cos, from[1] + rest_m * sin, heading];
            if along_m < *end_m {
                break;
            }
        }
        found
    }

    /// `at`, moved to the left by `left_m`.
    pub(super) fn beside(&self, along_m: f64, left_m: f64) -> [f64; 3] {
        let [x, y, heading] = self.at(along_m);
        let (sin, cos) = heading.sin_cos();
        [x - left_m * sin, y + left_m * cos, heading]
    }

    /// Distance along of the nearest point to `place`, looked for between two distances.
    pub(super) fn nearest(&self, place: [f64; 2], from_m: f64, to_m: f64) -> f64 {
        let mut best = (f64::INFINITY, from_m);
        let pieces = self.points.windows(2).zip(self.along_m.windows(2));
        for (points, along) in pieces {
            let ([from, to], [start_m, end_m]) = (points, along) else {
                continue;
            };
            let (low_m, high_m) = (start_m.max(from_m), end_m.min(to_m));
            if low_m > high_m {
                continue;
            }
            let length_m = end_m - start_m;
            let along = [(to[0] - from[0]) / length_m, (to[1] - from[1]) / length_m];
            let off = (place[0] - from[0]) * along[0] + (place[1] - from[1]) * along[1];
            let here_m = (start_m + off).clamp(low_m, high_m);
            let [x, y, _] = self.at(here_m);
            let away_m = distance([x, y], place);
            if away_m < best.0 {
                best = (away_m, here_m);
            }
        }
        best.1
    }
}

impl Path {
    /// Begins at `place` and leads straight to what was at `to_m` along. Beyond the room kept for
    /// [`JOINS`] points it takes those that it leaves out.
    pub(super) fn join(&mut self, place: [f64; 2], to_m: f64) {
        let to_m = to_m.min(self.length_m());
        let [x, y, _] = self.at(to_m);
        let behind = self.along_m.iter().filter(|m| **m <= to_m).count();
        self.points.drain(..behind);
        self.points.insert(0, [x, y]);
        self.points.insert(0, place);
        self.along_m.clear();
        let mut along_m = 0.0;
        let mut last = place;
        for point in &self.points {
            along_m += distance(last, *point);
            last = *point;
            self.along_m.push(along_m);
        }
    }
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn corner() -> Path {
        // As it is: without rounding.
        let mut path = Path::new(&[[0.0, 0.0], [4.0, 0.0]]);
        path.push([4.0, 3.0]);
        path
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn places_along_and_beside_a_corner() {
        let path = corner();
        assert_near(&[path.length_m()], &[7.0]);
        assert_near(&path.at(1.5), &[1.5, 0.0, 0.0]);
        assert_near(&path.at(5.0), &[4.0, 1.0, FRAC_PI_2]);
        assert_near(&path.at(8.0), &[4.0, 4.0, FRAC_PI_2]);
        assert_near(&path.beside(5.0, 0.5), &[3.5, 1.0, FRAC_PI_2]);
    }

    #[test]
    fn the_nearest_place_is_looked_for_where_it_may_be() {
        let path = corner();
        assert_near(&[path.nearest([2.0, 1.0], 0.0, 7.0)], &[2.0]);
        assert_near(&[path.nearest([3.9, 2.0], 0.0, 7.0)], &[6.0]);
        assert_near(&[path.nearest([3.9, 2.0], 0.0, 3.0)], &[3.0]);
    }

    #[test]
    fn a_path_is_joined_ahead() {
        let mut path = corner();
        path.join([1.0, 0.5], 3.0);
        let to_corner_m = 2.0_f64.hypot(0.5) + 1.0;
        assert_near(&[path.length_m()], &[to_corner_m + 3.0]);
        assert_near(&path.at(0.0)[..2], &[1.0, 0.5]);
        assert_near(&path.at(to_corner_m + 1.0), &[4.0, 1.0, FRAC_PI_2]);
        path.join([4.0, 2.0], 99.0);
        assert_near(&[path.length_m()], &[1.0]);
    }

    #[test]
    fn corners_are_rounded_within_their_pieces() {
        let path = Path::new(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]);
        // A quarter of a circle instead of twice its radius, but for the chords.
        let [x, y, _] = path.at(path.length_m());
        assert_near(&[x, y], &[4.0, 3.0]);
        let rounded_m = 7.0 - 2.0 + FRAC_PI_2;
        assert!(
            (path.length_m() - rounded_m).abs() < 2e-3,
            "{}",
            path.length_m()
        );
        let [x, y, heading] = path.at(3.0 + 0.5 * FRAC_PI_2);
        let middle = std::f64::consts::FRAC_1_SQRT_2;
        assert!((x - 3.0 - middle).abs() < 5e-3 && (y - 1.0 + middle).abs() < 5e-3);
        assert!((heading - FRAC_PI_2 / 2.0).abs() < 0.1);
        let short = Path::new(&[[0.0, 0.0], [1.0, 0.0], [1.0, -0.2], [2.0, -0.2]]);
        assert!(short.length_m() > 2.0 && short.length_m() < 2.2);
    }
}

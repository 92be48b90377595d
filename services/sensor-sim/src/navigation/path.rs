//! A path of straight pieces, by the distance along it.

/// Points and their distances from the first, m. Nothing is allocated after the start.
#[derive(Debug, Clone)]
pub(super) struct Path {
    points: Vec<[f64; 2]>,
    along_m: Vec<f64>,
}

impl Path {
    /// Through `points`; room is kept for `capacity`.
    pub(super) fn new(points: &[[f64; 2]], capacity: usize) -> Self {
        let mut path = Self {
            points: Vec::with_capacity(capacity.max(points.len())),
            along_m: Vec::with_capacity(capacity.max(points.len())),
        };
        points.iter().for_each(|point| path.push(*point));
        path
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

    /// Becomes the way from `place` to what of `other` lies ahead of there.
    pub(super) fn join(&mut self, place: [f64; 2], other: &Self, ahead_m: f64) {
        let from_m = other.nearest(place, 0.0, other.length_m()) + ahead_m;
        self.points.clear();
        self.along_m.clear();
        self.push(place);
        let goal = other.points.len().saturating_sub(1);
        let points = other.points.iter().zip(&other.along_m).enumerate();
        for (i, (point, along_m)) in points {
            if *along_m > from_m || i == goal {
                self.push(*point);
            }
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
        Path::new(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]], 8)
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
    fn another_path_is_joined_ahead() {
        let mut path = corner();
        let other = Path::new(&[[0.0, 0.0], [2.0, 0.0], [2.0, 5.0], [9.0, 5.0]], 4);
        path.join([1.0, 0.5], &other, 0.5);
        assert_near(&[path.length_m()], &[1.0_f64.hypot(0.5) + 5.0 + 7.0]);
        path.join([9.0, 5.0], &other, 0.5);
        assert_near(&[path.length_m()], &[0.0]);
    }
}

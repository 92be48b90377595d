//! How far a rover is off its path.

/// Distance between the points that a course keeps, m: on an arc of 2 m radius the chord is less
/// than 0.2 mm off.
const SPACING_M: f64 = 0.05;

/// The planned path as points with their distance along it.
#[derive(Debug, Clone)]
pub struct Course {
    points: Vec<([f64; 2], f64)>,
}

impl Course {
    /// A course through points, m, each a step along the path from the one before.
    #[must_use]
    pub fn new(path: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let mut points: Vec<([f64; 2], f64)> = Vec::new();
        let (mut along_m, mut last) = (0.0, None);
        let mut left_out = None;
        for at in path {
            along_m += last.map_or(0.0, |last| distance(last, at));
            last = Some(at);
            let is_far = points
                .last()
                .is_none_or(|(_, kept_m)| along_m - kept_m >= SPACING_M);
            left_out = (!is_far).then_some((at, along_m));
            if is_far {
                points.push((at, along_m));
            }
        }
        points.extend(left_out);
        Self { points }
    }

    /// Its end, m.
    #[must_use]
    pub fn goal(&self) -> Option<[f64; 2]> {
        self.points.last().map(|(at, _)| *at)
    }

    /// Distance of `at` from the nearest place of the path between `from_m` and `to_m` along it,
    /// m. Beyond the ends of that stretch, from its ends; infinite of a course without points.
    #[must_use]
    pub fn off_m(&self, at: [f64; 2], from_m: f64, to_m: f64) -> f64 {
        let first = self
            .points
            .partition_point(|(_, along_m)| *along_m < from_m);
        let after = self.points.partition_point(|(_, along_m)| *along_m <= to_m);
        // One point more at either side, so that the stretch is covered, and never none.
        let stretch = first.saturating_sub(1)..(after + 1).min(self.points.len());
        let points = self.points.get(stretch).unwrap_or_default();
        let alone = points
            .first()
            .map_or(f64::INFINITY, |(p, _)| distance(*p, at));
        points
            .windows(2)
            .map(|pair| off_segment(pair[0].0, pair[1].0, at))
            .fold(alone, f64::min)
    }
}

/// Distance between two points, m.
pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Distance of `at` from the straight line between `a` and `b`, m.
fn off_segment(a: [f64; 2], b: [f64; 2], at: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let squared = dx * dx + dy * dy;
    let along = match squared > 0.0 {
        true => ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / squared,
        false => 0.0,
    };
    let along = along.clamp(0.0, 1.0);
    distance([a[0] + along * dx, a[1] + along * dy], at)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of 2 mm, as a rover's at 0.2 m/s and 100 Hz.
    fn straight() -> Course {
        Course::new((0..=5000).map(|k| [f64::from(k) * 0.002, 0.0]))
    }

    #[test]
    fn off_a_straight_line_it_is_the_perpendicular() {
        let course = straight();
        assert_eq!(course.goal(), Some([10.0, 0.0]));
        for (at, expected) in [
            ([3.21, 0.7], 0.7),
            ([5.0, -1.5], 1.5),
            ([0.0, 0.0], 0.0),
            ([13.0, 4.0], 5.0),
            ([-0.3, 0.4], 0.5),
        ] {
            let found = course.off_m(at, 0.0, 10.0);
            assert!((found - expected).abs() < 1e-12, "{at:?}: {found}");
        }
    }

    #[test]
    fn off_an_arc_it_is_the_difference_of_radii() {
        let radius_m = 2.0;
        let on = |r: f64, angle: f64| [r * angle.cos(), r * angle.sin()];
        let course = Course::new((0..=3000).map(|k| on(radius_m, f64::from(k) * 0.001)));
        for (r, angle) in [(2.3, 0.4), (1.9, 1.7), (2.0, 2.9), (0.5, 1.0)] {
            let found = course.off_m(on(r, angle), 0.0, 6.0);
            // The sagitta of a chord of 5.2 cm at 2 m radius is 0.17 mm.
            assert!((found - (r - radius_m).abs()).abs() < 2e-4, "{r}: {found}");
        }
    }

    #[test]
    fn only_the_asked_stretch_counts() {
        let course = straight();
        // A path may cross itself: what is near elsewhere does not count.
        let found = course.off_m([1.0, 0.0], 4.0, 6.0);
        assert!(
            (found - 3.0).abs() < 2.0 * SPACING_M && found <= 3.0,
            "{found}"
        );
        assert!((course.off_m([12.0, 0.0], 30.0, 40.0) - 2.0).abs() < 1e-12);
        assert_eq!(Course::new([]).off_m([0.0, 0.0], 0.0, 1.0), f64::INFINITY);
        assert_eq!(Course::new([[1.0, 1.0]]).off_m([1.0, 3.0], 0.0, 1.0), 2.0);
    }

    #[test]
    fn standing_still_adds_nothing() {
        let path = [[0.0, 0.0]; 50]
            .into_iter()
            .chain([[0.03, 0.0], [0.03, 0.0]]);
        let course = Course::new(path);
        assert_eq!(course.goal(), Some([0.03, 0.0]));
        assert!(course.points.len() == 2);
    }
}

//! Where the robot drove.

use vigil_blocks::SensorFrame;
use vigil_pages::chart::{Axis, Chart, Curve, Label, Stroke};
use vigil_pages::colour::Colour;
use vigil_pages::page::{KeyEntry, key, remark};
use vigil_robot::Description;
use vigil_robot::channel::{Role, channels};

use crate::lives::FaultLife;

/// Points that are kept; then the least distance between them doubles.
const POINTS_MAX: usize = 4000;
/// Least distance between two points at first, m.
const STEP_M: f64 = 1e-3;
/// Arrowheads along the path.
const ARROWS: usize = 8;
const SIZE: (u32, u32) = (1400, 900);

/// Where the robot was, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    t_s: f64,
    x: f64,
    y: f64,
    /// True if the way to it is not known: a jump of the pose's frame, or a time without a pose.
    is_after_break: bool,
}

impl Place {
    fn distance(&self, other: &Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

/// Where the robot drove.
#[derive(Debug)]
pub(crate) struct Path {
    /// Places of x and y among the channels.
    channels: Option<[usize; 2]>,
    places: Vec<Place>,
    step_m: f64,
    /// The newest place, kept or not.
    last: Option<Place>,
    resets: Option<u32>,
    is_broken: bool,
}

impl Path {
    /// Without a place yet.
    pub(crate) fn new(robot: &Description) -> Self {
        let all = channels(robot);
        let place = |role: Role| all.iter().position(|channel| channel.role == role);
        Self {
            channels: place(Role::PoseX)
                .zip(place(Role::PoseY))
                .map(|(x, y)| [x, y]),
            places: Vec::new(),
            step_m: STEP_M,
            last: None,
            resets: None,
            is_broken: false,
        }
    }

    /// Takes a frame of the graph's robot.
    pub(crate) fn take(&mut self, t_s: f64, frame: &SensorFrame) {
        let finite = |at: usize| frame.measured(at).filter(|value| value.is_finite());
        let pose = self.channels.and_then(|[x, y]| finite(x).zip(finite(y)));
        let Some((x, y)) = pose else {
            self.is_broken = !self.places.is_empty();
            return;
        };
        let resets = self.resets.replace(frame.pose_reset_count);
        self.is_broken |= resets.is_some_and(|before| before != frame.pose_reset_count);
        let place = Place {
            t_s,
            x,
            y,
            is_after_break: self.is_broken,
        };
        self.last = Some(place);
        let moved = self
            .places
            .last()
            .is_none_or(|last| last.distance(&place) >= self.step_m);
        if moved || self.is_broken {
            self.is_broken = false;
            self.places.push(place);
        }
        while self.places.len() > POINTS_MAX {
            self.thin();
        }
    }

    /// Keeps places that are twice as far from each other.
    fn thin(&mut self) {
        self.step_m *= 2.0;
        let before = self.places.len();
        let mut kept: Vec<Place> = Vec::with_capacity(POINTS_MAX);
        for place in self.places.drain(..) {
            let is_far = kept
                .last()
                .is_none_or(|last| last.distance(&place) >= self.step_m);
            if is_far || place.is_after_break {
                kept.push(place);
            }
        }
        // Breaks alone are too many.
        if kept.len() == before {
            kept = kept.into_iter().step_by(2).collect();
        }
        self.places = kept;
    }

    /// Where it was at an instant, between the places that are kept.
    fn at(&self, t_s: f64) -> Option<(f64, f64)> {
        let after = self.places.partition_point(|place| place.t_s <= t_s);
        let next = self.places.get(after);
        let before = self.places.get(after.checked_sub(1)?)?;
        let Some(next) = next.filter(|next| !next.is_after_break) else {
            return Some((before.x, before.y));
        };
        let share = (t_s - before.t_s) / (next.t_s - before.t_s).max(1e-9);
        let between = |a: f64, b: f64| a + share * (b - a);
        Some((between(before.x, next.x), between(before.y, next.y)))
    }

    /// The way driven within a time, in its pieces.
    fn way(&self, span: [f64; 2], colour: Colour, stroke: Stroke) -> Vec<Curve> {
        let [from_s, to_s] = span;
        let mut pieces: Vec<Vec<(f64, f64)>> = vec![self.at(from_s).into_iter().collect()];
        let within = |place: &&Place| place.t_s > from_s && place.t_s < to_s;
        for place in self.places.iter().filter(within) {
            if place.is_after_break {
                pieces.push(Vec::new());
            }
            if let Some(piece) = pieces.last_mut() {
                piece.push((place.x, place.y));
            }
        }
        let ends_here = self.places.last().is_none_or(|last| last.t_s >= to_s);
        if let (Some(piece), true) = (pieces.last_mut(), ends_here) {
            piece.extend(self.at(to_s));
        }
        let curve = |points: Vec<(f64, f64)>| Curve {
            colour,
            stroke,
            points,
        };
        pieces
            .into_iter()
            .filter(|piece| !piece.is_empty())
            .map(curve)
            .collect()
    }

    /// Heads of arrows along the path, each as long as `length_m`. They show where the way over
    /// that length leads, not where the noise of one place does.
    fn arrows(&self, length_m: f64) -> Vec<Curve> {
        let mut ways: Vec<[Place; 2]> = Vec::new();
        let mut begin: Option<Place> = None;
        for place in &self.places {
            let before = begin.filter(|_| !place.is_after_break);
            match before {
                Some(before) if before.distance(place) < length_m => continue,
                Some(before) => ways.push([before, *place]),
                None => {}
            }
            begin = Some(*place);
        }
        let apart = ways.len().div_ceil(ARROWS).max(1);
        let shown = ways.iter().skip(apart / 2).step_by(apart);
        shown.map(|way| arrow(way, length_m)).collect()
    }

    /// The chart, with the stretches on which faults were present and the place of each alarm.
    pub(crate) fn chart(&self, faults: &[&FaultLife], alarms: &[[f64; 2]]) -> String {
        let (Some(first), Some(last)) = (self.places.first(), self.last) else {
            return remark(match self.channels {
                None => "The robot measures no pose, so its path is not known.",
                Some(_) => "No pose was measured in this recording, so the path is not known.",
            });
        };
        let bounds = |value: fn(&Place) -> f64| {
            let values = self.places.iter().map(value).chain([value(&last)]);
            let [least, most] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |ends, value| {
                [ends[0].min(value), ends[1].max(value)]
            });
            let margin = 0.08 * (most - least).max(0.5);
            [least - margin, most + margin]
        };
        let [xs, ys] = [bounds(|place| place.x), bounds(|place| place.y)];
        let label = |at: (f64, f64), text: String| Label { at, text };
        let mut labels = vec![
            label((first.x, first.y), "start".to_owned()),
            label((last.x, last.y), "end".to_owned()),
        ];
        let arrow_m = 0.03 * (xs[1] - xs[0]).max(ys[1] - ys[0]);
        let mut curves = self.way([first.t_s, last.t_s], Colour::Soft, Stroke::Solid);
        let mut entries = vec![entry(Colour::Soft, Stroke::Solid, "no fault is active")];
        for life in faults.iter().filter(|life| life.was_present()) {
            let stroke = life.colour.stroke();
            for span in life.presence() {
                curves.extend(self.way(span, life.colour, stroke));
            }
            entries.push(entry(
                life.colour,
                stroke,
                &format!("{} is active", life.name),
            ));
        }
        curves.extend(self.arrows(arrow_m));
        let dots = |points: Vec<(f64, f64)>, colour: Colour| Curve {
            colour,
            stroke: Stroke::Dots,
            points,
        };
        curves.push(dots(
            vec![(first.x, first.y), (last.x, last.y)],
            Colour::Ink,
        ));
        for [from_s, _] in alarms.iter().take(50) {
            if let Some(at) = self.at(*from_s) {
                curves.push(dots(vec![at], Colour::Alarm));
                labels.push(label(at, format!("alarm, {from_s:.1} s")));
            }
        }
        let chart = Chart {
            caption: "Path of the robot in the plane".to_owned(),
            size: SIZE,
            x: Axis::between("x, m", xs, 8.0),
            y: Axis::between("y, m", ys, 6.0),
            curves,
            labels,
        };
        format!("{}{}\n", key(&entries), chart.with_equal_scales().svg())
    }
}

/// An arrowhead at the end of a way.
fn arrow(way: &[Place; 2], length_m: f64) -> Curve {
    let [a, b] = way;
    let length = a.distance(b).max(1e-9);
    let (ux, uy) = ((b.x - a.x) / length, (b.y - a.y) / length);
    let corner = |along: f64, aside: f64| {
        let [along, aside] = [along * length_m, aside * length_m];
        (b.x + along * ux - aside * uy, b.y + along * uy + aside * ux)
    };
    Curve {
        colour: Colour::Ink,
        stroke: Stroke::Area,
        points: vec![corner(0.6, 0.0), corner(-0.4, 0.4), corner(-0.4, -0.4)],
    }
}

fn entry(colour: Colour, stroke: Stroke, name: &str) -> KeyEntry {
    KeyEntry {
        colour,
        stroke,
        name: name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(places: impl Iterator<Item = (f64, f64)>) -> Path {
        let mut path = Path {
            channels: Some([0, 1]),
            places: Vec::new(),
            step_m: STEP_M,
            last: None,
            resets: None,
            is_broken: false,
        };
        for (i, (x, y)) in places.enumerate() {
            let mut frame = SensorFrame::default();
            frame.set_channel(0, x);
            frame.set_channel(1, y);
            path.take(i as f64 * 0.1, &frame);
        }
        path
    }

    #[test]
    fn a_long_way_keeps_its_outermost_places() {
        let place = |i: u32| match i {
            50_000 => (f64::from(i) * 0.01, 300.0),
            i => (f64::from(i) * 0.01, (f64::from(i) * 0.01).sin()),
        };
        let path = path((0..100_000).map(place));
        assert!(path.places.len() <= POINTS_MAX);
        assert!(path.places.iter().any(|place| place.y == 300.0));
        assert!(path.chart(&[], &[[3.0, 4.0]]).contains("alarm, 3.0 s"));
    }

    #[test]
    fn what_is_no_place_breaks_the_way_and_a_standing_robot_has_a_page() {
        let gap = |i: u32| {
            if i == 5 {
                (f64::NAN, 0.0)
            } else {
                (f64::from(i), 0.0)
            }
        };
        let broken = path((0..10).map(gap));
        let way = broken.way([0.0, 2.0], Colour::Soft, Stroke::Solid);
        assert_eq!(way.len(), 2);
        assert!((broken.at(0.25).unwrap().0 - 2.5).abs() < 1e-9);
        let standing = path((0..10).map(|_| (1.0, 1.0)));
        let chart = standing.chart(&[], &[]);
        assert!(chart.contains("start") && !chart.contains("NaN"));
        let nowhere = path((0..3).map(|_| (f64::NAN, 1.0)));
        assert!(nowhere.chart(&[], &[]).contains("No pose was measured"));
    }
}

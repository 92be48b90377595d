//! A curve of any length in a bounded number of points, from which no spike is lost.

use crate::columns::{Column, Columns};

/// Columns of a trace at most, as many as a chart has pixels beside each other.
const COLUMNS: u32 = 1024;
/// Seconds that a column has at first.
const WIDTH_S: f64 = 1e-3;

/// A time, s, and the value then.
type Sample = (f64, f64);

/// What a trace keeps of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Extremes {
    first: Sample,
    min: Sample,
    max: Sample,
    last: Sample,
    /// True if the curve is interrupted before it.
    is_after_break: bool,
}

impl Column for Extremes {
    fn join(&mut self, next: Self) {
        self.last = next.last;
        if next.min.1 < self.min.1 {
            self.min = next.min;
        }
        if next.max.1 > self.max.1 {
            self.max = next.max;
        }
    }
}

impl Extremes {
    const fn new(point: Sample, is_after_break: bool) -> Self {
        Self {
            first: point,
            min: point,
            max: point,
            last: point,
            is_after_break,
        }
    }

    /// Its points in the order of time, none twice.
    fn points(&self) -> Vec<(f64, f64)> {
        let mut points = vec![self.first, self.min, self.max, self.last];
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup();
        points
    }
}

/// A value over time. However much is added, it keeps the least and the greatest value of each
/// column of time, and the first and the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    columns: Columns<Extremes>,
    is_broken: bool,
    /// The least and the greatest value so far.
    bounds: Option<[f64; 2]>,
    last: Option<(f64, f64)>,
}

impl Default for Trace {
    fn default() -> Self {
        Self {
            columns: Columns::new(COLUMNS, WIDTH_S),
            is_broken: false,
            bounds: None,
            last: None,
        }
    }
}

impl Trace {
    /// Adds a value. One that is no number, or that comes from before the beginning, interrupts the
    /// curve.
    pub fn add(&mut self, t_s: f64, value: f64) {
        if !(t_s.is_finite() && t_s >= 0.0 && value.is_finite()) {
            return self.interrupt();
        }
        let [least, greatest] = self.bounds.unwrap_or([value; 2]);
        self.bounds = Some([least.min(value), greatest.max(value)]);
        self.last = Some((t_s, value));
        let extremes = Extremes::new((t_s, value), self.is_broken);
        self.columns.add(t_s, extremes, self.is_broken);
        self.is_broken = false;
    }

    /// The curve is not drawn from here to the next value.
    pub const fn interrupt(&mut self) {
        self.is_broken = self.last.is_some();
    }

    /// The least and the greatest value.
    #[must_use]
    pub const fn bounds(&self) -> Option<[f64; 2]> {
        self.bounds
    }

    /// The last time and value.
    #[must_use]
    pub const fn last(&self) -> Option<(f64, f64)> {
        self.last
    }

    /// The greatest value, or 0.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.bounds.map_or(0.0, |[_, max]| max)
    }

    /// The pieces of the curve between interruptions, without points between others of one level.
    #[must_use]
    pub fn pieces(&self) -> Vec<Vec<(f64, f64)>> {
        let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
        for (_, column) in self.columns.iter() {
            if column.is_after_break || pieces.is_empty() {
                pieces.push(Vec::new());
            }
            let Some(piece) = pieces.last_mut() else {
                continue;
            };
            for point in column.points() {
                if let [.., a, b] = piece[..] {
                    let is_level = (a.1 - b.1).abs() < 1e-4 && (b.1 - point.1).abs() < 1e-4;
                    if is_level && a.1.abs() < 10.0 {
                        piece.pop();
                    }
                }
                piece.push(point);
            }
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(count: u32, value: impl Fn(u32) -> f64) -> Trace {
        let mut trace = Trace::default();
        for i in 0..count {
            trace.add(f64::from(i) * 0.01, value(i));
        }
        trace
    }

    #[test]
    fn no_spike_is_lost_however_long_the_curve_is() {
        let value = |i: u32| match i {
            123_456 => 9.0,
            777_777 => -9.0,
            i => f64::from(i % 7) * 0.1,
        };
        let trace = trace(1_000_000, value);
        let points = trace.pieces().concat();
        assert!(points.len() <= 4 * COLUMNS as usize, "{}", points.len());
        assert!(points.contains(&(1234.56, 9.0)), "the upper one");
        assert!(points.contains(&(7777.77, -9.0)), "the lower one");
        assert_eq!(trace.bounds(), Some([-9.0, 9.0]));
        assert!(points.is_sorted_by(|a, b| a.0 <= b.0));
    }

    #[test]
    fn what_is_no_number_interrupts_the_curve() {
        let trace = trace(10, |i| if i == 4 { f64::NAN } else { f64::from(i) });
        let pieces = trace.pieces();
        assert_eq!(pieces.len(), 2);
        assert_eq!(pieces[1][0].1, 5.0);
        assert_eq!(Trace::default().pieces(), Vec::<Vec<_>>::new());
    }

    #[test]
    fn a_level_has_two_points_and_leaps_of_time_are_no_trouble() {
        let level = trace(500, |_| 0.25);
        assert_eq!(level.pieces(), [vec![(0.0, 0.25), (4.99, 0.25)]]);
        let mut far = Trace::default();
        for t_s in [0.0, 1e12, 5.0, f64::INFINITY, -3.0, 2e12] {
            far.add(t_s, t_s);
        }
        assert_eq!(far.pieces().concat().len(), 4);
        assert_eq!(far.bounds(), Some([0.0, 2e12]));
        for i in 0..10_000 {
            far.interrupt();
            far.add(2e12, f64::from(i));
        }
        assert!(far.pieces().len() <= 2 * COLUMNS as usize + 1);
    }
}

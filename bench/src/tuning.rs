//! Tunes the settings of a rule: one after the other, each to the value with the most points.

use std::error::Error;

use serde::Serialize;
use serde_json::{Value, json};

/// Rounds over all settings; fewer if one changes nothing.
const ROUNDS: u32 = 4;

/// Settings, tuned.
#[derive(Debug, Clone)]
pub struct Tuned<S> {
    /// The best that were found.
    pub best: S,
    /// Their points.
    pub points: f64,
    /// All that were tried, with their points.
    pub tried: Vec<(S, f64)>,
}

impl<S: Serialize> Tuned<S> {
    /// Every trial as numbers.
    #[must_use]
    pub fn document(&self) -> Value {
        let row = |(settings, points): &(S, f64)| json!({"rule": settings, "points": points});
        let tried: Vec<Value> = self.tried.iter().map(row).collect();
        json!({"best": self.best, "points": self.points, "tried": tried})
    }
}

/// Tunes settings from `start`. `varied` gives them with each value of one of their dimensions,
/// `points` measures them, `said` takes a line of progress.
///
/// # Errors
/// Those of `points`.
pub fn tune<S: Copy + PartialEq + Serialize>(
    start: S,
    dimensions: usize,
    varied: impl Fn(S, usize) -> Vec<S>,
    points: impl Fn(S) -> Result<f64, Box<dyn Error>>,
    said: impl Fn(&str),
) -> Result<Tuned<S>, Box<dyn Error>> {
    let first = points(start)?;
    let mut tuned = Tuned {
        best: start,
        points: first,
        tried: vec![(start, first)],
    };
    for round in 1..=ROUNDS {
        let before = tuned.best;
        for dimension in 0..dimensions {
            for settings in varied(tuned.best, dimension) {
                let known = tuned.tried.iter().find(|(tried, _)| *tried == settings);
                let found = match known {
                    Some((_, found)) => *found,
                    None => {
                        let found = points(settings)?;
                        tuned.tried.push((settings, found));
                        found
                    }
                };
                if found > tuned.points {
                    (tuned.best, tuned.points) = (settings, found);
                }
            }
            let (points, best) = (tuned.points, json!(tuned.best));
            said(&format!("round {round}: {points:.1} by {best}"));
        }
        if tuned.best == before {
            break;
        }
    }
    Ok(tuned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn each_setting_is_tuned_and_none_is_measured_twice() {
        let measured = Cell::new(0);
        let points = |[x, y]: [i32; 2]| {
            measured.set(measured.get() + 1);
            Ok(-f64::from((x - 3).pow(2) + (y - 1).pow(2)))
        };
        let varied = |[x, y]: [i32; 2], dimension| -> Vec<[i32; 2]> {
            (0..5)
                .map(|v| if dimension == 0 { [v, y] } else { [x, v] })
                .collect()
        };
        let tuned = tune([0, 0], 2, varied, points, |_| {}).unwrap();
        assert_eq!((tuned.best, tuned.points), ([3, 1], 0.0));
        // Five of x, four more of y, and in the second round four more of x beside the best y.
        assert_eq!((measured.get(), tuned.tried.len()), (13, 13));
    }
}

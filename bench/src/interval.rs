//! A mean with its interval.

use serde_json::{Value, json};

/// A mean with the half width of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Mean.
    pub mean: f64,
    /// Half width.
    pub half_width: f64,
}

impl Interval {
    /// The lower end.
    pub(crate) fn lower(self) -> f64 {
        self.mean - self.half_width
    }

    pub(crate) fn text(self, decimals: usize, is_difference: bool) -> String {
        let Self { mean, half_width } = self;
        match is_difference {
            true => format!("{mean:+.decimals$} ± {half_width:.decimals$}"),
            false => format!("{mean:.decimals$} ± {half_width:.decimals$}"),
        }
    }

    pub(crate) fn document(self) -> Value {
        json!({"mean": self.mean, "half_width_95": self.half_width})
    }
}

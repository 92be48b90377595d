//! Which commands a log covers: on others a model knows less.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::AXES;
use super::observation::Observation;

/// Growth of the deviation per width of the learned range by which a command lies outside it.
/// Chosen: a quarter of the range outside doubles it.
const EXTRAPOLATION: f64 = 4.0;
/// Gaps of a range. Learning takes one for a gap if it is wider than 0.15 of the range (`GAP` in
/// `channel_learning::excitation`): six at most, one fewer than this.
const GAPS_MAX: usize = 7;
/// Products of a model at most: of four axes to the second order there are 15.
const COMBINATIONS_MAX: usize = 15;
/// Novelty of a combination of commands above which it counts as not driven. The mean over what was
/// driven is one. Chosen: some rare moments of any log reach ten.
const NOVEL: f64 = 10.0;

/// What was learned of one axis of the command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Name of the axis.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Smallest value learned from.
    pub min: f64,
    /// Largest value learned from.
    pub max: f64,
    /// Size by which the axis is divided in products: its largest magnitude in the whole log.
    pub size: f64,
    /// Stretches within these bounds in which nothing was learned from, each from the last value
    /// below to the first above.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gaps: Vec<[f64; 2]>,
}

impl Range {
    /// How far a command lies outside the range, or from the ends of the gap that it lies in, in
    /// units of the range's width.
    #[must_use]
    pub fn beyond(&self, value: f64) -> f64 {
        let outside = (self.min - value).max(value - self.max).max(0.0);
        let within = self
            .gaps
            .iter()
            .map(|[from, to]| (value - from).min(to - value));
        within.fold(outside, f64::max) / (self.max - self.min).max(1e-9)
    }

    /// True if its numbers make sense.
    pub(super) fn is_sane(&self) -> bool {
        let inside = |[from, to]: &[f64; 2]| self.min <= *from && from < to && *to <= self.max;
        let bounds = self.min.is_finite() && self.max.is_finite() && self.max >= self.min;
        let sized = (1e-9..=1e9).contains(&self.size);
        bounds && sized && self.gaps.len() <= GAPS_MAX && self.gaps.iter().all(inside)
    }
}

/// Which combinations of the axes a log covers. Its *novelty* is the leverage of a command in a
/// regression on products of the axes, relative to the mean over the log (Belsley, Kuh and Welsch,
/// *Regression Diagnostics*, 1980, chapter 2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Combinations {
    /// Powers of the axes in each product.
    pub powers: Vec<[u8; AXES]>,
    /// Inverse of the mean products of these over the log, by rows.
    pub precision: Vec<Vec<f64>>,
}

impl Combinations {
    /// Novelty of a command, each axis divided by its learned size; 0 without products.
    #[must_use]
    pub fn novelty(&self, command: &[f64; AXES]) -> f64 {
        let value = |powers: &[u8; AXES]| product(powers, command);
        let rows = self.powers.iter().zip(&self.precision);
        let square: f64 = rows
            .map(|(powers, row)| {
                let along = row.iter().zip(&self.powers);
                let along: f64 = along.map(|(k, powers)| k * value(powers)).sum();
                value(powers) * along
            })
            .sum();
        square.max(0.0) / self.powers.len().max(1) as f64
    }

    /// True if its numbers make sense.
    pub(super) fn is_sane(&self) -> bool {
        let count = self.powers.len();
        let square =
            self.precision.len() == count && self.precision.iter().all(|row| row.len() == count);
        let mut values = self.precision.iter().flatten();
        square && count <= COMBINATIONS_MAX && values.all(|value| value.is_finite())
    }
}

/// Product of powers of a command's axes.
#[must_use]
pub fn product(powers: &[u8; AXES], command: &[f64; AXES]) -> f64 {
    let axes = powers.iter().zip(command).filter(|(power, _)| **power > 0);
    axes.map(|(&power, value)| (1..power).fold(*value, |product, _| product * value))
        .product()
}

/// A command, each axis divided by its learned size.
#[must_use]
pub fn scaled(command: &[f64; AXES], ranges: &[Range]) -> [f64; AXES] {
    let mut scaled = *command;
    for (value, range) in scaled.iter_mut().zip(ranges) {
        *value /= range.size;
    }
    scaled
}

/// Factor on all deviations for a command outside the ranges learned from, or in a combination that
/// was not driven.
#[must_use]
pub fn widening(ranges: &[Range], combinations: &Combinations, now: &Observation) -> f64 {
    // A robot at rest is known.
    if !now.moving {
        return 1.0;
    }
    let axes = ranges.iter().zip(&now.command);
    let beyond = axes.map(|(range, value)| range.beyond(*value));
    let outside = 1.0 + EXTRAPOLATION * beyond.fold(0.0, f64::max);
    let novelty = combinations.novelty(&scaled(&now.command, ranges));
    outside * (novelty / NOVEL).max(1.0).sqrt()
}

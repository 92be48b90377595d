//! Columns of several runs in equal cells of time, and how they go together.

use super::clock::TimeColumn;
use crate::survey::{SurveyTable, Values};

/// Longest time for which a command is taken to hold here, s. Chosen by hand: drivers repeat
/// commands, and an old one would only blur what is compared.
const HOLD_S: f64 = 2.0;
/// Cells by which a command may lead what follows from it.
const LEAD_MAX: usize = 5;
/// Correlation from which two signals of a run count as going together.
const TOGETHER: f64 = 0.8;
/// How far a cell may be from a first fit to count for the second, as a share of what it says: a
/// robot that stands is a whole share away.
const NEAR: f64 = 0.5;
/// Cells that a fit needs.
const CELLS_MIN: usize = 30;

/// How a column is brought to a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum How {
    /// Mean of its values there.
    Mean,
    /// The last value before its end.
    Hold,
    /// Rate of change of a position or counter, with its modulus.
    Rate(Option<f64>),
    /// The same of an angle, rad.
    AngleRate(f64),
}

/// One run.
struct RunData {
    tables: Vec<SurveyTable>,
    clocks: Vec<Option<Vec<f64>>>,
    start_s: f64,
    cells: usize,
}

/// Several runs.
pub(super) struct Signals {
    runs: Vec<RunData>,
    /// Length of a cell, s.
    pub cell_s: f64,
}

impl Signals {
    /// Runs with the same tables, of which those in `used` matter.
    pub fn new(runs: Vec<Vec<SurveyTable>>, used: &[usize]) -> Self {
        let mut period_s = 0.0_f64;
        let mut prepared = Vec::new();
        for tables in runs {
            let clocks: Vec<Option<Vec<f64>>> = clocks(&tables, used);
            let (mut start_s, mut end_s) = (f64::NEG_INFINITY, f64::INFINITY);
            for clock in used.iter().filter_map(|&at| clocks.get(at)?.as_ref()) {
                let finite = || clock.iter().copied().filter(|t| t.is_finite());
                start_s = start_s.max(finite().fold(f64::INFINITY, f64::min));
                end_s = end_s.min(finite().fold(f64::NEG_INFINITY, f64::max));
                let length_s = finite().fold(f64::NEG_INFINITY, f64::max)
                    - finite().fold(f64::INFINITY, f64::min);
                period_s = period_s.max(length_s / clock.len().max(1) as f64);
            }
            prepared.push((tables, clocks, start_s, end_s));
        }
        // Two samples of the slowest table fall into a cell.
        let cell_s = (2.0 * period_s).clamp(0.1, 1.0);
        let run = |(tables, clocks, start_s, end_s): (Vec<SurveyTable>, Vec<_>, f64, f64)| {
            let cells = ((end_s - start_s) / cell_s).floor().clamp(0.0, 1e6);
            RunData {
                tables,
                clocks,
                start_s,
                cells: if cells.is_finite() { cells as usize } else { 0 },
            }
        };
        Self {
            runs: prepared.into_iter().map(run).collect(),
            cell_s,
        }
    }

    /// A column's cells, run after run; not a number where there is none.
    pub fn cells(&self, table: usize, column: &str, how: How) -> Vec<f64> {
        let mut out = Vec::new();
        for run in &self.runs {
            let from = out.len();
            out.resize(from + run.cells, f64::NAN);
            let values = run
                .tables
                .get(table)
                .and_then(|table| column_of(table, column));
            let clock = run.clocks.get(table).and_then(Option::as_ref);
            if let (Some(values), Some(clock), Some(cells)) = (values, clock, out.get_mut(from..)) {
                let samples = clock.iter().copied().zip(values.values.iter().copied());
                let samples = samples.filter(|(t, v)| t.is_finite() && v.is_finite());
                let (start_s, cell_s) = (run.start_s, self.cell_s);
                fill(cells, samples, &Raster { start_s, cell_s }, how);
            }
        }
        out
    }

    /// Where each run lies in what [`Self::cells`] returns.
    pub fn runs(&self) -> Vec<std::ops::Range<usize>> {
        let mut from = 0;
        let range = |run: &RunData| {
            let range = from..from + run.cells;
            from = range.end;
            range
        };
        self.runs.iter().map(range).collect()
    }

    /// The sum of columns, each with a factor.
    pub fn sum(&self, table: usize, terms: &[(String, f64)], how: How) -> Vec<f64> {
        let mut out = Vec::new();
        for (column, factor) in terms {
            let cells = self.cells(table, column, how);
            out.resize(cells.len(), 0.0);
            out.iter_mut()
                .zip(cells)
                .for_each(|(sum, cell)| *sum += factor * cell);
        }
        out
    }
}

fn column_of<'a>(table: &'a SurveyTable, name: &str) -> Option<&'a Values> {
    table.columns.iter().find(|column| column.name == name)
}

/// Times of each table on one clock, s: that of arrival if all have it, else each its own.
fn clocks(tables: &[SurveyTable], used: &[usize]) -> Vec<Option<Vec<f64>>> {
    let arrival = ["log_time", "%time"].into_iter().find(|name| {
        let mut used = used.iter().filter_map(|&at| tables.get(at));
        used.all(|table| column_of(table, name).is_some())
    });
    let time = |table: &SurveyTable| match arrival.and_then(|name| column_of(table, name)) {
        Some(column) => Some(column.values.iter().map(|ns| ns * 1e-9).collect()),
        None => Some(TimeColumn::find(table)?.time_s),
    };
    tables.iter().map(time).collect()
}

/// Equal cells of time.
struct Raster {
    /// Beginning of the first, s.
    start_s: f64,
    /// Length of each, s.
    cell_s: f64,
}

fn fill(cells: &mut [f64], samples: impl Iterator<Item = (f64, f64)>, raster: &Raster, how: How) {
    let Raster { start_s, cell_s } = *raster;
    let mut samples: Vec<(f64, f64)> = samples.collect();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let How::Rate(_) | How::AngleRate(_) = how {
        unwrap(&mut samples, how);
    }
    let at = |t_s: f64| samples.partition_point(|(time_s, _)| *time_s < t_s);
    let between = |t_s: f64| {
        let next = at(t_s);
        let ((t0, v0), (t1, v1)) = (*samples.get(next.checked_sub(1)?)?, *samples.get(next)?);
        Some(v0 + (v1 - v0) * (t_s - t0) / (t1 - t0).max(1e-12))
    };
    for (i, cell) in cells.iter_mut().enumerate() {
        let from_s = start_s + i as f64 * cell_s;
        let (first, end) = (at(from_s), at(from_s + cell_s));
        let inside = samples.get(first..end).unwrap_or(&[]);
        let value = match how {
            How::Mean => {
                let sum: f64 = inside.iter().map(|(_, value)| value).sum();
                (!inside.is_empty()).then(|| sum / inside.len() as f64)
            }
            How::Hold => {
                let last = end.checked_sub(1).and_then(|last| samples.get(last));
                last.filter(|(t, _)| from_s + cell_s - t <= HOLD_S)
                    .map(|(_, value)| *value)
            }
            How::Rate(_) | How::AngleRate(_) => {
                let ends = between(from_s).zip(between(from_s + cell_s));
                ends.map(|(before, after)| (after - before) / cell_s)
            }
        };
        *cell = value.unwrap_or(f64::NAN);
    }
}

/// Takes the jumps of a counter or angle out.
fn unwrap(samples: &mut [(f64, f64)], how: How) {
    let (modulus, factor) = match how {
        How::Rate(Some(modulus)) => (modulus, 1.0),
        How::AngleRate(factor) => (std::f64::consts::TAU, factor),
        _ => return,
    };
    let (mut turns, mut last) = (0.0, None);
    for (_, value) in samples {
        *value *= factor;
        let step = *value - last.unwrap_or(*value);
        last = Some(*value);
        turns -= (step / modulus).round();
        *value += turns * modulus;
    }
}

/// How one signal follows from others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Factors of the others.
    pub factors: [f64; 2],
    /// Share of its mean square that they explain, as a correlation, 0 to 1.
    pub correlation: f64,
}

/// `y` from `u` and `v` by least squares without a constant, at the lead of these that fits best;
/// none with too few cells, or if they do not vary.
pub(super) fn fit2(y: &[f64], u: &[f64], v: &[f64]) -> Option<Fit> {
    let fits = (0..=LEAD_MAX).filter_map(|lead| Some((fit_at(y, u, v, lead, None)?, lead)));
    let (first, lead) = fits.max_by(|(a, _), (b, _)| a.correlation.total_cmp(&b.correlation))?;
    // A robot that stands though it is commanded, or has not started, says nothing of a factor.
    let second = fit_at(y, u, v, lead, Some(first.factors));
    Some(Fit {
        factors: second.map_or(first.factors, |second| second.factors),
        ..first
    })
}

/// `y` from `u` alone: the median factor of the runs in which they go together, so that runs with
/// slip or a fault do not count; of all runs if they do in none.
pub(super) fn fit_runs(y: &[f64], u: &[f64], runs: &[std::ops::Range<usize>]) -> Option<Fit> {
    let run = |run: &std::ops::Range<usize>| fit(y.get(run.clone())?, u.get(run.clone())?);
    let mut fits: Vec<Fit> = runs.iter().filter_map(run).collect();
    fits.retain(|fit| fit.correlation >= TOGETHER);
    fits.sort_by(|a, b| a.factors[0].total_cmp(&b.factors[0]));
    fits.get(fits.len() / 2).copied().or_else(|| fit(y, u))
}

/// `y` from `u` alone.
pub(super) fn fit(y: &[f64], u: &[f64]) -> Option<Fit> {
    fit2(y, u, &vec![0.0; u.len()])
}

/// The fit at one lead; with factors known about, of cells that are near what these say.
fn fit_at(y: &[f64], u: &[f64], v: &[f64], lead: usize, about: Option<[f64; 2]>) -> Option<Fit> {
    let is_near = |y: f64, u: f64, v: f64| {
        let said = about.map(|[a, b]| a * u + b * v);
        said.is_none_or(|said| (y - said).abs() <= NEAR * said.abs())
    };
    let (mut uu, mut uv, mut vv, mut uy, mut vy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut cells = 0;
    for ((y, u), v) in y.iter().skip(lead).zip(u).zip(v) {
        if y.is_finite() && u.is_finite() && v.is_finite() && is_near(*y, *u, *v) {
            uu += u * u;
            uv += u * v;
            vv += v * v;
            uy += u * y;
            vy += v * y;
            yy += y * y;
            cells += 1;
        }
    }
    if cells < CELLS_MIN || yy <= 0.0 {
        return None;
    }
    let determinant = uu * vv - uv * uv;
    let factors = if determinant > 1e-3 * uu * vv && determinant > 0.0 {
        [
            (uy * vv - vy * uv) / determinant,
            (vy * uu - uy * uv) / determinant,
        ]
    } else if uu > 0.0 && vv <= 0.0 {
        [uy / uu, 0.0]
    } else if vv > 0.0 && uu <= 0.0 {
        [0.0, vy / vv]
    } else {
        return None;
    };
    let explained = (factors[0] * uy + factors[1] * vy) / yy;
    Some(Fit {
        factors,
        correlation: explained.clamp(0.0, 1.0).sqrt(),
    })
}

/// A velocity in the world, and in the body turned by its yaw.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    /// In the pose's frame.
    pub world: [f64; 2],
    /// In the frame in which yaw is measured.
    pub body: [f64; 2],
}

/// A displacement in the world from one in the body: by a turn and a scale, `mirrored` or not.
pub(super) struct PlaneFit {
    /// Scale and angle as a complex number.
    pub factor: [f64; 2],
    /// Correlation, 0 to 1.
    pub correlation: f64,
}

/// Fits `world = factor * body`, both complex, by least squares.
pub(super) fn plane_fit(pairs: &[Moved]) -> Option<PlaneFit> {
    let first = plane_fit_of(pairs)?;
    let [re, im] = first.factor;
    let is_near = |moved: &Moved| {
        let ([wx, wy], [bx, by]) = (moved.world, moved.body);
        let (sx, sy) = (re * bx - im * by, im * bx + re * by);
        (wx - sx).hypot(wy - sy) <= NEAR * sx.hypot(sy)
    };
    let near: Vec<Moved> = pairs.iter().copied().filter(is_near).collect();
    let second = plane_fit_of(&near);
    Some(PlaneFit {
        factor: second.map_or(first.factor, |second| second.factor),
        ..first
    })
}

fn plane_fit_of(pairs: &[Moved]) -> Option<PlaneFit> {
    let (mut re, mut im, mut ww, mut bb) = (0.0, 0.0, 0.0, 0.0);
    let mut cells = 0;
    for moved in pairs {
        let ([wx, wy], [bx, by]) = (moved.world, moved.body);
        if [wx, wy, bx, by].iter().all(|value: &f64| value.is_finite()) {
            re += wx * bx + wy * by;
            im += wy * bx - wx * by;
            ww += wx * wx + wy * wy;
            bb += bx * bx + by * by;
            cells += 1;
        }
    }
    if cells < CELLS_MIN || bb <= 0.0 || ww <= 0.0 {
        return None;
    }
    Some(PlaneFit {
        factor: [re / bb, im / bb],
        correlation: (re.hypot(im) / (ww * bb).sqrt()).min(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_finds_factors_and_lead() {
        let u: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.3).sin()).collect();
        let v: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.11).cos()).collect();
        let y: Vec<f64> = (0..200_usize)
            .map(|i| match i.checked_sub(3) {
                Some(before) => 2.0 * u[before] - 0.5 * v[before],
                None => 0.0,
            })
            .collect();
        let found = fit2(&y, &u, &v).unwrap();
        assert!((found.factors[0] - 2.0).abs() < 1e-9, "{found:?}");
        assert!((found.factors[1] + 0.5).abs() < 1e-9, "{found:?}");
        assert!(found.correlation > 0.999_999);
        assert_eq!(fit(&y[..20], &u[..20]), None);
        assert_eq!(fit(&y, &vec![0.0; 200]), None);
    }

    #[test]
    fn rates_of_wrapping_counters_are_steady() {
        let samples: Vec<(f64, f64)> = (0..100)
            .map(|i| (f64::from(i) * 0.05, f64::from((i * 7) % 64)))
            .collect();
        let mut cells = [f64::NAN; 20];
        let raster = Raster {
            start_s: 0.1,
            cell_s: 0.2,
        };
        fill(
            &mut cells,
            samples.into_iter(),
            &raster,
            How::Rate(Some(64.0)),
        );
        assert!(
            cells.iter().all(|rate| (rate - 140.0).abs() < 1e-6),
            "{cells:?}"
        );
    }
}

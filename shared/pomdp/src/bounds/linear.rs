//! Linear systems x = r + g P x with a sparse, non-negative P: values of policies that are held.
//!
//! Small systems go to nalgebra's LU decomposition. Large ones are solved by the stabilised
//! bi-conjugate gradients (van der Vorst, 1992), begun anew from the true residual until that
//! stands at the rounding error; what they cannot solve goes to the LU decomposition after all.

use nalgebra::{DMatrix, DVector};

use super::{SolveError, rounding, slacks};
use crate::budget::Budget;

/// Up to this size the LU decomposition is taken at once. It decides the time alone: 48 rows take
/// below 0.1 ms by the figure of [`DENSE_MAX`].
const DENSE_SMALL: usize = 48;
/// Largest size for the LU decomposition, which cannot be stopped on the way: some 50 ms.
pub(super) const DENSE_MAX: usize = 500;
/// A pivot below this is a singular matrix; its rows have entries of the order of 1.
const PIVOT_MIN: f64 = 1e-14;
/// Rounds of bi-conjugate gradients, each from the true residual. Chosen by hand: what needs more
/// does not converge, and goes to the LU decomposition.
const ROUNDS: usize = 12;
/// Iterations of one round. Chosen by hand: each round begins anew from the true residual.
const ITERATIONS: usize = 400;
/// Residual that counts as rounding error, relative to the largest value.
const ROUNDING: f64 = 2e-15;
/// Residual beyond which an iterative answer is refused, relative to the largest value: what the
/// error of the values may be, times 1 - discount, but never less than what rounding allows.
const ACCEPTED: f64 = 1e-10;
const ACCEPTED_MIN: f64 = 1e-14;

/// A sparse matrix by rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    ends: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Rows {
    /// Adds an entry to the row that is being written.
    pub(crate) fn push(&mut self, column: usize, weight: f64) {
        self.entries.push((column as u32, weight));
    }

    /// Ends the row.
    pub(crate) fn end_row(&mut self) {
        self.ends.push(self.entries.len());
    }

    /// Entries of a row.
    pub(crate) fn row(&self, row: usize) -> &[(u32, f64)] {
        let first = if row == 0 { 0 } else { self.ends[row - 1] };
        &self.entries[first..self.ends[row]]
    }

    fn times(&self, row: usize, x: &[f64]) -> f64 {
        let terms = self.row(row).iter();
        terms.map(|(column, w)| w * x[*column as usize]).sum()
    }

    /// True if a row has no entry.
    pub(crate) fn is_empty(&self, row: usize) -> bool {
        self.row(row).is_empty()
    }

    /// Most entries of a row.
    pub(crate) fn longest(&self) -> usize {
        let rows = 0..self.ends.len();
        rows.map(|row| self.row(row).len()).fold(0, usize::max)
    }

    /// Largest sum of a row: 1 but for the tolerance of the reader.
    pub(super) fn sum_max(&self) -> f64 {
        (0..self.ends.len())
            .map(|row| self.row(row).iter().map(|(_, w)| w).sum())
            .fold(0.0, f64::max)
    }
}

/// The system x = r + g P x.
pub(crate) struct System<'a> {
    pub rows: &'a Rows,
    pub right: &'a [f64],
    pub discount: f64,
}

impl System<'_> {
    /// The solution; `start` is a first guess.
    pub(crate) fn solve(
        &self,
        start: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let n = self.right.len();
        if n > DENSE_SMALL {
            let (x, error) = self.iterate(start, budget)?;
            if error <= ACCEPTED_MIN.max(ACCEPTED * (1.0 - self.discount)) {
                return Ok(x);
            }
            if n > DENSE_MAX {
                return Err(SolveError::Size(n));
            }
        }
        self.dense(budget)
    }

    /// A solution whose error the caller will account for, by its residual.
    pub(crate) fn solve_roughly(
        &self,
        start: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let n = self.right.len();
        if n > DENSE_SMALL {
            let (x, error) = self.iterate(start, budget)?;
            if error <= ACCEPTED_MIN || n > DENSE_MAX {
                return Ok(x);
            }
        }
        self.dense(budget)
    }

    /// With discount 1, a solution that is certainly no larger than the true one (`outward` -1) or
    /// no smaller (1): r is moved by ever more, until x is on that side of its own backup. Rows
    /// without entries keep their r.
    ///
    /// # Errors
    /// [`SolveError`]; `Unbounded` if there is none, as where some rows never come to an end.
    pub(crate) fn solve_beside(
        &self,
        outward: f64,
        mut x: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let mut scale = largest(&x).max(largest(self.right));
        let error = rounding(self.rows.longest());
        for slack in slacks(self.discount, error) {
            let moved = self.right.iter().enumerate();
            let moved: Vec<f64> = moved
                .map(|(row, r)| match self.rows.is_empty(row) {
                    true => *r,
                    false => r + outward * slack * scale,
                })
                .collect();
            let system = System {
                right: &moved,
                ..*self
            };
            x = system.solve_roughly(x, budget)?;
            for (row, value) in x.iter_mut().enumerate() {
                if self.rows.is_empty(row) {
                    *value = self.right[row];
                }
            }
            scale = scale.max(largest(&x));
            let residual = self.residual(&x).into_iter().enumerate();
            let mut inner = residual.filter(|(row, _)| !self.rows.is_empty(*row));
            if inner.all(|(_, left)| outward * left <= -4.0 * error * scale) {
                return Ok(x);
            }
        }
        Err(SolveError::Unbounded(self.discount))
    }

    /// r + g P x - x.
    pub(crate) fn residual(&self, x: &[f64]) -> Vec<f64> {
        let rows = self.right.iter().zip(x).enumerate();
        rows.map(|(i, (r, x_i))| r + self.discount * self.rows.times(i, x) - x_i)
            .collect()
    }

    /// (1 - g P) x.
    fn apply(&self, x: &[f64], budget: &mut Budget<'_>) -> Result<Vec<f64>, SolveError> {
        budget.spend(self.rows.entries.len() + x.len())?;
        let rows = x.iter().enumerate();
        Ok(rows
            .map(|(i, x_i)| x_i - self.discount * self.rows.times(i, x))
            .collect())
    }

    fn dense(&self, budget: &mut Budget<'_>) -> Result<Vec<f64>, SolveError> {
        let unbounded = SolveError::Unbounded(self.discount);
        let n = self.right.len();
        if n == 0 {
            return Ok(Vec::new());
        }
        let mut matrix = DMatrix::<f64>::identity(n, n);
        for i in 0..n {
            for (column, w) in self.rows.row(i) {
                matrix[(i, *column as usize)] -= self.discount * w;
            }
        }
        budget.spend(n * n)?;
        let factors = matrix.lu();
        let singular = |p: &f64| p.is_nan() || p.abs() < PIVOT_MIN;
        if factors.u().diagonal().iter().any(singular) {
            return Err(unbounded);
        }
        let solve = |right: &[f64]| factors.solve(&DVector::from_column_slice(right));
        let mut x = solve(self.right).ok_or_else(|| unbounded.clone())?;
        let residual = self.residual(x.as_slice());
        x += solve(&residual).ok_or_else(|| unbounded.clone())?;
        if x.iter().any(|v| !v.is_finite()) {
            return Err(unbounded);
        }
        Ok(x.as_slice().to_vec())
    }

    /// The best that bi-conjugate gradients find, and its residual relative to the largest value.
    fn iterate(
        &self,
        mut x: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<(Vec<f64>, f64), SolveError> {
        let mut best = (x.clone(), f64::INFINITY);
        for _ in 0..ROUNDS {
            let residual = self.residual(&x);
            let size = largest(&residual) / largest(&x).max(largest(self.right)).max(1e-300);
            if size.is_nan() || size >= 0.5 * best.1 {
                break;
            }
            best = (x.clone(), size);
            if size <= ROUNDING {
                break;
            }
            for (x, d) in x.iter_mut().zip(self.gradients(&residual, budget)?) {
                *x += d;
            }
        }
        Ok(best)
    }

    /// One round for (1 - g P) d = right.
    fn gradients(&self, right: &[f64], budget: &mut Budget<'_>) -> Result<Vec<f64>, SolveError> {
        let n = right.len();
        let (mut d, mut r) = (vec![0.0; n], right.to_vec());
        let shadow = r.clone();
        let mut p = r.clone();
        let mut rho = dot(&shadow, &r);
        let enough = 1e-13 * largest(right);
        for _ in 0..ITERATIONS {
            let v = self.apply(&p, budget)?;
            let alpha = rho / dot(&shadow, &v);
            let s: Vec<f64> = r.iter().zip(&v).map(|(r, v)| r - alpha * v).collect();
            let t = self.apply(&s, budget)?;
            let omega = dot(&t, &s) / dot(&t, &t);
            if !(alpha.is_finite() && omega.is_finite()) {
                if alpha.is_finite() {
                    add(&mut d, alpha, &p);
                }
                break;
            }
            add(&mut d, alpha, &p);
            add(&mut d, omega, &s);
            r = s.iter().zip(&t).map(|(s, t)| s - omega * t).collect();
            if largest(&r) <= enough {
                break;
            }
            let next = dot(&shadow, &r);
            let beta = next / rho * alpha / omega;
            if !beta.is_finite() {
                break;
            }
            rho = next;
            for i in 0..n {
                p[i] = r[i] + beta * (p[i] - omega * v[i]);
            }
        }
        Ok(d)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(x: &mut [f64], factor: f64, y: &[f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        *x += factor * y;
    }
}

pub(crate) fn largest(x: &[f64]) -> f64 {
    // NaN must not hide.
    x.iter().fold(
        0.0,
        |m, v| {
            if v.is_nan() { f64::NAN } else { v.abs().max(m) }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of n states, half of it left at each step.
    fn ring(n: usize) -> Rows {
        let mut rows = Rows::default();
        for i in 0..n {
            rows.push((i + 1) % n, 0.5);
            rows.push((i * 7 + 3) % n, 0.5);
            rows.end_row();
        }
        rows
    }

    #[test]
    fn both_ways_solve_the_same_system() {
        let rows = ring(150);
        let right: Vec<f64> = (0..150).map(|i| f64::from(i % 11) - 4.0).collect();
        for discount in [0.5, 0.95, 0.999, 0.99999] {
            let system = System {
                rows: &rows,
                right: &right,
                discount,
            };
            let mut never = || false;
            let mut budget = Budget::new(&mut never);
            let dense = system.dense(&mut budget).unwrap();
            let (iterated, _) = system.iterate(vec![0.0; 150], &mut budget).unwrap();
            for (a, b) in dense.iter().zip(&iterated) {
                let error = (a - b).abs() / largest(&dense);
                assert!(error < 1e-9, "{discount}: {a} {b}");
            }
            assert!(largest(&system.residual(&dense)) < 1e-9 * largest(&dense));
        }
    }

    #[test]
    fn no_equation_has_no_solution_to_find() {
        let rows = Rows::default();
        let system = System {
            rows: &rows,
            right: &[],
            discount: 0.5,
        };
        let mut never = || false;
        let mut budget = Budget::new(&mut never);
        assert_eq!(system.solve(Vec::new(), &mut budget), Ok(Vec::new()));
        assert_eq!(
            system.solve_roughly(Vec::new(), &mut budget),
            Ok(Vec::new())
        );
    }

    #[test]
    fn a_ring_without_discount_has_no_value() {
        for n in [10, 150] {
            let (rows, right) = (ring(n), vec![1.0; n]);
            let system = System {
                rows: &rows,
                right: &right,
                discount: 1.0,
            };
            let mut never = || false;
            let found = system.solve(vec![0.0; n], &mut Budget::new(&mut never));
            assert_eq!(found, Err(SolveError::Unbounded(1.0)));
        }
    }
}

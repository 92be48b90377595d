//! How well missions determine the numbers that were learned from them.
//!
//! Expected counts say how often a row was visited, not how surely: where states are hard to tell,
//! a visit is worth less, and what one number is uncertain by, others are too. Each mission's
//! score, s_i = N_i - N theta_i in the logarithms of the probabilities, says what it would change;
//! the sum of s s' over missions estimates the information in all of them (Berndt, Hall, Hall,
//! Hausman 1974), to which the prior adds K (diag theta - theta theta') for each row. Its inverse
//! is the covariance of the logarithms, and J C J with J = diag theta - theta theta' that of theta.
//! Beyond a size only the diagonal is taken: uncertainty is then shared by none, and comes out too
//! small.

use nalgebra::DMatrix;

use super::layout::Layout;

/// Probabilities up to which they are taken together: 18 MB a matrix.
const TOGETHER_MAX: usize = 1500;
/// Missions that are added to the matrix at once.
const BATCH: usize = 64;
/// Keeps what nothing is known of from being infinite.
const LEAST: f64 = 1e-6;

/// The information about all probabilities but those that are 0 or 1.
pub(super) struct Information<'a> {
    layout: &'a Layout,
    theta: &'a [f64],
    /// Places of the free probabilities, and for each place its number among them.
    free: Vec<usize>,
    number: Vec<Option<usize>>,
    missions: f64,
    sums: Vec<f64>,
    squares: Vec<f64>,
    /// sum s s', and scores that wait to be added, a column a mission.
    matrix: Option<(DMatrix<f64>, DMatrix<f64>)>,
    waiting: usize,
}

impl<'a> Information<'a> {
    pub(super) fn new(layout: &'a Layout, theta: &'a [f64]) -> Self {
        let is_free = |at: &usize| theta[*at] > 0.0 && theta[*at] < 1.0;
        let free: Vec<usize> = (0..theta.len()).filter(is_free).collect();
        let mut number = vec![None; theta.len()];
        for (index, &at) in free.iter().enumerate() {
            number[at] = Some(index);
        }
        let size = free.len();
        let matrix = (size <= TOGETHER_MAX)
            .then(|| (DMatrix::zeros(size, size), DMatrix::zeros(size, BATCH)));
        Self {
            layout,
            theta,
            free,
            number,
            missions: 0.0,
            sums: vec![0.0; size],
            squares: vec![0.0; size],
            matrix,
            waiting: 0,
        }
    }

    /// Adds a mission by its expected counts.
    pub(super) fn add(&mut self, counts: &[f64]) {
        self.missions += 1.0;
        for row in self.layout.rows() {
            let visits: f64 = counts[row.clone()].iter().sum();
            for at in row {
                let Some(index) = self.number[at] else {
                    continue;
                };
                let score = counts[at] - visits * self.theta[at];
                self.sums[index] += score;
                self.squares[index] += score * score;
                if let Some((_, scores)) = &mut self.matrix {
                    scores[(index, self.waiting)] = score;
                }
            }
        }
        self.waiting += 1;
        if self.waiting == BATCH {
            self.flush();
        }
    }

    fn flush(&mut self) {
        if let Some((sum, scores)) = &mut self.matrix {
            sum.gemm(1.0, scores, &scores.transpose(), 1.0);
            scores.fill(0.0);
        }
        self.waiting = 0;
    }

    /// For each probability, the visits of its row that would determine it as well as missions and
    /// prior (`kappa`) together do; 0 for those that are 0 or 1.
    pub(super) fn visits(mut self, kappa: &[f64]) -> Vec<f64> {
        self.flush();
        let variances = match self.matrix.take() {
            Some((sum, _)) => self.together(sum, kappa),
            None => None,
        };
        let variances = variances.unwrap_or_else(|| self.alone(kappa));
        let mut visits = vec![0.0; self.theta.len()];
        for (&at, variance) in self.free.iter().zip(variances) {
            let p = self.theta[at];
            visits[at] = p * (1.0 - p) / variance;
        }
        visits
    }

    /// Variance of each theta from the diagonal: the score of theta_i alone, the rest of the row
    /// keeping its proportions, is s_i / (theta_i (1 - theta_i)).
    fn alone(&self, kappa: &[f64]) -> Vec<f64> {
        let mut variances = vec![0.0; self.free.len()];
        for row in self.layout.rows() {
            let prior: f64 = kappa[row.clone()].iter().sum();
            for at in row {
                if let Some(index) = self.number[at] {
                    let spread = self.theta[at] * (1.0 - self.theta[at]);
                    let centred = self.squares[index] - self.sums[index].powi(2) / self.missions;
                    let information = centred.max(0.0) + prior * spread + LEAST;
                    variances[index] = spread * spread / information;
                }
            }
        }
        variances
    }

    /// Variance of each theta, all taken together; `None` if the matrix cannot be inverted.
    fn together(&self, mut matrix: DMatrix<f64>, kappa: &[f64]) -> Option<Vec<f64>> {
        let size = self.free.len();
        for j in 0..size {
            for i in 0..size {
                matrix[(i, j)] -= self.sums[i] * self.sums[j] / self.missions;
            }
            matrix[(j, j)] += LEAST;
        }
        let rows: Vec<Vec<usize>> = self.layout.rows().map(|row| self.among(row)).collect();
        for (row, places) in rows.iter().zip(self.layout.rows()) {
            let prior: f64 = kappa[places].iter().sum();
            for &i in row {
                for &j in row {
                    // Scores of a row sum to 0; the 1 fills that direction, which J takes out.
                    matrix[(i, j)] += prior * self.spread(i, j) + 1.0;
                }
            }
        }
        let covariance = matrix.cholesky()?.inverse();
        let mut variances = vec![0.0; size];
        for row in &rows {
            for &i in row {
                let pairs = row.iter().flat_map(|&k| row.iter().map(move |&l| (k, l)));
                let terms =
                    pairs.map(|(k, l)| self.spread(i, k) * covariance[(k, l)] * self.spread(l, i));
                variances[i] = terms.sum::<f64>();
            }
        }
        variances.iter().all(|v| *v > 0.0).then_some(variances)
    }

    /// Numbers of the free probabilities of a row.
    fn among(&self, row: std::ops::Range<usize>) -> Vec<usize> {
        row.filter_map(|at| self.number[at]).collect()
    }

    /// An entry of diag theta - theta theta', within a row.
    fn spread(&self, i: usize, j: usize) -> f64 {
        let (p, q) = (self.theta[self.free[i]], self.theta[self.free[j]]);
        if i == j { p * (1.0 - p) } else { -p * q }
    }
}

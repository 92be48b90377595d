//! Rows and squares over the blocks of a window.

use std::cmp::Ordering;

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Blocks of a window.
pub const BLOCKS: usize = 8;

/// A value for each block, the oldest first.
pub type Row = [f64; BLOCKS];
/// A square of such.
pub type Square = [[f64; BLOCKS]; BLOCKS];

/// Cholesky factor of the lower right part of a positive definite square, from `first` on.
fn factor(square: &Square, first: usize) -> Option<Cholesky<f64, Dyn>> {
    let n = BLOCKS - first;
    DMatrix::from_fn(n, n, |i, j| square[first + i][first + j]).cholesky()
}

/// Inverse of the lower right part of a positive definite square, from `first` on.
pub(super) fn inverse(square: &Square, first: usize) -> Option<Square> {
    Some(lower_right(&factor(square, first)?.inverse(), first))
}

/// A square that is zero but for its lower right part, which begins with `first`.
fn lower_right(part: &DMatrix<f64>, first: usize) -> Square {
    let at = |i: usize, j: usize| match (i.checked_sub(first), j.checked_sub(first)) {
        (Some(i), Some(j)) => part[(i, j)],
        _ => 0.0,
    };
    std::array::from_fn(|i| std::array::from_fn(|j| at(i, j)))
}

/// What is on and below the diagonal of a square; the diagonal counts half.
pub(super) fn lower(square: &Square) -> Square {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| match i.cmp(&j) {
            Ordering::Greater => square[i][j],
            Ordering::Equal => 0.5 * square[i][j],
            Ordering::Less => 0.0,
        })
    })
}

/// What makes values independent whose covariance is the lower right part of a square, the oldest
/// first: transpose of the inverse of its Cholesky factor.
pub(super) fn whitening(square: &Square, first: usize) -> Option<Square> {
    let n = BLOCKS - first;
    let factor = factor(square, first)?.l();
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(n, n))?;
    Some(lower_right(&inverse.transpose(), first))
}

/// What makes them independent, the newest first; those before that part stay as they are.
pub(super) fn whitening_backwards(square: &Square, first: usize) -> Option<Square> {
    let reversed = |square: &Square| -> Square {
        let last = BLOCKS - 1;
        std::array::from_fn(|i| std::array::from_fn(|j| square[last - i][last - j]))
    };
    let mut filled = *square;
    for (i, row) in filled.iter_mut().enumerate().take(first) {
        row[i] = 1.0;
    }
    Some(reversed(&whitening(&reversed(&filled), 0)?))
}

pub(super) fn along(vector: &[f64], rows: &[Row]) -> Row {
    let mut out = [0.0; BLOCKS];
    for (share, row) in vector.iter().zip(rows) {
        out.iter_mut().zip(row).for_each(|(a, b)| *a += share * b);
    }
    out
}

/// Product of a row and a square; if the square is symmetric, of the square and a column.
pub(super) fn product(square: &Square, row: &Row) -> Row {
    let mut out = [0.0; BLOCKS];
    for (value, from) in row.iter().zip(square) {
        out.iter_mut().zip(from).for_each(|(a, b)| *a += value * b);
    }
    out
}

/// Sums of a row's values from each block on.
pub(super) fn sums_from(mut row: Row) -> Row {
    for block in (0..BLOCKS - 1).rev() {
        row[block] += row[block + 1];
    }
    row
}

/// Products of two rows, block by block.
pub(super) fn by_block(one: &Row, other: &Row) -> Row {
    std::array::from_fn(|block| one[block] * other[block])
}

/// In four sums that do not wait for each other.
pub(super) fn dot(a: &Row, b: &Row) -> f64 {
    let mut sums = [0.0; BLOCKS / 2];
    for (a, b) in [(&a[..4], &b[..4]), (&a[4..], &b[4..])] {
        let products = a.iter().zip(b).map(|(a, b)| a * b);
        let with = sums.iter_mut().zip(products);
        with.for_each(|(sum, product)| *sum += product);
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

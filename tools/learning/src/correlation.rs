//! Pearson's correlation.

/// Of the values of each pair; 0 if one of them does not vary.
#[must_use]
pub fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len().max(1) as f64;
    let (ma, mb) = pairs
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (mut aa, mut bb, mut ab) = (1e-12, 1e-12, 0.0);
    for (x, y) in pairs {
        aa += (x - ma) * (x - ma);
        bb += (y - mb) * (y - mb);
        ab += (x - ma) * (y - mb);
    }
    ab / (aa * bb).sqrt()
}

//! How uncertain a distribution is.

/// -sum p ln p, divided by the logarithm of the number of entries: 0 certain, 1 uniform. Entries
/// need not be normalised to better than rounding; those that are 0 or negative count nothing.
#[must_use]
pub fn normalised_entropy(distribution: &[f64]) -> f64 {
    let nats: f64 = distribution.iter().map(|p| minus_p_ln_p(*p)).sum();
    normalised(nats, distribution.len())
}

/// -p ln p; 0 at 0.
pub(super) fn minus_p_ln_p(p: f64) -> f64 {
    if p > 0.0 { -p * p.ln() } else { 0.0 }
}

/// An entropy in nats over `count` possibilities, as a share of the largest possible, 0 to 1.
pub(super) fn normalised(nats: f64, count: usize) -> f64 {
    if count > 1 {
        (nats / (count as f64).ln()).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

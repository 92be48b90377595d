//! Counter-steering against several stuck wheels.

/// Gain and offset (1/m) such that a robot commanded the curvature `gain·κ + offset` nearly drives
/// κ, where `lines` are gain and offset for each stuck wheel alone. To first order the changes add
/// up. (1, 0) without any.
#[must_use]
pub fn counter_steering(lines: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    let mut lines = lines.into_iter();
    let first = lines.next().unwrap_or((1.0, 0.0));
    lines.fold(first, |(gain, offset), of| {
        (gain + of.0 - 1.0, offset + of.1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_add_up() {
        assert_eq!(counter_steering([]), (1.0, 0.0));
        assert_eq!(counter_steering([(1.1, -0.2)]), (1.1, -0.2));
        let (gain, offset) = counter_steering([(1.25, -0.2), (1.5, 0.3)]);
        assert!((gain - 1.75).abs() < 1e-12 && (offset - 0.1).abs() < 1e-12);
    }
}

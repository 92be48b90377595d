//! The downhill simplex of Nelder and Mead, for a handful of parameters.

/// Minimises `cost` from `start`, the simplex' edges being `scale`; at most `evaluations` calls.
/// Deterministic; a cost that is not a number counts as infinite.
pub fn minimise<const N: usize>(
    start: [f64; N],
    scale: f64,
    evaluations: usize,
    mut cost: impl FnMut(&[f64; N]) -> f64,
) -> [f64; N] {
    let mut value = |x: &[f64; N]| {
        let y = cost(x);
        if y.is_nan() { f64::INFINITY } else { y }
    };
    let mut corners = vec![(start, value(&start))];
    for i in 0..N {
        let mut x = start;
        x[i] += scale;
        corners.push((x, value(&x)));
    }
    let mut left = evaluations.saturating_sub(N + 1);
    while left > 1 {
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (best, second, worst) = (corners[0].1, corners[N - 1].1, corners[N]);
        if worst.1 - best < 1e-3 {
            break;
        }
        let centre: [f64; N] =
            std::array::from_fn(|i| corners[..N].iter().map(|(x, _)| x[i]).sum::<f64>() / N as f64);
        let along = |t: f64| -> [f64; N] {
            std::array::from_fn(|i| centre[i] + t * (worst.0[i] - centre[i]))
        };
        let reflected = along(-1.0);
        let y = value(&reflected);
        left -= 1;
        let (x, y) = if y < best {
            let far = along(-2.0);
            let z = value(&far);
            left -= 1;
            if z < y { (far, z) } else { (reflected, y) }
        } else if y < second {
            (reflected, y)
        } else {
            let near = along(if y < worst.1 { -0.5 } else { 0.5 });
            let z = value(&near);
            left -= 1;
            (near, z)
        };
        if y < worst.1.min(f64::MAX) {
            corners[N] = (x, y);
            continue;
        }
        let anchor = corners[0].0;
        for corner in &mut corners[1..] {
            corner.0 = std::array::from_fn(|i| 0.5 * (anchor[i] + corner.0[i]));
            corner.1 = value(&corner.0);
        }
        left = left.saturating_sub(N);
    }
    corners.sort_by(|a, b| a.1.total_cmp(&b.1));
    corners[0].0
}

#[cfg(test)]
mod tests {
    use super::minimise;

    #[test]
    fn the_banana_valley_is_followed_to_its_end() {
        let banana = |x: &[f64; 2]| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2);
        let found = minimise([-1.2, 1.0], 0.3, 400, |x| 1e6 * banana(x));
        assert!(banana(&found) < 1e-6, "{found:?}");
    }
}

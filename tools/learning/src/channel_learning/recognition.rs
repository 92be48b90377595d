//! Whether labelled runs are recognized by what runs of other groups show.

use std::collections::BTreeSet;

use vigil_robot::channel_model::signature::Evidence;

/// A run is found if its evidence exceeds this, nats, and the highest in health by a factor.
pub(super) const FOUND: f64 = 5.0;
pub(super) const FOUND_RATIO: f64 = 1.2;

/// The evidence by which a run is found, if health shows at most so much, nats.
pub(super) fn threshold(healthy_max: f64) -> f64 {
    FOUND.max(FOUND_RATIO * healthy_max)
}

/// The highest evidence over successive log-likelihood ratios, each of an observation of so many
/// seconds.
pub(super) fn highest(ratios: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut evidence = Evidence::default();
    let step = |(log_ratio, dt_s)| {
        evidence.take(log_ratio, dt_s);
        evidence.log_ratio()
    };
    ratios.map(step).fold(0.0, f64::max)
}

/// How many of these runs are found by what `learn` makes of the runs of all other groups.
pub(super) fn found_unseen<'a, R, S>(
    runs: &[&'a R],
    group: impl Fn(&'a R) -> &'a str,
    learn: impl Fn(&[&'a R]) -> Option<S>,
    is_found: impl Fn(&S, &R) -> bool,
) -> usize {
    let groups: BTreeSet<&str> = runs.iter().map(|run| group(run)).collect();
    let of_group = |left_out: &str| {
        let (own, others): (Vec<&R>, Vec<&R>) = runs.iter().partition(|run| group(run) == left_out);
        let learned = learn(&others).filter(|_| !others.is_empty());
        let found = |learned| own.iter().filter(|run| is_found(&learned, run)).count();
        learned.map_or(0, found)
    };
    groups.into_iter().map(of_group).sum()
}

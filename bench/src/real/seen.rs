//! What could be seen of a change at all, by a test that knows when it comes.
//!
//! Whitened residuals have unit variance and no memory, if the model holds. What a run adds to that
//! is measured on itself: each channel is divided by its own scatter about the means before and
//! after the change. Squares of a mean shift over these deviations add up over channels and
//! observations to the noncentrality, twice the log-likelihood ratio of a test that knows onset,
//! direction and size.

use serde::Serialize;

/// Time before and after the change from which the shift is estimated, s.
const AROUND_S: f64 = 3.0;
/// The first second after the change, and observations in it.
pub const FIRST_S: f64 = 1.0;
const FIRST: usize = 4;
/// Observations before a difference of means: at least, at most.
const BEFORE: (usize, usize) = (4, 8);
/// Observations on either side of a step.
const SIDE: usize = 4;
/// Least deviation of a whitened channel.
const DEVIATION_MIN: f64 = 0.3;

/// One observation.
#[derive(Debug, Clone)]
pub struct Observed {
    /// Its end, s.
    pub t_s: f64,
    /// Residuals over their model's deviation, the run's offset in them.
    pub residuals: Vec<f64>,
    /// Whitened residuals.
    pub whitened: Vec<f64>,
}

/// What a clairvoyant sees.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Seen {
    /// Noncentrality that a sudden step of the size that is there 1 to 3 s after the change would
    /// gather in its first second; what noise alone adds is taken off. None near the end of a run.
    pub of_step: Option<f64>,
    /// What the first second holds in that direction: the square of the matched filter's
    /// signal-to-noise ratio. Size and direction come from 1 to 3 s after the change, so that the
    /// noise of this second is in neither. None near the end of a run.
    pub first_second: Option<f64>,
    /// Squares of the difference of means that the first second shows, over their variance.
    pub difference: f64,
    /// The step that the residuals themselves show, over the whole run, s.
    pub own_change_t_s: f64,
    /// Its log-likelihood ratio against no step.
    pub own_log_ratio: f64,
}

fn mean(of: &[&Observed], channel: usize) -> f64 {
    of.iter().map(|o| o.whitened[channel]).sum::<f64>() / of.len().max(1) as f64
}

fn between(all: &[Observed], from_s: f64, to_s: f64) -> Vec<&Observed> {
    // The ends of observations fall on the frames' grid: half a frame either way.
    let inside = |o: &&Observed| o.t_s > from_s + 0.016 && o.t_s <= to_s + 0.016;
    all.iter().filter(inside).collect()
}

/// What is seen of a change at `change_t_s`; none if nothing was observed in the second after it.
#[must_use]
pub fn seen(all: &[Observed], change_t_s: f64) -> Option<Seen> {
    let before = between(all, change_t_s - AROUND_S, change_t_s);
    let first = between(all, change_t_s, change_t_s + FIRST_S);
    let later = between(all, change_t_s + FIRST_S, change_t_s + AROUND_S);
    let end_s = first.last()?.t_s;
    let found = differences(all).into_iter().find(|(t_s, _)| *t_s >= end_s);
    let (own_change_t_s, own_log_ratio) = step(all)?;
    let known = gathered(&before, &first, &later);
    Some(Seen {
        of_step: known.map(|(of_step, _)| of_step),
        first_second: known.map(|(_, first_second)| first_second),
        difference: found.map_or(0.0, |(_, difference)| difference),
        own_change_t_s,
        own_log_ratio,
    })
}

/// [`Seen::of_step`] and [`Seen::first_second`].
fn gathered(before: &[&Observed], first: &[&Observed], later: &[&Observed]) -> Option<(f64, f64)> {
    if before.len() < 2 || later.len() < 2 {
        return None;
    }
    let (b, f, l) = (before.len() as f64, first.len() as f64, later.len() as f64);
    let (mut size, mut along, mut bias) = (0.0, 0.0, 0.0);
    for channel in 0..first.first()?.whitened.len() {
        let (was, is) = (mean(before, channel), mean(later, channel));
        let about = |of: &[&Observed], mean: f64| {
            let apart = of.iter().map(|o| (o.whitened[channel] - mean).powi(2));
            apart.sum::<f64>()
        };
        let scatter = (about(before, was) + about(later, is)) / (b + l - 2.0);
        let variance = scatter.max(DEVIATION_MIN * DEVIATION_MIN);
        let shift = (is - was) / variance.sqrt();
        size += shift * shift;
        bias += 1.0 / b + 1.0 / l;
        along += shift * (mean(first, channel) - was) / variance.sqrt();
    }
    let matched = along.max(0.0) / f64::max(size, 1e-12).sqrt();
    Some((f * f64::max(size - bias, 0.0), f * matched * matched))
}

/// The step that divides a run best: its time, s, and the log-likelihood ratio, each channel with
/// its own variance on both sides together.
#[must_use]
pub fn step(all: &[Observed]) -> Option<(f64, f64)> {
    let squares = |part: &[Observed], channel: usize| {
        let n = part.len() as f64;
        let mean = part.iter().map(|o| o.residuals[channel]).sum::<f64>() / n;
        let apart = part.iter().map(|o| (o.residuals[channel] - mean).powi(2));
        apart.sum::<f64>()
    };
    let channels = all.first()?.residuals.len();
    let ratio = |at: usize| -> f64 {
        let (before, after) = all.split_at(at);
        let of = |c: usize| squares(all, c) / (squares(before, c) + squares(after, c)).max(1e-9);
        (0..channels).map(|c| of(c).ln()).sum::<f64>() * 0.5 * all.len() as f64
    };
    let places = SIDE..all.len().checked_sub(SIDE)?;
    let best = places.map(|at| (at, ratio(at)));
    let (at, ratio) = best.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((all[at - 1].t_s, ratio))
}

/// After each observation: the squares, over channels, of the difference between the mean of the
/// last second and that before it, over the variance that white noise gives it.
#[must_use]
pub fn differences(all: &[Observed]) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    let channels = all.first().map_or(0, |o| o.whitened.len());
    for at in BEFORE.0..(all.len() + 1).saturating_sub(FIRST) {
        let (before, now) = (&all[at.saturating_sub(BEFORE.1)..at], &all[at..at + FIRST]);
        let variance = 1.0 / FIRST as f64 + 1.0 / before.len() as f64;
        let of = |part: &[Observed], c: usize| mean(&part.iter().collect::<Vec<_>>(), c);
        let apart = (0..channels).map(|c| (of(now, c) - of(before, c)).powi(2));
        out.push((all[at + FIRST - 1].t_s, apart.sum::<f64>() / variance));
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// Unit noise in three channels, and from 6 s on a shift of two of them.
    fn run(seed: u64, shift: f64) -> Vec<Observed> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let of = |i: u32| {
            let t_s = 0.25 * f64::from(i + 1);
            let is = if t_s > 6.0 { shift } else { 0.0 };
            let values = [is, -is, 0.0].map(|v| v + rng.sample::<f64, _>(StandardNormal));
            Observed {
                t_s,
                residuals: values.to_vec(),
                whitened: values.to_vec(),
            }
        };
        (0..48).map(of).collect()
    }

    #[test]
    fn a_step_has_the_noncentrality_of_its_size() {
        let (mut of_step, mut first, mut own) = (0.0, 0.0, 0);
        for seed in 0..200 {
            let seen = seen(&run(seed, 3.0), 6.0).unwrap();
            of_step += seen.of_step.unwrap() / 200.0;
            first += seen.first_second.unwrap() / 200.0;
            own += u32::from((seen.own_change_t_s - 6.0).abs() < 0.3);
        }
        // Four observations of two channels, each off by 3: 72. Dividing by an estimated variance
        // of 18 degrees of freedom adds an eighth; noise along the known direction adds about 1
        // and that of the mean before a third of it.
        assert!((of_step / 81.0 - 1.0).abs() < 0.1, "{of_step}");
        assert!((first / 81.0 - 1.0).abs() < 0.1, "{first}");
        assert!(own > 190, "{own}");
    }

    #[test]
    fn noise_alone_has_none() {
        let (mut of_step, mut difference) = (0.0, 0.0);
        for seed in 0..200 {
            let all = run(1000 + seed, 0.0);
            of_step += seen(&all, 6.0).unwrap().of_step.unwrap() / 200.0;
            let found = differences(&all);
            let sum: f64 = found.iter().map(|(_, difference)| difference).sum();
            difference += sum / found.len() as f64 / 200.0;
        }
        assert!(of_step < 2.5, "{of_step}");
        // Three channels of variance 1.
        assert!((difference - 3.0).abs() < 0.3, "{difference}");
    }
}

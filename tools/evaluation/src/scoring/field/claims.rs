//! Beliefs at fixed instants of a run.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{BLIND, JUDGED_S, Run, Stretch, Truth};
use crate::scoring::{TIME_SLACK_S, Taxonomy, Verdict, log_score_nats};

/// Times after the first onset at which a belief is taken, s.
pub const CLAIMED_S: [f64; 5] = [0.5, 1.0, 2.0, 5.0, 10.0];
/// Healthy instants come so long before an onset or the end that a moment follows, s.
const APART_S: f64 = 1.0;
/// Keeps the draws of instants apart from others by the same seed.
const PURPOSE: u64 = 0x636c_6169_6d73;

/// The most probable mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Claim {
    /// Its probability.
    pub p: f64,
    /// Whether it is true.
    pub is_true: bool,
}

/// An instant at which a belief is taken: the first moment from then on.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Instant {
    t_s: f64,
    /// The stretch that must still hold.
    stretch: usize,
    is_scored: bool,
}

/// The instants of a run that are still to come, the next one last.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Instants {
    due: Vec<Instant>,
}

impl Instants {
    /// Of a run from `span_s[0]` to `span_s[1]`.
    pub(super) fn new(truth: &[Stretch], span_s: [f64; 2], seed: u64) -> Self {
        let is_fault = |stretch: &Stretch| !stretch.truth.is_healthy();
        let first = truth.iter().position(is_fault);
        let onset = first.and_then(|at| Some((at, truth.get(at)?.from_s)));
        let until_s = onset.map_or(span_s[1], |(_, from_s)| from_s) - APART_S;
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ PURPOSE);
        let mut due = Vec::new();
        if until_s > span_s[0] {
            due.extend(CLAIMED_S.map(|_| Instant {
                t_s: span_s[0] + (until_s - span_s[0]) * rng.random::<f64>(),
                stretch: 0,
                is_scored: false,
            }));
        }
        if let Some((stretch, from_s)) = onset {
            due.extend(CLAIMED_S.map(|after_s| Instant {
                t_s: from_s + after_s,
                stretch,
                is_scored: after_s == JUDGED_S[0],
            }));
        }
        due.sort_by(|a, b| b.t_s.total_cmp(&a.t_s));
        Self { due }
    }

    /// Takes what is believed if an instant has come; `at` is the stretch that holds.
    pub(super) fn take(
        &mut self,
        verdict: &Verdict,
        (at, truth): (usize, &Truth),
        taxonomy: &Taxonomy,
        run: &mut Run,
    ) {
        let is_due = |instant: &mut Instant| instant.t_s <= verdict.t_s + TIME_SLACK_S;
        while let Some(instant) = self.due.pop_if(is_due) {
            if verdict.mode == BLIND || instant.stretch != at {
                continue;
            }
            run.claims.push(truth.claim(&verdict.belief(), taxonomy));
            if instant.is_scored {
                let p = truth.p(&verdict.belief(), taxonomy);
                run.log_score_2_s_nats = p.map(log_score_nats);
            }
        }
    }
}

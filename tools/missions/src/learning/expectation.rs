//! Expected counts of one mission: the forward and the backward pass.

use super::layout::Layout;
use super::record::Record;

/// A mission that cannot happen by the model: what it holds has probability 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "step {step} (from 0) has probability 0 by the model, whatever came before; allowed is what \
     the model does not rule out"
)]
pub struct Impossible {
    /// The step, from 0.
    pub step: usize,
}

/// The passes; it keeps its memory from mission to mission.
#[derive(Debug, Clone, Default)]
pub(super) struct Passes {
    /// alpha_t(s) at t * states + s, t from 0 to T.
    forward: Vec<f64>,
    /// c_t; c_0 is the probability of the first label.
    scale: Vec<f64>,
    /// beta_t, and Z beta_{t+1} / c_{t+1}.
    backward: Vec<f64>,
    weight: Vec<f64>,
}

impl Passes {
    /// Adds the mission's expected counts to `counts`; returns its log-likelihood.
    pub(super) fn run(
        &mut self,
        layout: &Layout,
        values: &[f64],
        record: &Record,
        counts: &mut [f64],
    ) -> Result<f64, Impossible> {
        self.forward(layout, values, record)?;
        self.backward(layout, values, record, counts);
        Ok(self.scale.iter().map(|c| c.ln()).sum())
    }

    fn forward(
        &mut self,
        layout: &Layout,
        values: &[f64],
        record: &Record,
    ) -> Result<(), Impossible> {
        let (n, steps) = (layout.states, record.steps());
        self.forward.clear();
        self.forward.resize((steps + 1) * n, 0.0);
        self.scale.clear();
        for at in layout.start() {
            self.forward[layout.columns[at] as usize] = values[at];
        }
        let scale = normalise(&mut self.forward[..n], record.label(0));
        self.scale.push(scale.ok_or(Impossible { step: 0 })?);
        for t in 0..steps {
            let (action, z) = (record.actions[t] as usize, record.observations[t] as usize);
            let (past, next) = self.forward.split_at_mut((t + 1) * n);
            let (now, next) = (&past[t * n..], &mut next[..n]);
            for (state, &alpha) in now.iter().enumerate() {
                if alpha > 0.0 {
                    for at in layout.transition(action, state) {
                        next[layout.columns[at] as usize] += alpha * values[at];
                    }
                }
            }
            for (next, &at) in next.iter_mut().zip(layout.observation(action, z)) {
                *next *= Layout::value(values, at);
            }
            let scale = normalise(next, record.label(t + 1));
            self.scale.push(scale.ok_or(Impossible { step: t })?);
        }
        Ok(())
    }

    fn backward(&mut self, layout: &Layout, values: &[f64], record: &Record, counts: &mut [f64]) {
        let (n, steps) = (layout.states, record.steps());
        self.backward.clear();
        self.backward.resize(n, 1.0);
        self.weight.resize(n, 0.0);
        for t in (0..steps).rev() {
            let (action, z) = (record.actions[t] as usize, record.observations[t] as usize);
            let reached = &self.forward[(t + 1) * n..][..n];
            for (to, &at) in layout.observation(action, z).iter().enumerate() {
                // Where alpha is 0, no path leads: that keeps to the labels, too.
                let is_reached = reached[to] > 0.0;
                self.weight[to] = 0.0;
                if is_reached {
                    let beta = self.backward[to];
                    self.weight[to] = Layout::value(values, at) * beta / self.scale[t + 1];
                    counts[at as usize] += reached[to] * beta;
                }
            }
            for state in 0..n {
                let alpha = self.forward[t * n + state];
                if alpha > 0.0 {
                    let mut beta = 0.0;
                    for at in layout.transition(action, state) {
                        let p = values[at] * self.weight[layout.columns[at] as usize];
                        beta += p;
                        counts[at] += alpha * p;
                    }
                    self.backward[state] = beta;
                }
            }
        }
        for at in layout.start() {
            let state = layout.columns[at] as usize;
            counts[at] += self.forward[state] * self.backward[state];
        }
    }
}

/// Leaves only the labelled state, if there is one, and divides by the sum, which is returned;
/// `None` if nothing is left.
fn normalise(weights: &mut [f64], label: Option<u32>) -> Option<f64> {
    if let Some(label) = label {
        for (state, weight) in weights.iter_mut().enumerate() {
            if state != label as usize {
                *weight = 0.0;
            }
        }
    }
    let sum: f64 = weights.iter().sum();
    if !(sum.is_finite() && sum > 0.0) {
        return None;
    }
    weights.iter_mut().for_each(|weight| *weight /= sum);
    Some(sum)
}

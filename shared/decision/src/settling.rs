//! Whether evidence of what is wrong still comes.
//!
//! A decision model may have two states of one condition: a new one (`_NEW`), of which evidence
//! comes, and a settled one, of which none comes any more, so that what is in doubt stays in doubt.
//! Of that the identifier says nothing. That evidence ends is predicted by the model's transitions;
//! that it still comes is seen where the belief moves.

use vigil_blocks::DECISION_STATES;

use crate::states::{StateMeaning, Subject};

/// How probable it is that no more evidence comes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settling {
    p_settled: f64,
}

impl Settling {
    /// A run has begun, with nothing wrong.
    pub(crate) const SETTLED: Self = Self { p_settled: 1.0 };

    /// A step of the model has passed, and `predicted` is its belief now.
    pub(crate) fn pass(&mut self, states: &[StateMeaning], predicted: &[f64]) {
        if self.is_settled() {
            return;
        }
        let all = states.iter().zip(predicted);
        let is_new = |(meaning, _): &(&StateMeaning, &f64)| meaning.settled.is_some();
        let new: f64 = all.filter(is_new).map(|(_, p)| p).sum();
        self.p_settled += (1.0 - self.p_settled) * (1.0 - new);
    }

    /// The identifier holds `weights`, of which these were `expected`: what has come in addition
    /// to what was wrong is evidence.
    pub(crate) fn take(&mut self, states: &[StateMeaning], expected: &[f64], weights: &[f64]) {
        let (mut news, mut all) = (0.0, 0.0);
        for (meaning, (expected, weight)) in states.iter().zip(expected.iter().zip(weights)) {
            if !matches!(meaning.subject, Subject::Nominal | Subject::Done) {
                news += (weight - expected).max(0.0);
                all += weight;
            }
        }
        if all > 0.0 {
            self.p_settled *= 1.0 - news / all;
        }
    }

    /// Makes a belief in settled states one in new states, if evidence still comes.
    pub(crate) fn write(&self, states: &[StateMeaning], belief: &mut [f64]) {
        if self.is_settled() {
            return;
        }
        for (new, meaning) in states.iter().enumerate() {
            if let Some(settled) = meaning.settled {
                belief[new] = std::mem::take(&mut belief[settled]);
            }
        }
    }

    fn is_settled(&self) -> bool {
        self.p_settled > 0.5
    }
}

/// A belief in which what is new counts as settled.
pub(crate) fn settled(states: &[StateMeaning], belief: &[f64]) -> [f64; DECISION_STATES] {
    let mut out = [0.0; DECISION_STATES];
    for (state, (meaning, b)) in states.iter().zip(belief).enumerate() {
        out[meaning.settled.unwrap_or(state)] += b;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn state(subject: Subject, settled: Option<usize>) -> StateMeaning {
        StateMeaning {
            subject,
            leaves: 0,
            settled,
        }
    }

    /// ND, STUCK, UNKNOWN, each new, and the end.
    const STATES: [StateMeaning; 7] = [
        state(Subject::Nominal, None),
        state(Subject::Fault, None),
        state(Subject::Unknown, None),
        state(Subject::Nominal, Some(0)),
        state(Subject::Fault, Some(1)),
        state(Subject::Unknown, Some(2)),
        state(Subject::Done, None),
    ];

    /// The belief that is decided upon, of what is held of the settled states.
    fn written(settling: &Settling, held: [f64; 3]) -> [f64; 7] {
        let mut belief = [0.0; 7];
        belief[..3].copy_from_slice(&held);
        settling.write(&STATES, &mut belief);
        belief
    }

    /// The settling after an epoch in which the identifier came to hold `held`, of a model in
    /// which a fifth of what is new settles in an epoch.
    fn after(mut settling: Settling, before: [f64; 3], held: [f64; 3]) -> Settling {
        let believed = written(&settling, before);
        let new = |at: usize| believed[at + 3];
        let predicted: [f64; 7] = std::array::from_fn(|at| match at {
            0..3 => believed[at] + 0.2 * new(at),
            3..6 => 0.8 * believed[at],
            _ => 0.0,
        });
        settling.pass(&STATES, &predicted);
        let expected = settled(&STATES, &predicted);
        settling.take(&STATES, &expected[..7], &written(&Settling::SETTLED, held));
        settling
    }

    #[test]
    fn what_arises_is_new_and_settles_once_it_stays() {
        let nothing = [1.0, 0.0, 0.0];
        let doubt = [0.0, 0.75, 0.25];
        let healthy = after(Settling::SETTLED, nothing, nothing);
        assert_eq!(
            written(&healthy, nothing),
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        );
        let mut settling = after(healthy, nothing, doubt);
        let new = [0.0, 0.0, 0.0, 0.0, 0.75, 0.25, 0.0];
        assert_eq!(written(&settling, doubt), new);
        // 1 - 0.8^n exceeds a half at n = 4.
        for _ in 0..3 {
            settling = after(settling, doubt, doubt);
            assert_eq!(written(&settling, doubt), new);
        }
        settling = after(settling, doubt, doubt);
        assert_eq!(
            written(&settling, doubt),
            [0.0, 0.75, 0.25, 0.0, 0.0, 0.0, 0.0]
        );
        // Another name is evidence again.
        settling = after(settling, doubt, [0.0, 0.125, 0.875]);
        assert_eq!(written(&settling, doubt), new);
    }

    #[test]
    fn a_belief_that_keeps_moving_never_settles() {
        let mut settling = after(Settling::SETTLED, [1.0, 0.0, 0.0], [0.0, 0.5, 0.5]);
        let mut held = [0.0, 0.5, 0.5];
        for k in 0..100 {
            let next = if k % 2 == 0 {
                [0.0, 0.8, 0.2]
            } else {
                [0.0, 0.5, 0.5]
            };
            settling = after(settling, held, next);
            held = next;
            assert!(!settling.is_settled(), "{k}");
        }
    }
}

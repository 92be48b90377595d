//! Whether evidence of what is wrong still comes.
//!
//! A decision model may have two states of one condition: a new one (`_NEW`), of which evidence
//! comes, and a settled one, of which none comes any more, so that what is in doubt stays in doubt.
//! Of that the identifier says nothing. That evidence ends is predicted by the model's transitions;
//! that it still comes is seen where the belief moves.

use vigil_blocks::DECISION_STATES;
use vigil_checkpoint::Checkpoint;

use crate::state_belief::MOVED;
use crate::states::{StateMeaning, Subject};

/// Settled is what is so with this probability. Chosen: where half of what is new settles in an
/// epoch, three epochs without news; fewer might call for help before the evidence is in.
const SETTLED_P: f64 = 0.8;

/// How probable it is that no more evidence comes.
#[derive(Debug, Clone, Copy, PartialEq, Checkpoint)]
pub(crate) struct Settling {
    p_settled: f64,
    is_settled: bool,
    /// The last belief, in settled states.
    held: [f64; DECISION_STATES],
}

impl Settling {
    /// This is believed, in settled states; a run begins with nothing wrong.
    pub(crate) fn new(belief: &[f64]) -> Self {
        let mut held = [0.0; DECISION_STATES];
        held.iter_mut().zip(belief).for_each(|(to, b)| *to = *b);
        Self {
            p_settled: 1.0,
            is_settled: true,
            held,
        }
    }

    /// What was believed last, in settled states.
    pub(crate) const fn held(&self) -> &[f64] {
        &self.held
    }

    /// A step of the model has passed while the robot moved, and `predicted` is its belief now.
    pub(crate) fn pass(&mut self, states: &[StateMeaning], predicted: &[f64]) {
        let sum = |is_counted: fn(&StateMeaning) -> bool| -> f64 {
            let all = states.iter().zip(predicted);
            let counted = all.filter(|(meaning, _)| is_counted(meaning));
            counted.map(|(_, p)| p).sum()
        };
        let new = sum(|meaning| meaning.settles_to.is_some());
        let all = sum(|meaning| meaning.subject != Subject::Done);
        // Only news of one epoch make new what has settled.
        self.p_settled = match self.is_settled {
            true => 1.0,
            false if all > 0.0 => 1.0 - (1.0 - self.p_settled) * (new / all),
            false => self.p_settled,
        };
    }

    /// The identifier holds `weights` of the settled states: what has come in addition to what was
    /// wrong is news. Of a robot that is as good as healthy, it is noise.
    pub(crate) fn take(&mut self, states: &[StateMeaning], weights: &[f64]) {
        let (mut news, mut all) = (0.0, MOVED);
        for (state, (meaning, weight)) in states.iter().zip(weights).enumerate() {
            if !matches!(meaning.subject, Subject::Nominal | Subject::Done) {
                news += (weight - self.held[state]).max(0.0);
                all += weight;
            }
            self.held[state] = *weight;
        }
        self.p_settled *= 1.0 - (news / all).min(1.0);
        self.is_settled = match self.is_settled {
            true => self.p_settled > 1.0 - SETTLED_P,
            false => self.p_settled > SETTLED_P,
        };
    }

    /// Makes a belief in settled states one in new states, if evidence still comes.
    pub(crate) fn write(&self, states: &[StateMeaning], belief: &mut [f64]) {
        if self.is_settled {
            return;
        }
        for (new, meaning) in states.iter().enumerate() {
            if let Some(settled) = meaning.settles_to {
                belief[new] = std::mem::take(&mut belief[settled]);
            }
        }
    }
}

/// A belief in which what is new counts as settled.
pub(crate) fn folded(states: &[StateMeaning], belief: &[f64]) -> [f64; DECISION_STATES] {
    let mut out = [0.0; DECISION_STATES];
    for (state, (meaning, b)) in states.iter().zip(belief).enumerate() {
        out[meaning.settles_to.unwrap_or(state)] += b;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn state(subject: Subject, settles_to: Option<usize>) -> StateMeaning {
        StateMeaning {
            subject,
            leaves: 0,
            settles_to,
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

    /// A belief in settled states, and the same in new ones.
    const fn settled([a, b, c]: [f64; 3]) -> [f64; 7] {
        [a, b, c, 0.0, 0.0, 0.0, 0.0]
    }
    const fn new([a, b, c]: [f64; 3]) -> [f64; 7] {
        [0.0, 0.0, 0.0, a, b, c, 0.0]
    }

    /// A robot of whose model a fifth of what is new settles in an epoch, and of all a tenth ends.
    struct Robot {
        settling: Settling,
        believed: [f64; 7],
    }

    impl Robot {
        fn healthy() -> Self {
            Self {
                settling: Settling::new(&settled([1.0, 0.0, 0.0])),
                believed: settled([1.0, 0.0, 0.0]),
            }
        }

        /// The belief after an epoch, of what the identifier holds at its end.
        fn believes(&mut self, held: [f64; 3]) -> [f64; 7] {
            let predicted: [f64; 7] = std::array::from_fn(|at| match at {
                0..3 => 0.9 * (self.believed[at] + 0.2 * self.believed[at + 3]),
                3..6 => 0.9 * 0.8 * self.believed[at],
                _ => 0.1,
            });
            self.settling.pass(&STATES, &predicted);
            self.believed = settled(held);
            self.settling.take(&STATES, &self.believed);
            self.settling.write(&STATES, &mut self.believed);
            self.believed
        }
    }

    #[test]
    fn what_arises_is_new_and_settles_for_good_once_it_stays() {
        let mut robot = Robot::healthy();
        let (nothing, doubt) = ([1.0, 0.0, 0.0], [0.0, 0.75, 0.25]);
        assert_eq!(robot.believes(nothing), settled(nothing));
        // The news leave 1/21 settled; 1 - 20/21 0.8^n exceeds 0.8 at n = 7.
        for _ in 0..7 {
            assert_eq!(robot.believes(doubt), new(doubt));
        }
        for _ in 0..1000 {
            assert_eq!(robot.believes(doubt), settled(doubt));
        }
        // Another name is evidence again.
        let other = [0.0, 0.0, 1.0];
        assert_eq!(
            robot.believes([0.125, 0.125, 0.75]),
            settled([0.125, 0.125, 0.75])
        );
        assert_eq!(robot.believes([1.0, 0.0, 0.0]), settled([1.0, 0.0, 0.0]));
        assert_eq!(robot.believes(other), new(other));
    }

    #[test]
    fn noise_settles_and_a_belief_that_keeps_moving_does_not() {
        let shifted = |by: f64| [0.0, 0.5 + by, 0.5 - by];
        for (by, settles) in [(0.01, true), (0.02, true), (0.2, false)] {
            let mut robot = Robot::healthy();
            robot.believes(shifted(0.0));
            let mut is_settled = false;
            for k in 0..200 {
                let held = shifted(if k % 2 == 0 { by } else { -by });
                is_settled = robot.believes(held) == settled(held);
                assert!(settles || !is_settled, "{by}: {k}");
            }
            assert_eq!(is_settled, settles, "{by}");
        }
    }

    #[test]
    fn the_noise_of_a_healthy_robot_is_no_news() {
        let mut robot = Robot::healthy();
        for k in 0..1000 {
            let p = 1e-5 * f64::from(k % 7);
            let held = [1.0 - p, p, 0.0];
            assert_eq!(robot.believes(held), settled(held), "{k}");
        }
    }
}

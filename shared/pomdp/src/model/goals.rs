//! Goals: where nothing is earned any more, whatever is done.

use super::sparse::Sparse;

/// The goals of a model with discount 1, and what is left of T without them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Goals {
    /// For each state, whether it is one.
    pub is_goal: Vec<bool>,
    /// T, without steps to goals and from them.
    pub moves: Vec<Sparse>,
}

impl Goals {
    /// The largest set of states that no action leaves and in which no action earns anything;
    /// `reward` is R[a][s].
    pub(super) fn new(transitions: &[Sparse], reward: &[f64], states: usize) -> Self {
        let mut is_goal: Vec<bool> = (0..states)
            .map(|s| reward.iter().skip(s).step_by(states).all(|r| *r == 0.0))
            .collect();
        // Who is left when whoever leads elsewhere is taken out, again and again.
        let mut before: Vec<Vec<u32>> = vec![Vec::new(); states];
        for s in 0..states {
            for (to, _) in transitions.iter().flat_map(|sparse| sparse.row(s)) {
                before[*to].push(s as u32);
            }
        }
        let mut open: Vec<usize> = (0..states).filter(|s| !is_goal[*s]).collect();
        while let Some(to) = open.pop() {
            for &s in &before[to] {
                if std::mem::replace(&mut is_goal[s as usize], false) {
                    open.push(s as usize);
                }
            }
        }
        let moves = transitions.iter().map(|sparse| {
            let mut left = Sparse::default();
            for s in 0..states {
                let row = sparse.row(s).iter().copied();
                left.push(row.filter(|(to, _)| !is_goal[s] && !is_goal[*to]));
            }
            left
        });
        Self {
            moves: moves.collect(),
            is_goal,
        }
    }
}

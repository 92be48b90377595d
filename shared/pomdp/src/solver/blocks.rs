//! What is observed of the state for certain.
//!
//! Two states that may follow upon one action with one observation may be mistaken for each other.
//! The classes of that relation are blocks: after an observation a belief lies in one of them.
//! Where part of the state is observed (a mixed observable model: Ong, Png, Hsu and Lee, IJRR
//! 29(8), 2010) there are many, and a belief has to do with the points and vectors of its own
//! alone. No variables have to be declared for that.

use crate::model::Pomdp;

/// The blocks of a model.
#[derive(Debug, Clone)]
pub(super) struct Blocks {
    /// Of each state.
    block: Vec<u32>,
    count: usize,
}

impl Blocks {
    pub(super) fn new(model: &Pomdp) -> Self {
        let states = model.states().len();
        let mut parent: Vec<u32> = (0..states as u32).collect();
        for a in 0..model.actions().len() {
            let mut follows = vec![false; states];
            for (to, _) in (0..states).flat_map(|s| model.moves(s, a)) {
                follows[*to] = true;
            }
            for o in 0..model.observations().len() {
                let likelihood = model.likelihood(a, o);
                let mut alike = (0..states).filter(|s| follows[*s] && likelihood[*s] > 0.0);
                if let Some(first) = alike.next() {
                    alike.for_each(|s| join(&mut parent, first, s));
                }
            }
        }
        let mut blocks = Self {
            block: vec![0; states],
            count: 0,
        };
        for s in 0..states {
            let root = root(&mut parent, s);
            // A root is the least of its block.
            if root == s {
                blocks.block[s] = blocks.count as u32;
                blocks.count += 1;
            } else {
                blocks.block[s] = blocks.block[root];
            }
        }
        blocks
    }

    /// How many.
    pub(super) const fn count(&self) -> usize {
        self.count
    }

    /// The block in which a belief lies; none if in several, as a start belief may.
    pub(super) fn around(&self, belief: &[(u32, f64)]) -> Option<usize> {
        if self.count == 1 && !belief.is_empty() {
            return Some(0);
        }
        let mut blocks = belief.iter().map(|(s, _)| self.block[*s as usize]);
        let first = blocks.next()?;
        blocks.all(|block| block == first).then_some(first as usize)
    }
}

fn join(parent: &mut [u32], one: usize, other: usize) {
    let (one, other) = (root(parent, one), root(parent, other));
    parent[one.max(other)] = one.min(other) as u32;
}

fn root(parent: &mut [u32], mut state: usize) -> usize {
    while parent[state] as usize != state {
        parent[state] = parent[parent[state] as usize];
        state = parent[state] as usize;
    }
    state
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_observed_divides_the_states() {
        // A room and a lamp: the room is seen, the lamp is not. The last room is never entered.
        let text = |seen: &str| {
            format!(
                "discount: 0.9 states: a-on a-off b-on b-off c actions: stay go
                 observations: in-a in-b T: stay identity T: go : a-on 0 0 1 0 0
                 T: go : a-off 0 0 0 1 0 T: go : b-on 1 0 0 0 0 T: go : b-off 0 1 0 0 0
                 T: go : c 1 0 0 0 0 T: stay : c 1 0 0 0 0
                 O: * : a-on 1 0 O: * : a-off 1 0 O: * : c 1 0 O: * : b-on {seen} O: * : b-off 0 1"
            )
        };
        let blocks = Blocks::new(&Pomdp::parse(&text("0 1")).unwrap());
        assert_eq!(
            (blocks.count(), &blocks.block[..]),
            (3, &[0, 0, 1, 1, 2][..])
        );
        assert_eq!(blocks.around(&[(0, 0.5), (1, 0.5)]), Some(0));
        assert_eq!(blocks.around(&[(1, 0.5), (2, 0.5)]), None);
        // Once mistaken is enough.
        let blocks = Blocks::new(&Pomdp::parse(&text("0.001 0.999")).unwrap());
        assert_eq!(
            (blocks.count(), &blocks.block[..]),
            (2, &[0, 0, 0, 0, 1][..])
        );
    }
}

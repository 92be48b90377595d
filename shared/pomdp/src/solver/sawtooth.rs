//! The upper bound between points.
//!
//! V* is convex: for a point (b_i, v_i) and c = min_s b(s)/b_i(s), the belief b is c b_i and a
//! rest, so that V*(b) <= c v_i + U(rest) for any upper bound U. The usual sawtooth takes for U
//! the plane through the corners; here it is the lower of that and the fast informed bound.

use super::blocks::Blocks;
use crate::bounds::ActionValues;
use crate::sparse_beliefs::{BeliefId, SparseBeliefs, dot};

/// A belief whose upper bound was improved.
#[derive(Debug, Clone, Copy)]
struct Point {
    stamp: u32,
    belief: BeliefId,
    value: f64,
    /// Value of the plane through the corners.
    plane: f64,
    /// Place of its mask and of its values under the vectors of the base.
    slot: u32,
}

/// The points.
#[derive(Debug, Clone)]
pub(super) struct Sawtooth {
    base: ActionValues,
    corners: Vec<f64>,
    blocks: Blocks,
    /// Of each block, then of beliefs in several, by the instant of their last change: a point says
    /// something where its support is part of a belief's, so that only those of its block do.
    points: Vec<Vec<Point>>,
    /// Words of a mask of states.
    words: usize,
    masks: Vec<u64>,
    /// b_i·q_a of every slot.
    based: Vec<f64>,
    slots: u32,
    stamp: u32,
    /// The belief that is being valued, and its mask.
    dense: Vec<f64>,
    mask: Vec<u64>,
}

/// A belief to be valued.
pub(super) struct Query<'a> {
    pub entries: &'a [(u32, f64)],
    /// Value that is known already.
    pub value: f64,
    /// Only points newer than this are looked at.
    pub seen: u32,
}

impl Sawtooth {
    /// `corners` are upper bounds where the state is certain.
    pub(super) fn new(base: ActionValues, corners: Vec<f64>, blocks: Blocks) -> Self {
        let states = corners.len();
        Self {
            base,
            corners,
            points: vec![Vec::new(); blocks.count() + 1],
            blocks,
            words: states.div_ceil(64),
            masks: Vec::new(),
            based: Vec::new(),
            slots: 0,
            stamp: 0,
            dense: vec![0.0; states],
            mask: vec![0; states.div_ceil(64)],
        }
    }

    pub(super) fn stamp(&self) -> u32 {
        self.stamp
    }

    pub(super) fn point_count(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// Bytes that the points hold, about.
    pub(super) fn bytes(&self) -> usize {
        8 * (self.masks.len() + self.based.len()) + size_of::<Point>() * self.point_count()
    }

    /// The lower of the fast informed bound and the plane through the corners.
    pub(super) fn base_value(&self, belief: &[(u32, f64)]) -> f64 {
        let fast = self.base.rows().map(|q| dot(q, belief));
        let fast = fast.fold(f64::NEG_INFINITY, f64::max);
        fast.min(dot(&self.corners, belief))
    }

    /// Lowers the upper bound where a state is certain. Every point gives less elsewhere, so that
    /// all are new.
    pub(super) fn lower_corner(&mut self, beliefs: &SparseBeliefs, state: usize, value: f64) {
        self.corners[state] = value;
        self.stamp += 1;
        for point in self.points.iter_mut().flatten() {
            point.plane = dot(&self.corners, beliefs.entries(point.belief));
            point.stamp = self.stamp;
        }
    }

    /// Upper bounds where the state is certain.
    pub(super) fn corners(&self) -> &[f64] {
        &self.corners
    }

    /// Stores or lowers the value of a point.
    pub(super) fn put(&mut self, beliefs: &SparseBeliefs, belief: BeliefId, value: f64) {
        self.stamp += 1;
        let entries = beliefs.entries(belief);
        let block = self.blocks.around(entries);
        let block = block.unwrap_or(self.blocks.count());
        let known = self.points[block].iter().rposition(|p| p.belief == belief);
        let slot = match known {
            Some(at) => self.points[block].remove(at).slot,
            None => {
                let first = self.masks.len();
                self.masks.resize(first + self.words, 0);
                for (s, _) in entries {
                    self.masks[first + *s as usize / 64] |= 1 << (s % 64);
                }
                for q in self.base.rows() {
                    self.based.push(dot(q, entries));
                }
                self.slots += 1;
                self.slots - 1
            }
        };
        let plane = dot(&self.corners, entries);
        self.points[block].push(Point {
            stamp: self.stamp,
            belief,
            value,
            plane,
            slot,
        });
    }

    /// The bound at a belief, at most the value it comes with; and the work done.
    pub(super) fn value(&mut self, beliefs: &SparseBeliefs, query: &Query<'_>) -> (f64, usize) {
        let actions = self.base.rows().len();
        self.enter(query.entries);
        let at = self.base.rows().map(|q| dot(q, query.entries));
        let at: Vec<f64> = at.collect();
        let fast = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let strongest = at.iter().position(|v| *v == fast).unwrap_or(0);
        let plane = dot(&self.corners, query.entries);
        let (mut best, mut work) = (query.value.min(fast).min(plane), at.len());
        let lists = self.lists(query.entries).iter();
        let newer = lists.flat_map(|points| {
            let newest_first = points.iter().rev();
            newest_first.take_while(|point| point.stamp > query.seen)
        });
        for point in newer {
            work += 2;
            let slot = point.slot as usize;
            let masks = self.masks[slot * self.words..][..self.words].iter();
            if masks.zip(&self.mask).any(|(m, q)| m & !q != 0) {
                continue;
            }
            let based = &self.based[slot * actions..][..actions];
            // However large c is, the value is at least the smaller of two lines in c.
            let fall_fast = based[strongest] - point.value;
            let fall_plane = point.plane - point.value;
            let mut c = 1.0_f64;
            let mut hopeless = false;
            for (s, b) in beliefs.entries(point.belief) {
                c = c.min(self.dense[*s as usize] / b);
                work += 1;
                let floor = (fast - c * fall_fast).min(plane - c * fall_plane);
                if floor >= best {
                    hopeless = true;
                    break;
                }
            }
            if hopeless {
                continue;
            }
            let rest = at.iter().zip(based).map(|(b, p)| b - c * p);
            let rest = rest.fold(f64::NEG_INFINITY, f64::max);
            let value = c * point.value + rest.min(plane - c * point.plane);
            best = best.min(value);
        }
        self.leave(query.entries);
        (best, work)
    }

    /// The point that lowers the plane through the corners most at a belief, with the share c of it
    /// that the belief holds; and the work done.
    pub(super) fn closest(
        &mut self,
        beliefs: &SparseBeliefs,
        belief: &[(u32, f64)],
    ) -> (Option<(BeliefId, f64)>, usize) {
        self.enter(belief);
        let (mut best, mut fall_max, mut work) = (None, 0.0, 0);
        for point in self.lists(belief).iter().flatten() {
            work += 2;
            let masks = self.masks[point.slot as usize * self.words..][..self.words].iter();
            if masks.zip(&self.mask).any(|(m, q)| m & !q != 0) {
                continue;
            }
            let fall = point.plane - point.value;
            let mut c = 1.0_f64;
            for (s, b) in beliefs.entries(point.belief) {
                c = c.min(self.dense[*s as usize] / b);
                work += 1;
                if c * fall <= fall_max {
                    break;
                }
            }
            if c * fall > fall_max {
                fall_max = c * fall;
                best = Some((point.belief, c));
            }
        }
        self.leave(belief);
        (best, work)
    }

    /// The points that may say something of a belief.
    fn lists(&self, belief: &[(u32, f64)]) -> &[Vec<Point>] {
        match self.blocks.around(belief) {
            Some(block) => &self.points[block..=block],
            None => &self.points,
        }
    }

    /// Makes a belief the one that is being valued.
    fn enter(&mut self, belief: &[(u32, f64)]) {
        self.mask.fill(0);
        for (s, b) in belief {
            self.dense[*s as usize] = *b;
            self.mask[*s as usize / 64] |= 1 << (s % 64);
        }
    }

    fn leave(&mut self, belief: &[(u32, f64)]) {
        for (s, _) in belief {
            self.dense[*s as usize] = 0.0;
        }
    }

    /// Takes out points that the others make superfluous.
    pub(super) fn retain(&mut self, keep: impl Fn(BeliefId, f64) -> bool) {
        for points in &mut self.points {
            points.retain(|p| keep(p.belief, p.value));
        }
    }

    /// Beliefs of the points.
    pub(super) fn beliefs(&self) -> impl Iterator<Item = BeliefId> {
        self.points.iter().flatten().map(|p| p.belief)
    }
}

//! Probabilities of all sets of faults, from hypotheses about motion and encoders.

use vigil_blocks::{FaultSet, WHEELS};
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::{MotionMode, Mover};

use crate::identify::further::Fusion;
use crate::identify::leaf_map::LeafMap;
use crate::identify::tree_belief::{TreeBelief, entropy};

/// Hypotheses less probable than this are not divided among sets: a tenth of [`FLOOR`].
pub const NEGLIGIBLE: f64 = 1e-13;
/// Row of a pose that has jumped, after those of the steering servos.
const POSE: usize = WHEELS;
/// No set of one fault at most is reported less probable: what can return must not be impossible.
pub const FLOOR: f64 = 1e-12;

/// Sums over hypotheses.
#[derive(Debug, Clone, CheckpointValue)]
pub struct SetProbabilities {
    /// Row s: the wheels `s` (bits) are stuck; after these rows one per wheel whose steering servo
    /// does not do as it is told, and one for a pose that has jumped. Column e: the encoders `e`
    /// (bits) are broken.
    p: Vec<f64>,
    /// Of each motion mode: [`LeafMap::shares`].
    shares: Vec<Vec<(Mover, f64)>>,
    /// Per motion mode: what of it no fault describes.
    p_unknown: Vec<f64>,
    wheels: usize,
    unknown: f64,
    products: Vec<f64>,
}

impl SetProbabilities {
    /// Sets over `wheels` wheels, stuck as in these modes, and their encoders. Allocates all
    /// that it will need.
    #[must_use]
    pub fn new(modes: &[MotionMode], leaves: &LeafMap, wheels: usize) -> Self {
        let subsets = 1 << wheels;
        let is_other = |mode: &MotionMode| matches!(mode.moved, Mover::Steer(_) | Mover::Pose);
        let others = if modes.iter().any(is_other) {
            POSE + 1
        } else {
            0
        };
        let rows = subsets + others;
        Self {
            p: vec![0.0; rows * subsets],
            shares: modes.iter().map(|m| leaves.shares(m).collect()).collect(),
            p_unknown: modes.iter().map(|mode| mode.p_unknown).collect(),
            wheels,
            unknown: 0.0,
            products: vec![0.0; subsets],
        }
    }

    /// Forgets the sums.
    pub fn clear(&mut self) {
        self.p.fill(0.0);
        self.unknown = 0.0;
    }

    /// Adds a hypothesis of probability `p`, under which encoder w is broken with `broken(w)`.
    pub fn add(&mut self, mode: usize, p: f64, broken: impl Fn(usize) -> f64) {
        if p.is_nan() || p < NEGLIGIBLE {
            return;
        }
        let p_unknown = self.p_unknown[mode];
        self.unknown += p * p_unknown;
        let shares = &self.shares[mode];
        if shares.iter().any(|(moved, _)| moved.is_unknown()) {
            return;
        }
        self.products[0] = p * (1.0 - p_unknown);
        for wheel in 0..self.wheels {
            let broken = broken(wheel);
            let (whole, with) = self.products[..2 << wheel].split_at_mut(1 << wheel);
            for (whole, with) in whole.iter_mut().zip(with) {
                *with = *whole * broken;
                *whole *= 1.0 - broken;
            }
        }
        let subsets = self.products.len();
        for (moved, share) in shares {
            let row = match moved {
                Mover::Steer(wheel) => subsets + wheel,
                Mover::Pose => subsets + POSE,
                moved => moved.stuck() as usize,
            };
            let row = &mut self.p[row * subsets..(row + 1) * subsets];
            for (sum, product) in row.iter_mut().zip(&self.products) {
                *sum += share * product;
            }
        }
    }

    /// Nodes of a set; None if a fault of it is no leaf.
    fn nodes(&self, index: usize, leaves: &LeafMap) -> Option<u64> {
        let subsets = self.products.len();
        let (row, encoders) = (index / subsets, index % subsets);
        let (stuck, mut nodes) = match row.checked_sub(subsets) {
            Some(POSE) => (0, 1 << leaves.pose?),
            Some(askew) => (0, 1 << leaves.steer[askew]?),
            None => (row, 0_u64),
        };
        for wheel in 0..self.wheels {
            if stuck >> wheel & 1 == 1 {
                nodes |= 1 << leaves.stuck[wheel]?;
            }
            if encoders >> wheel & 1 == 1 {
                nodes |= 1 << leaves.encoder[wheel]?;
            }
        }
        Some(nodes)
    }

    /// Takes what further channels say of these sets.
    fn fuse(&mut self, fusion: &Fusion) {
        let subsets = self.products.len();
        self.unknown = self.unknown * fusion.unknown.0 + self.p[0] * fusion.unknown.1;
        let (stuck, askew) = self.p.split_at_mut(subsets * subsets);
        for (stuck, row) in stuck.chunks_exact_mut(subsets).enumerate().skip(1) {
            let wheels = (0..self.wheels).filter(|wheel| stuck >> wheel & 1 == 1);
            let factor: f64 = wheels.map(|wheel| fusion.stuck[wheel]).sum();
            let factor = factor / f64::from(stuck.count_ones());
            for p in row {
                *p *= factor;
            }
        }
        for p in askew.iter_mut().take(POSE * subsets) {
            *p *= fusion.askew;
        }
    }

    /// Normalises, and fills the probabilities of nodes, sets and unknown, by what further channels
    /// say too. What they alone tell of comes with any encoders broken.
    pub fn posterior(&mut self, leaves: &LeafMap, fusion: Option<&Fusion>, out: &mut TreeBelief) {
        if let Some(fusion) = fusion {
            self.fuse(fusion);
        }
        let further = fusion.map_or(&[][..], |fusion| &fusion.nodes[..fusion.count]);
        // What only further channels tell is as probable as nominal motion is, and not its floor.
        let subsets = self.products.len();
        for (kept, p) in self.products.iter_mut().zip(&self.p[..subsets]) {
            *kept = if p.is_finite() { *p } else { 0.0 };
        }
        let mut total = 0.0;
        for (index, p) in self.p.iter_mut().enumerate() {
            let at_least = if faults(index, subsets) <= 1 {
                FLOOR
            } else {
                0.0
            };
            *p = if p.is_finite() { *p } else { 0.0 }.max(at_least);
            total += *p;
        }
        self.unknown = if self.unknown.is_finite() {
            self.unknown.max(FLOOR)
        } else {
            FLOOR
        };
        let beside: f64 = further.iter().map(|(_, p)| p).sum();
        let turning: f64 = self.products.iter().sum();
        total += self.unknown + turning * beside;
        out.clear();
        out.unknown = self.unknown / total;
        out.entropy = entropy(out.unknown);
        for index in 0..self.p.len() {
            let p = self.p[index] / total;
            if p <= 0.0 {
                continue;
            }
            let Some(nodes) = self.nodes(index, leaves) else {
                continue;
            };
            out.add(FaultSet { leaves: nodes, p }, leaves);
            let Some(turning) = self.products.get(index) else {
                continue;
            };
            for (node, share) in further {
                let set = FaultSet {
                    leaves: nodes | 1 << node,
                    p: turning * share / total,
                };
                if set.p > NEGLIGIBLE {
                    out.add(set, leaves);
                }
            }
        }
    }
}

/// Faults of a set: those of its row, and its broken encoders.
const fn faults(index: usize, subsets: usize) -> u32 {
    let (row, encoders) = (index / subsets, index % subsets);
    let others = if row < subsets { row.count_ones() } else { 1 };
    others + encoders.count_ones()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_a_set_are_its_stuck_wheels_its_servo_or_pose_and_its_encoders() {
        // Two wheels: four rows of stuck wheels, then one for each servo, then the pose.
        for (row, encoders, count) in [(0, 0, 0), (3, 1, 3), (1, 3, 3), (4, 0, 1), (12, 2, 2)] {
            assert_eq!(faults(row * 4 + encoders, 4), count, "{row} {encoders}");
        }
    }

    /// Over one wheel that sticks, or whose servo is off.
    fn sums(p: &[f64], unknown: f64) -> SetProbabilities {
        SetProbabilities {
            p: p.to_vec(),
            shares: Vec::new(),
            p_unknown: Vec::new(),
            wheels: 1,
            unknown,
            products: vec![0.0; 2],
        }
    }

    #[test]
    fn further_channels_weigh_each_row_and_share_what_is_nominal_with_the_unknown() {
        let mut fusion = Fusion::neutral();
        (fusion.stuck[0], fusion.askew, fusion.unknown) = (4.0, 0.5, (2.0, 0.25));
        // Nominal, stuck, the servos of eight wheels, and the pose; each with a whole encoder and
        // with a broken one.
        let mut p = vec![0.125; 2 * (2 + WHEELS + 1)];
        p[..4].copy_from_slice(&[0.5, 0.25, 0.0625, 0.03125]);
        let mut sums = sums(&p, 0.375);
        sums.fuse(&fusion);
        assert_eq!(sums.unknown, 0.375 * 2.0 + 0.5 * 0.25);
        assert_eq!(sums.p[..4], [0.5, 0.25, 0.25, 0.125]);
        let (servos, pose) = sums.p[4..].split_at(2 * WHEELS);
        assert_eq!((servos, pose), (&[0.0625; 2 * WHEELS][..], &[0.125; 2][..]));
    }

    #[test]
    fn stuck_wheels_weigh_by_the_mean_of_their_factors() {
        let mut fusion = Fusion::neutral();
        (fusion.stuck[0], fusion.stuck[1]) = (4.0, 2.0);
        let mut sums = SetProbabilities {
            wheels: 2,
            products: vec![0.0; 4],
            ..sums(&[0.25; 16], 0.0)
        };
        sums.fuse(&fusion);
        for (row, factor) in sums.p.chunks(4).zip([1.0, 4.0, 2.0, 3.0]) {
            assert_eq!(row, [0.25 * factor; 4]);
        }
    }

    #[test]
    fn a_hypothesis_is_divided_among_the_sets_of_broken_encoders() {
        let mut sums = SetProbabilities {
            shares: vec![vec![(Mover::Nominal, 1.0)], vec![(Mover::Unknown, 1.0)]],
            p_unknown: vec![0.25, 1.0],
            wheels: 2,
            products: vec![0.0; 4],
            ..sums(&[0.0; 16], 0.0)
        };
        sums.add(0, 0.5, |wheel| [0.5, 0.25][wheel]);
        let named = 0.5 * 0.75;
        let expected = [0.5 * 0.75, 0.5 * 0.75, 0.5 * 0.25, 0.5 * 0.25];
        assert_eq!(sums.p[..4], expected.map(|share| named * share));
        sums.add(1, 0.125, |_| {
            unreachable!("in the unknown no encoder is asked for")
        });
        assert_eq!(sums.unknown, 0.5 * 0.25 + 0.125);
        // Too little to be divided, or no number.
        for p in [0.5 * NEGLIGIBLE, f64::NAN] {
            sums.add(0, p, |_| unreachable!("not divided"));
        }
        assert_eq!(sums.p[4..], [0.0; 12]);
    }
}

//! The belief as weighted hypotheses, for those who read the block of them.

use vigil_blocks::{
    HealthyBelief, MODE_MULTIPLE, MODE_UNKNOWN, PARTICLE_CAPACITY, ParticleBlock, WHEELS,
    WeightedHypothesis,
};
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::{Mover, triangle};

use crate::identify::encoders::Encoders;
use crate::identify::leaf_map::LeafMap;
use crate::identify::multiple_hypothesis::MultipleHypothesis;
use crate::identify::set_probabilities::NEGLIGIBLE;

/// Hypotheses that are collected before the least probable go. Chosen: twice what a block holds, so
/// that they are selected once for as many new ones. Smaller selects more often.
const ROOM: usize = 2 * PARTICLE_CAPACITY;

/// Collects hypotheses; where there are more than a block holds, the most probable.
#[derive(Debug, Clone, CheckpointValue)]
pub struct HypothesisList {
    all: Vec<WeightedHypothesis>,
    /// Weight and place of each, to be sorted.
    order: Vec<(f64, usize)>,
}

impl HypothesisList {
    /// Without any. Allocates all that it will need.
    #[must_use]
    pub fn new() -> Self {
        Self {
            all: Vec::with_capacity(ROOM),
            order: Vec::with_capacity(ROOM),
        }
    }

    /// Adds one.
    pub fn push(&mut self, hypothesis: WeightedHypothesis) {
        if self.all.len() == ROOM {
            let falling = |a: &WeightedHypothesis, b: &WeightedHypothesis| {
                b.log_weight.total_cmp(&a.log_weight)
            };
            self.all
                .select_nth_unstable_by(PARTICLE_CAPACITY - 1, falling);
            self.all.truncate(PARTICLE_CAPACITY);
        }
        self.all.push(hypothesis);
    }

    /// Moves them to a block, the most probable first.
    pub fn drain(&mut self, out: &mut ParticleBlock) {
        self.order.clear();
        let weights = self.all.iter().map(|hypothesis| hypothesis.log_weight);
        self.order.extend(weights.zip(0..));
        let falling = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        self.order.sort_unstable_by(falling);
        for (slot, &(_, place)) in out.hypotheses.iter_mut().zip(&self.order) {
            *slot = self.all[place];
        }
        out.count = self.all.len().min(PARTICLE_CAPACITY) as u32;
        out.healthy = HealthyBelief::default();
        self.all.clear();
    }
}

/// The index of a set of faults, if it is one node's.
#[must_use]
pub const fn mode(leaves: u64) -> u32 {
    match leaves.count_ones() {
        0 => 0,
        1 => leaves.trailing_zeros(),
        _ => MODE_MULTIPLE,
    }
}

/// Encoders that are broken at once.
#[derive(Debug, Clone, Copy, Default)]
struct EncoderSet {
    /// Their leaves, as bits.
    leaves: u64,
    /// When the last of them broke, ns.
    onset_ns: u64,
    /// Probability that exactly these are, given the motion.
    share: f64,
}

/// Adds those of the multiple-hypothesis filter: each with every set of broken encoders that is not
/// negligible, for each wheel that may move the robot so.
pub fn add_hypotheses(filter: &MultipleHypothesis, leaves: &LeafMap, out: &mut HypothesisList) {
    let mut sets = [EncoderSet::default(); 1 << WHEELS];
    for (motion, hypothesis) in filter.hypotheses() {
        let (track, p_unknown) = (&hypothesis.state.track, motion.p_unknown);
        let unknown = WeightedHypothesis {
            onset_t_capture_ns: hypothesis.onset,
            pose: track.pose().into(),
            pose_covariance: triangle(&track.pose_covariance()),
            log_weight: hypothesis.log_weight + p_unknown.ln(),
            mode: MODE_UNKNOWN,
            ..WeightedHypothesis::default()
        };
        if p_unknown > 0.0 {
            out.push(unknown);
        }
        let least = NEGLIGIBLE / hypothesis.log_weight.exp();
        let count = broken(&hypothesis.state.encoders, leaves, least, &mut sets);
        for (moved, share) in leaves.shares(motion) {
            let Some(moved) = moved_leaves(moved, leaves) else {
                continue;
            };
            let moved_ns = if moved == 0 { 0 } else { hypothesis.onset };
            for set in &sets[..count] {
                let share = set.share * share * (1.0 - p_unknown);
                if share >= least {
                    out.push(WeightedHypothesis {
                        leaves: moved | set.leaves,
                        onset_t_capture_ns: moved_ns.max(set.onset_ns),
                        log_weight: hypothesis.log_weight + share.ln(),
                        mode: mode(moved | set.leaves),
                        ..unknown
                    });
                }
            }
        }
    }
}

/// Leaves of what moves the robot, as bits; none of the unknown.
fn moved_leaves(moved: Mover, leaves: &LeafMap) -> Option<u64> {
    match moved {
        Mover::Unknown | Mover::UnknownAny => return None,
        Mover::Steer(wheel) => return Some(1 << leaves.steer[wheel]?),
        Mover::Pose => return Some(1 << leaves.pose?),
        Mover::Nominal | Mover::Stuck(_) => {}
    }
    let mut wheels = (0..WHEELS).filter(|&wheel| moved.is_stuck(wheel));
    wheels.try_fold(0, |bits, wheel| Some(bits | 1 << leaves.stuck[wheel]?))
}

/// Fills in the sets of broken encoders that are no less probable than `least`; how many.
fn broken(
    encoders: &Encoders,
    leaves: &LeafMap,
    least: f64,
    sets: &mut [EncoderSet; 1 << WHEELS],
) -> usize {
    sets[0] = EncoderSet {
        share: 1.0,
        ..EncoderSet::default()
    };
    let mut count = 1;
    for wheel in 0..WHEELS {
        let p_broken = encoders.p_broken(wheel);
        let Some(leaf) = leaves.encoder[wheel].filter(|_| p_broken > 0.0) else {
            continue;
        };
        let before = count;
        for i in 0..before {
            let without = sets[i];
            sets[i].share = without.share * (1.0 - p_broken);
            let share = without.share * p_broken;
            if share >= least {
                sets[count] = EncoderSet {
                    leaves: without.leaves | 1 << leaf,
                    onset_ns: without.onset_ns.max(encoders.onset(wheel)),
                    share,
                };
                count += 1;
            }
        }
    }
    count
}

/// Repeats the hypotheses of a block (not its header); none if one is not finite.
pub fn copy(from: &ParticleBlock, to: &mut ParticleBlock) {
    let used = from.used();
    let is_finite = |hypothesis: &WeightedHypothesis| {
        let moments = hypothesis.pose.iter().chain(&hypothesis.pose_covariance);
        moments
            .chain([&hypothesis.log_weight])
            .all(|value| value.is_finite())
    };
    let count = if used.iter().all(is_finite) {
        used.len()
    } else {
        0
    };
    to.hypotheses[..count].copy_from_slice(&used[..count]);
    to.count = count as u32;
    to.healthy = if count > 0 {
        from.healthy
    } else {
        HealthyBelief::default()
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_too_many_the_most_probable_stay_and_come_first() {
        let mut ranked = HypothesisList::new();
        let count = 3 * PARTICLE_CAPACITY as u64;
        for i in 0..count {
            // Every weight once, in no order.
            let place = i * 7 % count;
            ranked.push(WeightedHypothesis {
                leaves: place,
                log_weight: -(place as f64),
                ..WeightedHypothesis::default()
            });
        }
        let mut block = Box::<ParticleBlock>::default();
        ranked.drain(&mut block);
        let places: Vec<u64> = block.used().iter().map(|it| it.leaves).collect();
        assert_eq!(places, Vec::from_iter(0..PARTICLE_CAPACITY as u64));
        ranked.drain(&mut block);
        assert_eq!(block.count, 0);
    }

    #[test]
    fn a_set_of_one_leaf_is_its_node() {
        assert_eq!((mode(0), mode(1 << 7), mode(0b110)), (0, 7, MODE_MULTIPLE));
    }

    #[test]
    fn hypotheses_that_are_not_finite_are_not_repeated() {
        let mut block = Box::<ParticleBlock>::default();
        block.count = 2;
        block.hypotheses[1].log_weight = -1.0;
        block.healthy.pose = [1.0, 2.0, 3.0];
        let mut out = Box::default();
        copy(&block, &mut out);
        assert_eq!((out.used(), out.healthy), (block.used(), block.healthy));
        let spoils: [fn(&mut WeightedHypothesis); 3] = [
            |it| it.log_weight = f64::NAN,
            |it| it.pose[2] = f64::INFINITY,
            |it| it.pose_covariance[5] = f64::NAN,
        ];
        for spoil in spoils {
            let mut bad = block.clone();
            spoil(&mut bad.hypotheses[1]);
            copy(&bad, &mut out);
            assert_eq!((out.count, out.healthy), (0, HealthyBelief::default()));
        }
    }
}

//! In which way the component of each node is broken, and by how much.

use vigil_blocks::{FAULT_NODES, FaultBelief, SizeKind, WHEELS};
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::{MotionMode, Mover};

use crate::identify::encoders::{STATES, WAYS_TO_BREAK};
use crate::identify::leaf_map::LeafMap;
use crate::identify::multiple_hypothesis::MultipleHypothesis;
use crate::identify::tree_belief::{SIZE_P_MIN, TreeBelief};

/// Kind and size of each node's fault.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct NodeSizes {
    size: [f64; FAULT_NODES],
    sd: [f64; FAULT_NODES],
    kind: [u32; FAULT_NODES],
}

impl Default for NodeSizes {
    fn default() -> Self {
        Self {
            size: [0.0; FAULT_NODES],
            sd: [0.0; FAULT_NODES],
            kind: [0; FAULT_NODES],
        }
    }
}

impl NodeSizes {
    /// What a filter holds of the leaves that are probable enough.
    #[must_use]
    pub fn new(filter: &MultipleHypothesis, leaves: &LeafMap, posterior: &TreeBelief) -> Self {
        let mut out = Self::default();
        let is_probable = |node: &usize| posterior.nodes[*node] >= SIZE_P_MIN;
        for node in leaves.stuck.into_iter().flatten().filter(is_probable) {
            out.kind[node] = SizeKind::Stuck as u32;
        }
        for (wheel, node) in leaves.encoder.into_iter().enumerate().take(WHEELS) {
            if let Some(node) = node.filter(is_probable) {
                let (kind, (size, sd)) = broken(filter, wheel);
                (out.size[node], out.sd[node], out.kind[node]) = (size, sd, kind as u32);
            }
        }
        for (wheel, node) in leaves.steer.into_iter().enumerate() {
            let servo = filter
                .best(Mover::Steer(wheel))
                .and_then(|best| best.state.servo);
            if let Some((node, servo)) = node.filter(is_probable).zip(servo) {
                let (kind, (size, sd)) = servo.size();
                (out.size[node], out.sd[node], out.kind[node]) = (size, sd, kind as u32);
            }
        }
        if let Some((node, best)) = leaves
            .pose
            .filter(is_probable)
            .zip(filter.best(Mover::Pose))
        {
            let jump_m = best.state.jump_m.unwrap_or_default();
            (out.size[node], out.sd[node]) = jump_m;
            out.kind[node] = SizeKind::JumpM as u32;
        }
        out
    }

    /// Sets the way in which a node is broken, without a size.
    pub const fn set_kind(&mut self, node: usize, kind: SizeKind) {
        self.kind[node] = kind as u32;
    }

    /// Writes them into a block.
    pub const fn write(&self, belief: &mut FaultBelief) {
        belief.size = self.size;
        belief.size_sd = self.sd;
        belief.size_kind = self.kind;
    }
}

/// The most probable way in which an encoder is broken, its size and standard deviation.
fn broken(filter: &MultipleHypothesis, wheel: usize) -> (SizeKind, (f64, f64)) {
    let mut sums = [0.0; STATES];
    for (MotionMode { moved, .. }, hypothesis) in filter.hypotheses() {
        if moved.is_unknown() {
            continue;
        }
        let p = hypothesis.log_weight.exp();
        let ways = hypothesis.state.encoders.ways(wheel);
        for (sum, way) in sums.iter_mut().zip(ways) {
            *sum += p * way;
        }
    }
    let all = WAYS_TO_BREAK.into_iter().zip(sums);
    let best = all.max_by(|(_, a), (_, b)| a.total_cmp(b));
    match best {
        Some(((kind, Some(way)), _)) => (kind, filter.sizes().estimate(wheel, way)),
        Some(((kind, None), _)) => (kind, (0.0, 0.0)),
        None => (SizeKind::None, (0.0, 0.0)),
    }
}

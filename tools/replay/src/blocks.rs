//! Recorded blocks of the last seconds, by what identifies them.

use std::collections::{BTreeMap, VecDeque};

use vigil_blocks::{
    Action, Block, BlockId, DetectionBelief, FaultBelief, ParticleBlock, SensorFrame,
};
use vigil_cycle::Topic;
use vigil_flight::read_block;

/// Blocks of one topic.
pub(crate) struct Window<T> {
    blocks: BTreeMap<(u64, u64), Box<T>>,
    /// In the order in which they came, each with its time, ns.
    order: VecDeque<(u64, (u64, u64))>,
    /// For so long a block is kept, ns.
    kept_ns: u64,
}

impl<T> Window<T> {
    pub(crate) const fn new(kept_ns: u64) -> Self {
        Self {
            blocks: BTreeMap::new(),
            order: VecDeque::new(),
            kept_ns,
        }
    }

    /// Adds a block; those that are too old by now go.
    pub(crate) fn insert(&mut self, id: BlockId, t_ns: u64, block: Box<T>) {
        let key = (id.epoch, id.seq);
        self.blocks.insert(key, block);
        self.order.push_back((t_ns, key));
        while let Some((then_ns, oldest)) = self.order.front().copied()
            && t_ns.saturating_sub(then_ns) > self.kept_ns
        {
            self.blocks.remove(&oldest);
            self.order.pop_front();
        }
    }

    pub(crate) fn get(&self, id: BlockId) -> Option<&T> {
        self.blocks.get(&(id.epoch, id.seq)).map(Box::as_ref)
    }
}

/// What steps take, and what they have answered.
pub(crate) struct Blocks {
    pub(crate) frames: Window<SensorFrame>,
    pub(crate) detections: Window<DetectionBelief>,
    pub(crate) diagnoses: Window<FaultBelief>,
    pub(crate) actions: Window<Action>,
    /// The detector's hypotheses, computed again.
    pub(crate) particles: Window<ParticleBlock>,
}

impl Blocks {
    /// Recorded blocks are kept for `kept_ns`, computed hypotheses for `particles_ns`.
    pub(crate) const fn new(kept_ns: u64, particles_ns: u64) -> Self {
        Self {
            frames: Window::new(kept_ns),
            detections: Window::new(kept_ns),
            diagnoses: Window::new(kept_ns),
            actions: Window::new(kept_ns),
            particles: Window::new(particles_ns),
        }
    }

    /// Keeps a recorded block, if a step may need it; false if it cannot be read.
    pub(crate) fn take(&mut self, topic: Topic, t_ns: u64, bytes: &[u8]) -> bool {
        match topic {
            Topic::Sensor => insert(&mut self.frames, t_ns, bytes),
            Topic::Detection => insert(&mut self.detections, t_ns, bytes),
            Topic::Diagnosis => insert(&mut self.diagnoses, t_ns, bytes),
            Topic::Action => insert(&mut self.actions, t_ns, bytes),
            _ => true,
        }
    }
}

fn insert<T: Block>(window: &mut Window<T>, t_ns: u64, bytes: &[u8]) -> bool {
    let block = read_block::<T>(bytes);
    if let Some(block) = &block {
        window.insert(block.header().id(), t_ns, Box::new(*block));
    }
    block.is_some()
}

//! Recorded blocks of the last seconds, by what identifies them.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};

use vigil_blocks::{
    Action, Block, BlockId, DetectionBelief, FaultBelief, Faults, HealthyBelief, ParticleBlock,
    SensorFrame, WeightedHypothesis,
};
use vigil_cycle::Topic;
use vigil_flight::read_block;

/// Blocks of one topic.
pub(crate) struct Window<T> {
    blocks: BTreeMap<(u64, u64), Box<T>>,
    /// In the order in which they came, each with the time of the recording then, ns.
    order: VecDeque<(u64, (u64, u64))>,
    /// For so long a block is kept, ns.
    kept_ns: u64,
}

impl<T> Window<T> {
    const fn new(kept_ns: u64) -> Self {
        Self {
            blocks: BTreeMap::new(),
            order: VecDeque::new(),
            kept_ns,
        }
    }

    /// What has come so far came at `now_ns`.
    fn begin(&mut self, now_ns: u64) {
        self.order.iter_mut().for_each(|(t_ns, _)| *t_ns = now_ns);
    }

    /// Adds a block that came at `now_ns`; those that are too old by then go.
    pub(crate) fn insert(&mut self, id: BlockId, now_ns: u64, block: Box<T>) {
        let key = (id.epoch, id.seq);
        // A number that is repeated is refused by those who take blocks: the first counts.
        if let Entry::Vacant(place) = self.blocks.entry(key) {
            place.insert(block);
            self.order.push_back((now_ns, key));
        }
        while let Some((then_ns, oldest)) = self.order.front().copied()
            && now_ns.saturating_sub(then_ns) > self.kept_ns
        {
            self.blocks.remove(&oldest);
            self.order.pop_front();
        }
    }

    pub(crate) fn get(&self, id: BlockId) -> Option<&T> {
        self.blocks.get(&(id.epoch, id.seq)).map(Box::as_ref)
    }
}

/// The detector's hypotheses, as few as there are.
pub(crate) struct Hypotheses {
    healthy: HealthyBelief,
    used: Vec<WeightedHypothesis>,
}

impl From<&ParticleBlock> for Hypotheses {
    fn from(block: &ParticleBlock) -> Self {
        Self {
            healthy: block.healthy,
            used: block.used().to_vec(),
        }
    }
}

impl Hypotheses {
    /// Writes them into a block.
    pub(crate) fn fill(&self, block: &mut ParticleBlock) {
        block.healthy = self.healthy;
        block.count = self.used.len() as u32;
        block.hypotheses[..self.used.len()].copy_from_slice(&self.used);
    }
}

/// What steps take, and what they have answered.
pub(crate) struct Blocks {
    pub(crate) frames: Window<SensorFrame>,
    pub(crate) detections: Window<DetectionBelief>,
    pub(crate) diagnoses: Window<FaultBelief>,
    pub(crate) actions: Window<Action>,
    pub(crate) faults: Window<Faults>,
    /// Computed again.
    pub(crate) hypotheses: Window<Hypotheses>,
}

impl Blocks {
    /// Each block is kept for `kept_ns`.
    pub(crate) const fn new(kept_ns: u64) -> Self {
        Self {
            frames: Window::new(kept_ns),
            detections: Window::new(kept_ns),
            diagnoses: Window::new(kept_ns),
            actions: Window::new(kept_ns),
            faults: Window::new(kept_ns),
            hypotheses: Window::new(kept_ns),
        }
    }

    /// The time of the recording is known from now on.
    pub(crate) fn begin(&mut self, now_ns: u64) {
        self.frames.begin(now_ns);
        self.detections.begin(now_ns);
        self.diagnoses.begin(now_ns);
        self.actions.begin(now_ns);
        self.faults.begin(now_ns);
    }

    /// Keeps a recorded block, if a step may need it; false if it cannot be read.
    pub(crate) fn take(&mut self, topic: Topic, now_ns: u64, bytes: &[u8]) -> bool {
        match topic {
            Topic::Sensor => insert(&mut self.frames, now_ns, bytes),
            Topic::Detection => insert(&mut self.detections, now_ns, bytes),
            Topic::Diagnosis => insert(&mut self.diagnoses, now_ns, bytes),
            Topic::Action => insert(&mut self.actions, now_ns, bytes),
            Topic::Faults => insert(&mut self.faults, now_ns, bytes),
            _ => true,
        }
    }
}

fn insert<T: Block>(window: &mut Window<T>, now_ns: u64, bytes: &[u8]) -> bool {
    let block = read_block::<T>(bytes);
    if let Some(block) = &block {
        window.insert(block.header().id(), now_ns, Box::new(*block));
    }
    block.is_some()
}

//! Parts of blocks as parts of a step's state.

use vigil_checkpoint::{Checkpoint, CheckpointReader, CheckpointValue, CheckpointWriter};

use crate::diagnosis::FaultSet;
use crate::particles::{HealthyBelief, PARTICLE_CAPACITY, ParticleBlock, WeightedHypothesis};

/// Parts without padding, saved as they lie in memory.
macro_rules! as_bytes {
    ($($part:ty),*) => {$(
        impl Checkpoint for $part {
            fn save(&self, to: &mut CheckpointWriter<'_>) {
                to.put(bytemuck::bytes_of(self));
            }
            fn load(&mut self, from: &mut CheckpointReader<'_>) {
                from.fill(bytemuck::bytes_of_mut(self));
            }
        }
        impl CheckpointValue for $part {
            fn read(from: &mut CheckpointReader<'_>) -> Self {
                let mut part: Self = bytemuck::Zeroable::zeroed();
                part.load(from);
                part
            }
        }
    )*};
}

as_bytes!(FaultSet, HealthyBelief, WeightedHypothesis);

/// What it says; not the header and the cause, which are the writer's.
impl Checkpoint for ParticleBlock {
    fn save(&self, to: &mut CheckpointWriter<'_>) {
        to.mark(self.used().len() as u32);
        self.healthy.save(to);
        self.used()
            .iter()
            .for_each(|hypothesis| hypothesis.save(to));
    }

    fn load(&mut self, from: &mut CheckpointReader<'_>) {
        self.count = from.variant(0, PARTICLE_CAPACITY as u32 + 1, "ParticleBlock");
        self.healthy.load(from);
        let used = self.hypotheses.iter_mut().take(self.count as usize);
        used.for_each(|hypothesis| hypothesis.load(from));
    }
}

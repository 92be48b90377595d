//! Particles as they travel: structure of arrays.

use crate::block::block;
use crate::{Cause, Header};

/// Largest number of particles in a block.
pub const PARTICLE_CAPACITY: usize = 4096;

block! {
    /// Weighted particles of a filter, published every cycle.
    pub struct ParticleBlock, size 82016 {
        /// Common header.
        pub header: Header,
        /// The journal entry behind these particles.
        pub cause: Cause,
        /// Particles in use; the rest of the arrays is unspecified.
        pub count: u32,
        /// Reserved, zero.
        pub reserved: u32,
        /// Mode of each particle: index into the fault tree's nodes (0 is nominal).
        pub mode: [u32; PARTICLE_CAPACITY],
        /// x, m.
        pub x: [f32; PARTICLE_CAPACITY],
        /// y, m.
        pub y: [f32; PARTICLE_CAPACITY],
        /// Yaw, rad.
        pub yaw: [f32; PARTICLE_CAPACITY],
        /// Natural logarithm of the normalised weight.
        pub log_weight: [f32; PARTICLE_CAPACITY],
        /// Reserved, zero.
        pub reserved_tail: [u64; 2],
    }
}

//! Particles drawn from the detector's belief about the pose, for those who read particles.

use vigil_blocks::{PARTICLE_CAPACITY, ParticleBlock};
use vigil_inference::angle::wrap;
use vigil_inference::normals::Normals;
use vigil_inference::particles::PoseParticles;
use vigil_inference::track::Track;

/// Particles of equal weight, and the numbers that they are drawn with.
#[derive(Debug, Clone)]
pub(crate) struct Cloud {
    particles: PoseParticles,
    normals: Normals,
}

impl Cloud {
    /// `count` particles at the origin.
    pub fn new(count: usize, seed: u64) -> Self {
        Self {
            particles: PoseParticles::new(count),
            normals: Normals::new(seed, count),
        }
    }

    /// The generator starts from its seed again, so that equal runs have equal particles whatever
    /// came before.
    pub fn reset(&mut self) {
        self.normals.reset();
    }

    /// Draws the numbers for the next particles.
    pub fn draw_ahead(&mut self) {
        self.normals.draw_ahead();
    }

    /// Changes the number of particles, at most to the number at the start.
    pub fn resize(&mut self, count: usize) {
        self.particles.resize(count);
    }

    /// Draws all particles anew.
    pub fn draw(&mut self, track: &Track) {
        let (pose, covariance) = (track.pose(), track.pose_covariance());
        self.particles.draw(pose, covariance, &mut self.normals);
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.particles.poses().len()
    }

    /// Fills a block.
    pub fn publish(&self, block: &mut ParticleBlock) {
        let count = self.len().min(PARTICLE_CAPACITY);
        block.count = count as u32;
        block.mode[..count].fill(0);
        block.log_weight[..count].fill(-(count as f32).ln());
        for (i, pose) in self.particles.poses().iter().enumerate().take(count) {
            block.x[i] = pose[0] as f32;
            block.y[i] = pose[1] as f32;
            block.yaw[i] = wrap(pose[2]) as f32;
        }
    }
}

//! Particles drawn from the belief, for those who read particles.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{MODE_MULTIPLE, MODE_UNKNOWN, PARTICLE_CAPACITY, ParticleBlock, WHEELS};
use vigil_inference::angle::wrap;
use vigil_inference::normals::normal;
use vigil_inference::particles::factor;
use vigil_robot::learned::Moved;

use crate::encoders::Encoders;
use crate::exact::Exact;
use crate::modes::Leaves;

/// Draws `count` particles of equal weight from the belief: hypotheses by systematic sampling,
/// the pose from its Gaussian.
pub fn draw(
    exact: &Exact,
    leaves: &Leaves,
    count: usize,
    rng: &mut Pcg64Mcg,
    out: &mut ParticleBlock,
) {
    let count = count.min(PARTICLE_CAPACITY);
    let offset: f64 = rng.random();
    let (mut filled, mut sum) = (0, 0.0);
    let last = exact.hypotheses().len().saturating_sub(1);
    for (i, (moved, hypothesis)) in exact.hypotheses().enumerate() {
        sum += hypothesis.log_weight.exp();
        let share = (sum * count as f64 - offset).ceil().max(0.0) as usize;
        let until = if i == last { count } else { share.min(count) };
        if until <= filled {
            continue;
        }
        let mean = hypothesis.state.track.pose();
        let factor = factor(hypothesis.state.track.pose_covariance());
        for slot in filled..until {
            let pose = mean + factor * normal(rng);
            out.x[slot] = pose[0] as f32;
            out.y[slot] = pose[1] as f32;
            out.yaw[slot] = wrap(pose[2]) as f32;
            out.mode[slot] = mode(leaves, moved, &hypothesis.state.encoders, rng);
        }
        filled = until;
    }
    out.count = filled as u32;
    out.log_weight[..filled].fill(-(filled.max(1) as f32).ln());
}

/// Mode of a particle: the encoders' states are drawn.
fn mode(leaves: &Leaves, moved: Moved, encoders: &Encoders, rng: &mut Pcg64Mcg) -> u32 {
    if moved.is_unknown() {
        return MODE_UNKNOWN;
    }
    let mut nodes = match moved {
        Moved::Steer(wheel) => leaves.steer[wheel].map_or(0, |leaf| 1 << leaf),
        Moved::Pose => leaves.pose.map_or(0, |leaf| 1 << leaf),
        _ => 0_u64,
    };
    for wheel in 0..WHEELS {
        if let Some(leaf) = leaves.stuck[wheel].filter(|_| moved.is_stuck(wheel)) {
            nodes |= 1 << leaf;
        }
        if let Some(leaf) = leaves.encoder[wheel] {
            let broken = rng.random::<f64>() < encoders.p_broken(wheel);
            nodes |= u64::from(broken) << leaf;
        }
    }
    match nodes.count_ones() {
        0 => 0,
        1 => nodes.trailing_zeros(),
        _ => MODE_MULTIPLE,
    }
}

/// Copies the particles of a block (not its header), at most `limit`; none if one is not finite.
pub fn copy(from: &ParticleBlock, limit: usize, to: &mut ParticleBlock) {
    let count = (from.count as usize).min(limit).min(PARTICLE_CAPACITY);
    let finite = |values: &[f32]| values[..count].iter().all(|value| value.is_finite());
    if !(finite(&from.x) && finite(&from.y) && finite(&from.yaw) && finite(&from.log_weight)) {
        to.count = 0;
        return;
    }
    to.count = count as u32;
    to.mode[..count].copy_from_slice(&from.mode[..count]);
    to.x[..count].copy_from_slice(&from.x[..count]);
    to.y[..count].copy_from_slice(&from.y[..count]);
    to.yaw[..count].copy_from_slice(&from.yaw[..count]);
    to.log_weight[..count].copy_from_slice(&from.log_weight[..count]);
}

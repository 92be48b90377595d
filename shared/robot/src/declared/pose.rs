//! Blocks of poses: heading, and travel along the axes of the block's first heading.
//!
//! A block's first reading is its origin. The heading that it reads is wrong by five deviations at
//! most, the true heading leaves the predicted one by the context's bound and by five deviations of
//! what chance has turned it: these turn the predicted travel, and widen what is allowed of it.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::angle::wrap;
use vigil_inference::e_detector::path::{BOUND, Path, PathReading};

/// Lengths of blocks, in observations, and how many of each run side by side, staggered: of 0.5, 1
/// and 2 s at 50 ms. Longer ones see less, shorter ones sooner; more of them wait less for an end.
const LENGTHS: [(u32, u32); 3] = [(10, 2), (20, 4), (40, 4)];
/// Blocks side by side.
const COUNT: usize = 10;

/// A pose, and what is declared of the step to it. Order of axes: yaw, forward, lateral.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseStep {
    /// As read: x m, y m, yaw rad.
    pub pose: [f64; 3],
    /// Predicted turn, rad, and travel, m.
    pub moved: [f64; 3],
    /// Largest magnitude of what the context adds to them.
    pub moved_max: [f64; 3],
    /// Variance of what chance adds to them.
    pub moved_variance: [f64; 3],
    /// Largest variance of the noise of a heading, rad², and of a coordinate, m².
    pub noise_variance: [f64; 2],
    /// Time since the last observation, h.
    pub elapsed_h: f64,
}

/// One block: heading, x and y in the frame of its first pose.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Block {
    /// Observations to wait before it begins.
    wait: u32,
    first: [f64; 3],
    /// Since then: turn, rad; travel, m.
    predicted: [f64; 3],
    /// Largest error of the heading by the first reading and the context, rad.
    heading_max: f64,
    /// Variance of what chance has added to it, rad².
    heading_variance: f64,
    paths: [Path; 3],
}

impl Block {
    fn begin(&mut self, step: &PoseStep) {
        let [heading, position] = step.noise_variance;
        let noise = [heading, position, position];
        for (path, variance) in self.paths.iter_mut().zip(noise) {
            path.begin(variance, step.elapsed_h);
        }
        (self.first, self.predicted) = (step.pose, [0.0; 3]);
        self.heading_max = BOUND * heading.sqrt();
        self.heading_variance = 0.0;
    }

    fn step(&mut self, step: &PoseStep) {
        let [turn, forward, lateral] = step.moved;
        let [turn_max, forward_max, lateral_max] = step.moved_max;
        let [turn_variance, forward_variance, lateral_variance] = step.moved_variance;
        self.heading_max += turn_max;
        self.heading_variance += turn_variance;
        // A heading that is wrong by w turns a travel by 2 sin(w/2) of it: w across, w²/2 along.
        let wrong = self.heading_max + BOUND * self.heading_variance.sqrt();
        let along = 0.5 * wrong * wrong;
        let forward_max = forward_max * (1.0 + along)
            + along * forward.abs()
            + wrong * (lateral.abs() + lateral_max);
        let lateral_max = lateral_max * (1.0 + along)
            + along * lateral.abs()
            + wrong * (forward.abs() + step.moved_max[1]);
        let (sin, cos) = (self.predicted[0] + 0.5 * turn).sin_cos();
        self.predicted[0] += turn;
        self.predicted[1] += cos * forward - sin * lateral;
        self.predicted[2] += sin * forward + cos * lateral;
        let (dx, dy) = (step.pose[0] - self.first[0], step.pose[1] - self.first[1]);
        let (sin_first, cos_first) = self.first[2].sin_cos();
        let apart = [
            wrap(step.pose[2] - self.first[2] - self.predicted[0]),
            cos_first * dx + sin_first * dy - self.predicted[1],
            cos_first * dy - sin_first * dx - self.predicted[2],
        ];
        let step_max = [
            turn_max,
            cos.abs() * forward_max + sin.abs() * lateral_max,
            sin.abs() * forward_max + cos.abs() * lateral_max,
        ];
        // The larger one, along whichever heading.
        let travel_variance = forward_variance.max(lateral_variance);
        let step_variance = [turn_variance, travel_variance, travel_variance];
        let [heading, position] = step.noise_variance;
        let noise_variance = [heading, position, position];
        for (axis, path) in self.paths.iter_mut().enumerate() {
            path.step(&PathReading {
                apart: apart[axis],
                step_max: step_max[axis],
                step_variance: step_variance[axis],
                noise_variance: noise_variance[axis],
                elapsed_h: step.elapsed_h,
            });
        }
    }

    fn take(&mut self, step: &PoseStep) {
        if self.wait > 0 {
            self.wait -= 1;
        } else if self.paths.iter().any(Path::is_idle) {
            self.begin(step);
        } else {
            self.step(step);
        }
    }
}

/// All blocks.
#[derive(Debug, Clone, CheckpointValue)]
pub(super) struct PoseBlocks {
    blocks: [Block; COUNT],
}

impl PoseBlocks {
    /// None under way. `correlation`: largest magnitude of the noise's.
    pub fn new(correlation: f64) -> Self {
        const { assert!(LENGTHS[0].1 + LENGTHS[1].1 + LENGTHS[2].1 == COUNT as u32) };
        let mut blocks = Self {
            blocks: [Block {
                wait: 0,
                first: [0.0; 3],
                predicted: [0.0; 3],
                heading_max: 0.0,
                heading_variance: 0.0,
                paths: [Path::new(2, correlation); 3],
            }; COUNT],
        };
        for (block, steps) in blocks.blocks.iter_mut().zip(lengths()) {
            block.paths = [Path::new(steps, correlation); 3];
        }
        blocks.forget();
        blocks
    }

    /// Mean M of all detectors, h.
    pub fn hours(&self) -> f64 {
        self.mean(Path::hours)
    }

    /// The same of those that vouch for an alarm now.
    pub fn vouched_hours(&self) -> f64 {
        self.mean(Path::vouched_hours)
    }

    fn mean(&self, of: impl Fn(&Path) -> f64) -> f64 {
        let all = self.blocks.iter().flat_map(|block| &block.paths);
        all.map(of).sum::<f64>() / (3 * COUNT) as f64
    }

    /// Drops the blocks under way, as a reading lacks; new ones begin one after the other.
    pub fn skip(&mut self) {
        self.begin_anew(Path::skip);
    }

    /// Drops the blocks under way for any reason, and all that their detectors have.
    pub fn abandon(&mut self) {
        self.begin_anew(Path::abandon);
    }

    /// Forgets what speaks for a fault, the blocks under way included.
    pub fn forget(&mut self) {
        self.begin_anew(Path::forget);
    }

    fn begin_anew(&mut self, drop: impl Fn(&mut Path)) {
        for (block, wait) in self.blocks.iter_mut().zip(waits()) {
            block.wait = wait;
            block.paths.iter_mut().for_each(&drop);
        }
    }

    /// Takes a pose.
    pub fn step(&mut self, step: &PoseStep) {
        self.blocks.iter_mut().for_each(|block| block.take(step));
    }
}

/// Length of each block.
fn lengths() -> impl Iterator<Item = u32> {
    LENGTHS
        .into_iter()
        .flat_map(|(steps, side_by_side)| (0..side_by_side).map(move |_| steps))
}

/// How long each block waits for the one before it of its length.
fn waits() -> impl Iterator<Item = u32> {
    LENGTHS
        .into_iter()
        .flat_map(|(steps, side_by_side)| (0..side_by_side).map(move |i| i * steps / side_by_side))
}

#[cfg(test)]
mod tests;

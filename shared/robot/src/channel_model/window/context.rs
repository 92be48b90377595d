//! A channel's own offset and gain in a run.

use vigil_checkpoint::CheckpointValue;

/// Time over which they are learned, s.
const CONTEXT_S: f64 = 60.0;
/// So many deviations of them are no fault.
const CONTEXT_MAX: f64 = 2.0;

/// A channel's own offset and gain in a run.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub struct Context {
    /// Sums of products of what they are multiplied by: of the offset, both, the gain.
    information: [f64; 3],
    /// Of these and the residuals.
    vector: [f64; 2],
    /// Offset and gain.
    pub value: [f64; 2],
}

impl Context {
    pub const NONE: Self = Self {
        information: [0.0; 3],
        vector: [0.0; 2],
        value: [0.0; 2],
    };

    /// Takes a residual `z`, to which an offset of one adds `of[0]` and a gain `of[1]`.
    pub fn learn(&mut self, of: [f64; 2], z: f64, weight: f64, dt_s: f64) {
        let [of_offset, of_gain] = of;
        let keep = (-dt_s / CONTEXT_S).exp();
        let products = [
            of_offset * of_offset,
            of_offset * of_gain,
            of_gain * of_gain,
        ];
        let information = self.information.iter_mut().zip(products);
        information.for_each(|(sum, product)| *sum = keep * *sum + weight * product);
        let vector = self.vector.iter_mut().zip(of);
        vector.for_each(|(sum, of)| *sum = keep * *sum + weight * of * z);
    }

    /// The mean under a prior with these deviations.
    pub fn solve(&mut self, sd: &[f64; 2]) {
        let prior = sd.map(|sd| 1.0 / (sd * sd).max(1e-12));
        let [a, b, c] = self.information;
        let (a, c) = (a + prior[0], c + prior[1]);
        let determinant = a * c - b * b;
        let [x, y] = self.vector;
        let mean = [(c * x - b * y) / determinant, (a * y - b * x) / determinant];
        for ((slot, value), sd) in self.value.iter_mut().zip(mean).zip(sd) {
            *slot = value.clamp(-CONTEXT_MAX * sd, CONTEXT_MAX * sd);
        }
    }
}

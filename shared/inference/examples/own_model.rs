//! A filter for a model of one's own: a motor that turns, slips or blocks; its speed is measured.
use rand_pcg::Pcg64Mcg;
use vigil_inference::hybrid::{Modes, Sampled};
use vigil_inference::{bootstrap::ParticleFilter, filter::Filter, logspace::log_normal};
use vigil_inference::{proposal::Proposal, resample::Resampling};

struct Motor;

impl Modes for Motor {
    fn modes(&self) -> usize {
        3
    }
    fn transition(&self, from: usize, to: usize) -> f64 {
        [[0.9998, 1e-4, 1e-4], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]][from][to]
    }
}
impl Sampled for Motor {
    type State = f64; // speed, rad/s
    type Observation = f64;
    fn draw(&self, _: usize, _: &mut Pcg64Mcg) -> f64 {
        10.0
    }
    fn propagate(&self, mode: usize, speed: &f64, _: &mut Pcg64Mcg) -> f64 {
        speed + 0.2 * ([10.0, 7.0, 0.0][mode] - speed) // Lags behind the mode's own speed.
    }
    fn log_likelihood(&self, _: usize, speed: &f64, z: &f64) -> f64 {
        log_normal(z - speed, 0.25)
    }
}
fn main() {
    let proposal = Proposal::prior(&Motor);
    let mut filter = ParticleFilter::new(Motor, proposal, Resampling::default(), 1000, 1);
    for speed in [10.1, 9.8, 9.5, 9.0, 8.7, 8.1, 7.9, 7.5, 7.3, 7.1] {
        filter.step(&speed);
        println!(
            "{speed:4.1}: turns, slips, blocks {:.3?}",
            filter.posterior()
        );
    }
}

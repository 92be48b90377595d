//! Friction that varies along the path.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use vigil_robot::kinematics::ROVER_WHEELS;
use vigil_robot::slip::Soil;
use vigil_setup::graph_file::Simulator;

/// Least friction as a share of its mean. Chosen: ten deviations of the default scatter of 0.08; it
/// only keeps the physics valid.
const FRICTION_SHARE_MIN: f64 = 0.2;

/// Relative friction under each wheel as an Ornstein-Uhlenbeck process of the distance travelled:
/// stationary, exactly discretised, so that it does not depend on the cycle's rate. Each wheel has
/// its own, since the wheels stand further apart than the correlation length.
#[derive(Debug, Clone)]
pub(crate) struct SoilPath {
    deviation: [f64; ROVER_WHEELS],
    friction: f64,
    shear_modulus: f64,
    scatter: f64,
    length_m: f64,
    rng: Pcg64Mcg,
}

impl SoilPath {
    pub(crate) fn new(settings: &Simulator, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        Self {
            deviation: std::array::from_fn(|_| StandardNormal.sample(&mut rng)),
            friction: settings.friction,
            shear_modulus: settings.shear_modulus,
            scatter: settings.friction_scatter,
            length_m: settings.scatter_length_m,
            rng,
        }
    }

    /// Moves on by a distance, m. Standing still draws nothing.
    pub(crate) fn advance(&mut self, distance_m: f64) {
        if distance_m <= 0.0 {
            return;
        }
        let keep = (-distance_m / self.length_m).exp();
        let fresh = (-(-2.0 * distance_m / self.length_m).exp_m1()).sqrt();
        for deviation in &mut self.deviation {
            let drawn: f64 = StandardNormal.sample(&mut self.rng);
            *deviation = keep * *deviation + fresh * drawn;
        }
    }

    /// Changes the soil from here on.
    pub(crate) const fn set(&mut self, friction: f64, shear_modulus: f64) {
        self.friction = friction;
        self.shear_modulus = shear_modulus;
    }

    /// The soil under the wheels.
    pub(crate) fn here(&self) -> Soil {
        Soil {
            friction: self.deviation.map(|deviation| {
                self.friction * (1.0 + self.scatter * deviation).max(FRICTION_SHARE_MIN)
            }),
            shear_modulus: self.shear_modulus,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scatter_and_correlation_length_are_as_set_at_any_step() {
        // One standard error of the variance over 2000 m at length 0.2 m, six wheels: 1.3 %.
        for step_m in [0.0002, 0.01] {
            let mut soil = SoilPath::new(&Simulator::default(), 5);
            let lag = (0.2 / step_m) as usize;
            let count = (2000.0 / step_m) as usize / 6;
            let mut past = vec![[0.0; ROVER_WHEELS]; lag];
            let (mut square, mut product, mut n) = (0.0, 0.0, 0.0);
            for k in 0..count {
                soil.advance(step_m);
                let now = soil.here().friction.map(|f| f / 0.65 - 1.0);
                if k >= lag {
                    let before = past[k % lag];
                    for i in 0..ROVER_WHEELS {
                        square += now[i] * now[i];
                        product += now[i] * before[i];
                        n += 1.0;
                    }
                }
                past[k % lag] = now;
            }
            let deviation = f64::sqrt(square / n);
            let correlation = product / square;
            assert!((deviation / 0.08 - 1.0).abs() < 0.05, "{deviation}");
            assert!(
                (correlation - (-1.0_f64).exp()).abs() < 0.06,
                "{correlation}"
            );
        }
    }

    #[test]
    fn without_scatter_the_soil_is_the_mean_everywhere() {
        let settings = Simulator {
            friction_scatter: 0.0,
            ..Simulator::default()
        };
        let mut soil = SoilPath::new(&settings, 1);
        soil.advance(0.3);
        assert_eq!(soil.here(), Soil::uniform(0.65, 0.20));
    }
}

//! A run's offset and the noise's colour: residuals of a channel become white.
//!
//! State: the run's offset, constant but for a slow drift, and one carried over from the last
//! residual. With a negative correlation `residual = offset + w + n - n'` (w white, n' the error
//! that the last one made); with a positive one `residual = offset + a`, a first-order process. A
//! Kalman filter gives the innovation; divided by its deviation it is white with variance 1, if
//! the model holds.

use super::channel::Channel;

/// Least part of a variance that is white: a filter must not believe that it knows everything. A
/// twentieth: its own account is at most 20 times as sure as one residual.
const WHITE_MIN: f64 = 0.05;

/// Filter of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualWhitener {
    mean: [f64; 2],
    covariance: [f64; 3],
    carried: bool,
}

impl ResidualWhitener {
    /// The filter of a channel at the start of a run.
    #[must_use]
    pub fn new(channel: &Channel) -> Self {
        Self {
            mean: [0.0; 2],
            covariance: [channel.offset_sd * channel.offset_sd, 0.0, 0.0],
            carried: false,
        }
    }

    /// The record was broken: the offset stays, the last residual says nothing on the next.
    pub fn interrupt(&mut self) {
        self.carried = false;
    }

    /// Takes a residual with its variance; returns the innovation and its variance. While the
    /// offset is `held`, nothing is learned of it: what a fault does is none of the run's own.
    pub fn step(
        &mut self,
        channel: &Channel,
        residual: f64,
        variance: f64,
        held: bool,
    ) -> (f64, f64) {
        if !self.carried {
            // Nothing is known of the last error but its variance.
            self.mean[1] = 0.0;
            self.covariance[1] = 0.0;
            self.covariance[2] = match channel.correlation < 0.0 {
                true => -channel.correlation * variance,
                false => variance,
            };
            self.carried = true;
        }
        let drift = channel.drift_sd * channel.drift_sd;
        self.covariance[0] = match held {
            false => self.covariance[0] + drift,
            // It goes on drifting unseen, as far as runs differ.
            true => {
                let most = (channel.offset_sd * channel.offset_sd).max(self.covariance[0]);
                (self.covariance[0] + drift).min(most)
            }
        };
        if channel.correlation < 0.0 {
            self.taken_back(-channel.correlation, residual, variance, held)
        } else {
            self.decaying(channel.correlation, residual, variance, held)
        }
    }

    fn taken_back(&mut self, part: f64, residual: f64, variance: f64, held: bool) -> (f64, f64) {
        let [offset, cross, error] = self.covariance;
        let new = part * variance;
        let white = ((1.0 - 2.0 * part) * variance).max(WHITE_MIN * variance);
        let spread = offset - 2.0 * cross + error + new + white;
        let apart = residual - (self.mean[0] - self.mean[1]);
        // Gains of the offset and of the error that this residual makes. Where the first is held
        // at 0, the covariances are those of a filter that considers its error (Schmidt).
        let gains = [learned(offset - cross, held) / spread, new / spread];
        self.mean = [self.mean[0] + gains[0] * apart, gains[1] * apart];
        self.covariance = [
            offset - gains[0] * gains[0] * spread,
            -gains[1] * (offset - cross),
            new - gains[1] * gains[1] * spread,
        ];
        (apart, spread)
    }

    fn decaying(
        &mut self,
        correlation: f64,
        residual: f64,
        variance: f64,
        held: bool,
    ) -> (f64, f64) {
        let [offset, cross, coloured] = self.covariance;
        let white = WHITE_MIN * variance;
        let spread = offset + 2.0 * cross + coloured + white;
        let apart = residual - (self.mean[0] + self.mean[1]);
        let gains = [
            learned(offset + cross, held) / spread,
            (cross + coloured) / spread,
        ];
        let rest = coloured - gains[1] * gains[1] * spread;
        let new = variance * (1.0 - correlation * correlation);
        self.mean = [
            self.mean[0] + gains[0] * apart,
            correlation * (self.mean[1] + gains[1] * apart),
        ];
        self.covariance = [
            offset - gains[0] * gains[0] * spread,
            correlation * (cross - gains[1] * (offset + cross)),
            correlation * correlation * rest + new,
        ];
        (apart, spread)
    }
}

/// What a residual teaches of the offset.
const fn learned(covariance: f64, held: bool) -> f64 {
    if held { 0.0 } else { covariance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::{Quantity, Target};
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn channel(correlation: f64, offset_sd: f64) -> Channel {
        Channel {
            target: Target {
                quantity: Quantity::YawRate,
                wheel: 0,
            },
            terms: Vec::new(),
            weights: Vec::new(),
            variance: [1.0, 0.0, 0.0],
            correlation,
            offset_sd,
            drift_sd: 0.0,
            rest_sd: 0.0,
            scatter: 1.0,
            held_out_ratio: 1.0,
            tails: Vec::new(),
        }
    }

    /// Mean square and correlation of the whitened innovations of coloured noise with an offset.
    fn whiteness(correlation: f64) -> (f64, f64) {
        let channel = channel(correlation, 3.0);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let mut normal = || -> f64 { rng.sample(StandardNormal) };
        let mut track = ResidualWhitener::new(&channel);
        let (mut carried, mut before) = (normal(), 0.0);
        let (mut square, mut along) = (0.0, 0.0);
        let count = 20_000;
        for _ in 0..count {
            let residual = if correlation < 0.0 {
                let error = (-correlation).sqrt() * normal();
                let value = (1.0 + 2.0 * correlation).sqrt() * normal() + error - carried;
                carried = error;
                value
            } else {
                carried =
                    correlation * carried + (1.0 - correlation * correlation).sqrt() * normal();
                carried
            };
            let (apart, spread) = track.step(&channel, 2.0 + residual, 1.0, false);
            let white = apart / spread.sqrt();
            square += white * white / f64::from(count);
            along += white * before / f64::from(count);
            before = white;
        }
        (square, along)
    }

    #[test]
    fn what_is_not_known_of_a_held_offset_is_part_of_every_variance() {
        for correlation in [-0.4, -0.2, 0.3, 0.8] {
            let channel = channel(correlation, 3.0);
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(6);
            let mut normal = || -> f64 { rng.sample(StandardNormal) };
            let (mut square, mut count) = (0.0, 0.0);
            for _ in 0..2000 {
                let (offset, mut track) = (3.0 * normal(), ResidualWhitener::new(&channel));
                let mut carried = normal();
                if correlation < 0.0 {
                    carried *= (-correlation).sqrt();
                }
                for step in 0..12 {
                    let residual = if correlation < 0.0 {
                        let error = (-correlation).sqrt() * normal();
                        let white = (1.0 + 2.0 * correlation).sqrt() * normal();
                        let value = white + error - carried;
                        carried = error;
                        value
                    } else {
                        let new = (1.0 - correlation * correlation).sqrt() * normal();
                        carried = correlation * carried + new;
                        carried
                    };
                    let (apart, spread) = track.step(&channel, offset + residual, 1.0, true);
                    if step > 3 {
                        square += apart * apart / spread;
                        count += 1.0;
                    }
                }
            }
            let mean = square / count;
            assert!((0.9..1.1).contains(&mean), "{correlation}: {mean}");
        }
    }

    #[test]
    fn coloured_residuals_with_an_offset_become_white() {
        for correlation in [-0.4, -0.2, 0.0, 0.5, 0.8] {
            let (square, along) = whiteness(correlation);
            // The white part that is always assumed makes them a little too small.
            assert!((0.8..1.05).contains(&square), "{correlation}: {square}");
            assert!(along.abs() < 0.08, "{correlation}: {along}");
        }
    }

    #[test]
    fn an_offset_is_learned_and_keeps_its_value_while_it_is_held() {
        for correlation in [-0.3, 0.0, 0.6] {
            let drifting = Channel {
                drift_sd: 0.1,
                ..channel(correlation, 3.0)
            };
            let mut track = ResidualWhitener::new(&drifting);
            for _ in 0..200 {
                track.step(&drifting, 2.0, 1.0, false);
            }
            let learned = track;
            assert!((track.mean[0] - 2.0).abs() < 0.2, "{:?}", track.mean);
            for _ in 0..20_000 {
                track.step(&drifting, 8.0, 1.0, true);
            }
            assert_eq!(track.mean[0], learned.mean[0]);
            assert!(track.covariance[0] > learned.covariance[0]);
            assert!(track.covariance[0] <= 9.0);
            // It is learned again afterwards, and its covariance is one.
            for _ in 0..200 {
                track.step(&drifting, 3.0, 1.0, false);
            }
            assert!((track.mean[0] - 3.0).abs() < 0.2, "{:?}", track.mean);
            let [offset, cross, error] = track.covariance;
            assert!(offset * error > cross * cross && offset > 0.0);
        }
    }
}

//! Standard normal triples, drawn ahead of their use.
//!
//! A generator's numbers do not depend on what is observed, and drawing them takes longer than
//! using them: whoever must answer in time draws them while waiting.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Three standard normals.
pub fn normal(rng: &mut Pcg64Mcg) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// The triples of a seeded generator in their order, however far ahead they were drawn. The buffer
/// is allocated once.
#[derive(Debug, Clone)]
pub struct Normals {
    seed: u64,
    rng: Pcg64Mcg,
    ahead: Vec<Vector3<f64>>,
    used: usize,
}

impl Normals {
    /// Of this seed; draws at most `count` triples ahead.
    #[must_use]
    pub fn new(seed: u64, count: usize) -> Self {
        Self {
            seed,
            rng: Pcg64Mcg::seed_from_u64(seed),
            ahead: Vec::with_capacity(count),
            used: 0,
        }
    }

    /// From the seed again.
    pub fn reset(&mut self) {
        self.rng = Pcg64Mcg::seed_from_u64(self.seed);
        self.ahead.clear();
        self.used = 0;
    }

    /// Draws ahead as many as there is room for. Allocates nothing.
    pub fn draw_ahead(&mut self) {
        self.ahead.drain(..self.used);
        self.used = 0;
        while self.ahead.len() < self.ahead.capacity() {
            self.ahead.push(normal(&mut self.rng));
        }
    }

    /// The next triple: one drawn ahead, while there are any.
    pub fn take(&mut self) -> Vector3<f64> {
        let Some(triple) = self.ahead.get(self.used) else {
            return normal(&mut self.rng);
        };
        self.used += 1;
        *triple
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_generators_however_far_ahead_it_was_drawn() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let expected: Vec<_> = (0..200).map(|_| normal(&mut rng)).collect();
        let mut normals = Normals::new(5, 16);
        for _ in 0..2 {
            let mut taken = Vec::new();
            for (i, before) in [3, 0, 16, 40, 1, 17, 5, 16, 100, 2].into_iter().enumerate() {
                if i % 3 != 2 {
                    normals.draw_ahead();
                }
                taken.extend((0..before).map(|_| normals.take()));
            }
            assert_eq!(taken, expected);
            normals.draw_ahead();
            normals.reset();
        }
    }
}

//! Sixteen streams of xoshiro128++ (Blackman and Vigna, *Scrambled Linear Pseudorandom Number
//! Generators*, 2021), and normal draws from them by the method of Box and Muller (1958).

use super::elementary::negative_ln;
use super::vector::{Block, LANES, Lanes};

/// State of the streams between steps.
#[derive(Debug, Clone)]
pub(super) struct Streams([Block<u32>; 4]);

impl Streams {
    /// Streams whose states splitmix64 draws from `seed`: of 2^128 states, 16 that do not come
    /// near each other.
    pub(super) fn new(seed: u64) -> Self {
        let mut state = seed;
        let mut words = [Block::splat(0_u32); 4];
        for lane in 0..LANES {
            for half in 0..2 {
                state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                z ^= z >> 31;
                words[2 * half].0[lane] = z as u32;
                words[2 * half + 1].0[lane] = (z >> 32) as u32;
            }
            // The one state that never changes.
            if words.iter().all(|word| word.0[lane] == 0) {
                words[0].0[lane] = 1;
            }
        }
        Self(words)
    }

    /// The state of one stream.
    #[cfg(test)]
    pub(super) fn lane(&self, lane: usize) -> [u32; 4] {
        self.0.map(|word| word.0[lane])
    }
}

/// The streams in registers.
pub(super) struct Draws<L: Lanes> {
    lanes: L,
    state: [L::Word; 4],
}

impl<L: Lanes> Draws<L> {
    #[inline(always)]
    pub(super) fn begin(lanes: L, streams: &Streams) -> Self {
        let [a, b, c, d] = &streams.0;
        let state = [a, b, c, d].map(|word| lanes.load_word(word));
        Self { lanes, state }
    }

    #[inline(always)]
    pub(super) fn end(self, streams: &mut Streams) {
        for (word, to) in self.state.into_iter().zip(&mut streams.0) {
            self.lanes.store_word(word, to);
        }
    }

    /// Uniform words.
    #[inline(always)]
    pub(super) fn word(&mut self) -> L::Word {
        let l = self.lanes;
        let [a, b, c, d] = self.state;
        let drawn = l.add_word(l.rotate_left(l.add_word(a, d), 7), a);
        let shifted = l.shift_left(b, 9);
        let (c, d) = (l.xor(c, a), l.xor(d, b));
        let (b, a) = (l.xor(b, c), l.xor(a, d));
        self.state = [a, b, l.xor(c, shifted), l.rotate_left(d, 11)];
        drawn
    }

    /// Two independent standard normal draws per lane; at most 6.7 in magnitude.
    #[inline(always)]
    pub(super) fn normals(&mut self) -> (L::Real, L::Real) {
        let l = self.lanes;
        // In (0, 1]: the half keeps the logarithm finite.
        let half = l.shift_right(self.word(), 1);
        let scale = l.real(1.0 / (1_u32 << 31) as f32);
        let uniform = l.mul_add(l.signed(half), scale, l.real(0.5 / (1_u32 << 31) as f32));
        let radius = l.sqrt(negative_ln(l, uniform));
        // The direction is 45° + φ with φ within ±45°, mirrored at both axes at random: then it
        // is (cos φ - sin φ, cos φ + sin φ)/√2, and the √2 goes into the radius. The signs take
        // φ's two lowest bits, of which 24 bits of precision see nothing.
        let bits = self.word();
        let angle = l.mul(l.signed(bits), scale);
        let t = l.mul(angle, angle);
        let sine = l.mul(
            l.polynomial(t, [0.785_397, -0.080_724_75, 0.002_435_622_7]),
            angle,
        );
        let cosine = l.polynomial(t, [1.0, -0.308_424_26, 0.015_849_914, -0.000_318_880_5]);
        let first = l.bits(l.mul(radius, l.sub(cosine, sine)));
        let second = l.bits(l.mul(radius, l.add(cosine, sine)));
        let sign = l.and(l.shift_left(bits, 30), l.word(1 << 31));
        (
            l.to_real(l.xor(first, l.shift_left(bits, 31))),
            l.to_real(l.xor(second, sign)),
        )
    }
}

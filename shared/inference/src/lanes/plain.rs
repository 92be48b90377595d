//! The lanes as arrays: correct on every processor, and as fast as the compiler makes them.

use std::array::from_fn;

use super::vector::{BUNDLE_WORDS, Block, Bundle, Gathered, LANES, Lanes};

/// Arrays. `FUSED` says whether `mul_add` rounds once, which without an instruction for it is a
/// slow call of a function.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plain<const FUSED: bool>;

type Real = [f32; LANES];
type Word = [u32; LANES];

impl<const FUSED: bool> Lanes for Plain<FUSED> {
    type Real = Real;
    type Word = Word;

    #[inline(always)]
    fn real(self, value: f32) -> Real {
        [value; LANES]
    }
    #[inline(always)]
    fn word(self, value: u32) -> Word {
        [value; LANES]
    }
    #[inline(always)]
    fn load(self, from: &Block<f32>) -> Real {
        from.0
    }
    #[inline(always)]
    fn load_word(self, from: &Block<u32>) -> Word {
        from.0
    }
    #[inline(always)]
    fn store(self, value: Real, to: &mut Block<f32>) {
        to.0 = value;
    }
    #[inline(always)]
    fn store_word(self, value: Word, to: &mut Block<u32>) {
        to.0 = value;
    }
    #[inline(always)]
    fn add(self, a: Real, b: Real) -> Real {
        from_fn(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(self, a: Real, b: Real) -> Real {
        from_fn(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(self, a: Real, b: Real) -> Real {
        from_fn(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn mul_add(self, a: Real, b: Real, c: Real) -> Real {
        if FUSED {
            from_fn(|i| a[i].mul_add(b[i], c[i]))
        } else {
            from_fn(|i| a[i] * b[i] + c[i])
        }
    }
    #[inline(always)]
    fn max(self, a: Real, b: Real) -> Real {
        from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn sqrt(self, a: Real) -> Real {
        a.map(f32::sqrt)
    }
    #[inline(always)]
    fn signed(self, a: Word) -> Real {
        a.map(|a| a as i32 as f32)
    }
    #[inline(always)]
    fn bits(self, a: Real) -> Word {
        a.map(f32::to_bits)
    }
    #[inline(always)]
    fn to_real(self, a: Word) -> Real {
        a.map(f32::from_bits)
    }
    #[inline(always)]
    fn add_word(self, a: Word, b: Word) -> Word {
        from_fn(|i| a[i].wrapping_add(b[i]))
    }
    #[inline(always)]
    fn sub_word(self, a: Word, b: Word) -> Word {
        from_fn(|i| a[i].wrapping_sub(b[i]))
    }
    #[inline(always)]
    fn and(self, a: Word, b: Word) -> Word {
        from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn or(self, a: Word, b: Word) -> Word {
        from_fn(|i| a[i] | b[i])
    }
    #[inline(always)]
    fn xor(self, a: Word, b: Word) -> Word {
        from_fn(|i| a[i] ^ b[i])
    }
    #[inline(always)]
    fn shift_left(self, a: Word, count: u32) -> Word {
        a.map(|a| a << (count & 31))
    }
    #[inline(always)]
    fn shift_right(self, a: Word, count: u32) -> Word {
        a.map(|a| a >> (count & 31))
    }
    #[inline(always)]
    fn rotate_left(self, a: Word, count: u32) -> Word {
        a.map(|a| a.rotate_left(count))
    }
    #[inline(always)]
    fn select_less(self, a: Word, b: Word, x: Word, y: Word) -> Word {
        from_fn(|i| {
            if (a[i] as i32) < (b[i] as i32) {
                x[i]
            } else {
                y[i]
            }
        })
    }
    #[inline(always)]
    fn add_where_equal(self, sum: Real, value: Real, a: Word, b: Word) -> Real {
        from_fn(|i| sum[i] + if a[i] == b[i] { value[i] } else { 0.0 })
    }
    #[inline(always)]
    fn look_up(self, table: &Block<f32>, at: Word) -> Real {
        at.map(|at| table.0[at as usize % LANES])
    }
    #[inline(always)]
    fn look_up_entry(self, table: &[u32; 256], at: Word) -> Word {
        at.map(|at| table[at as usize % 256])
    }
    #[inline(always)]
    fn gather(self, from: &[Bundle], at: Word) -> Gathered<Self> {
        let last = from.len() - 1;
        let place = at.map(|at| {
            let at = at as usize;
            ((at / BUNDLE_WORDS).min(last), at % LANES)
        });
        Gathered {
            x: place.map(|(bundle, lane)| from[bundle].x.0[lane]),
            y: place.map(|(bundle, lane)| from[bundle].y.0[lane]),
            yaw: place.map(|(bundle, lane)| from[bundle].yaw.0[lane]),
            mode: place.map(|(bundle, lane)| from[bundle].mode.0[lane]),
        }
    }
    #[inline(always)]
    fn pick(self, from: &[Block<f32>], at: Word) -> Real {
        let last = from.len() * LANES - 1;
        at.map(|at| {
            let at = (at as usize).min(last);
            from[at / LANES].0[at % LANES]
        })
    }
    #[inline(always)]
    fn scatter(self, to: &mut [Block<u32>], at: Word, values: Word) {
        let last = to.len() * LANES - 1;
        for (at, value) in at.into_iter().zip(values) {
            let at = (at as usize).min(last);
            to[at / LANES].0[at % LANES] = value;
        }
    }
    #[inline(always)]
    fn max_word(self, a: Word, b: Word) -> Word {
        from_fn(|i| (a[i] as i32).max(b[i] as i32) as u32)
    }
    #[inline(always)]
    fn push<const N: usize>(self, a: Word) -> Word {
        from_fn(|i| if i < N { 0 } else { a[i - N] })
    }
    #[inline(always)]
    fn last(self, a: Real) -> f32 {
        a[LANES - 1]
    }
    #[inline(always)]
    fn last_word(self, a: Word) -> Word {
        [a[LANES - 1]; LANES]
    }
}

//! The levels of processors, chosen at run time, and the lanes as their registers.
//!
//! The only file of this crate with `unsafe`: instructions that not every processor has are
//! called here, and what they address in memory.
#![allow(unsafe_code)]

use super::plain::Plain;
use super::vector::Kernel;

/// What a processor offers to the kernels, from the least to the most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// What every processor of the architecture has.
    Plain,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// x86-64 with AVX-512 F, BW, DQ and VL.
    Avx512,
}

impl Level {
    /// All levels, in order.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Avx2, Self::Avx512];

    /// True if this processor has what the level needs.
    #[must_use]
    pub fn is_available(self) -> bool {
        Processor::at(self).is_some()
    }

    /// The highest level that is available.
    #[must_use]
    pub fn best() -> Self {
        let mut levels = Self::ALL.into_iter().rev();
        levels
            .find(|level| level.is_available())
            .unwrap_or(Self::Plain)
    }
}

/// Multiplication and addition in one rounding come with the architecture, or not at all.
pub(super) const PLAIN_IS_FUSED: bool =
    cfg!(target_arch = "aarch64") || cfg!(target_feature = "fma");

/// A level together with the proof that it is available.
#[derive(Debug, Clone, Copy)]
pub(super) enum Processor {
    Plain(Plain<PLAIN_IS_FUSED>),
    /// Fused by a function, to hold the others' bits against.
    #[cfg(test)]
    Fused(Plain<true>),
    #[cfg(target_arch = "x86_64")]
    Avx2(x86::Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(x86::Avx512),
}

impl Processor {
    /// None if this processor lacks the level.
    pub(super) fn at(level: Level) -> Option<Self> {
        match level {
            Level::Plain => Some(Self::Plain(Plain)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => x86::Avx2::detect().map(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => x86::Avx512::detect().map(Self::Avx512),
            #[cfg(not(target_arch = "x86_64"))]
            Level::Avx2 | Level::Avx512 => None,
        }
    }

    /// The plain one if this processor lacks the level.
    pub(super) fn at_or_plain(level: Level) -> Self {
        Self::at(level).unwrap_or(Self::Plain(Plain))
    }

    /// Runs the body of `kernel` that was compiled for this level.
    pub(super) fn run(self, kernel: impl Kernel) {
        match self {
            Self::Plain(lanes) => kernel.run(lanes),
            #[cfg(test)]
            Self::Fused(lanes) => kernel.run(lanes),
            // SAFETY: the value exists only where the processor was found to have the features.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(lanes) => unsafe { x86::run_avx2(lanes, kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(lanes) => unsafe { x86::run_avx512(lanes, kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::super::vector::{BUNDLE_WORDS, Block, Bundle, Gathered, LANES, Lanes};
    use super::{Kernel, Plain};

    /// Two registers of 8 lanes. Made by [`Avx2::detect`] only.
    #[derive(Debug, Clone, Copy)]
    pub(in super::super) struct Avx2(());

    impl Avx2 {
        pub(super) fn detect() -> Option<Self> {
            let has = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            has.then_some(Self(()))
        }
    }

    /// One register of 16 lanes. Made by [`Avx512::detect`] only.
    #[derive(Debug, Clone, Copy)]
    pub(in super::super) struct Avx512(());

    impl Avx512 {
        pub(super) fn detect() -> Option<Self> {
            let has = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl");
            has.then_some(Self(()))
        }
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn run_avx2(lanes: Avx2, kernel: impl Kernel) {
        kernel.run(lanes);
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    pub(super) fn run_avx512(lanes: Avx512, kernel: impl Kernel) {
        kernel.run(lanes);
    }

    /// Methods whose body is instructions without access to memory.
    macro_rules! registers {
        ($(fn $name:ident($($argument:ident: $kind:ty),*) -> $out:ty { $body:expr })*) => {$(
            #[inline(always)]
            fn $name(self, $($argument: $kind),*) -> $out {
                // SAFETY: `self` exists only where the processor was found to have these
                // instructions, and they touch nothing but registers.
                unsafe { $body }
            }
        )*};
    }

    /// Address of a bundle's last x: what lies `BUNDLE_WORDS - LANES` further is the last mode.
    #[inline(always)]
    fn last_address(from: &[Bundle]) -> i32 {
        assert!(!from.is_empty() && from.len() <= i32::MAX as usize / BUNDLE_WORDS);
        ((from.len() - 1) * BUNDLE_WORDS + LANES - 1) as i32
    }

    #[inline(always)]
    fn last_index<T>(to: &[Block<T>]) -> i32 {
        assert!(!to.is_empty() && to.len() <= i32::MAX as usize / LANES);
        (to.len() * LANES - 1) as i32
    }

    impl Lanes for Avx512 {
        type Real = __m512;
        type Word = __m512i;

        registers! {
            fn real(value: f32) -> __m512 { _mm512_set1_ps(value) }
            fn word(value: u32) -> __m512i { _mm512_set1_epi32(value as i32) }
            fn add(a: __m512, b: __m512) -> __m512 { _mm512_add_ps(a, b) }
            fn sub(a: __m512, b: __m512) -> __m512 { _mm512_sub_ps(a, b) }
            fn mul(a: __m512, b: __m512) -> __m512 { _mm512_mul_ps(a, b) }
            fn mul_add(a: __m512, b: __m512, c: __m512) -> __m512 { _mm512_fmadd_ps(a, b, c) }
            fn max(a: __m512, b: __m512) -> __m512 { _mm512_max_ps(a, b) }
            fn sqrt(a: __m512) -> __m512 { _mm512_sqrt_ps(a) }
            fn signed(a: __m512i) -> __m512 { _mm512_cvtepi32_ps(a) }
            fn bits(a: __m512) -> __m512i { _mm512_castps_si512(a) }
            fn to_real(a: __m512i) -> __m512 { _mm512_castsi512_ps(a) }
            fn add_word(a: __m512i, b: __m512i) -> __m512i { _mm512_add_epi32(a, b) }
            fn sub_word(a: __m512i, b: __m512i) -> __m512i { _mm512_sub_epi32(a, b) }
            fn max_word(a: __m512i, b: __m512i) -> __m512i { _mm512_max_epi32(a, b) }
            fn and(a: __m512i, b: __m512i) -> __m512i { _mm512_and_si512(a, b) }
            fn or(a: __m512i, b: __m512i) -> __m512i { _mm512_or_si512(a, b) }
            fn xor(a: __m512i, b: __m512i) -> __m512i { _mm512_xor_si512(a, b) }
            fn shift_left(a: __m512i, count: u32) -> __m512i {
                _mm512_sllv_epi32(a, _mm512_set1_epi32(count as i32))
            }
            fn shift_right(a: __m512i, count: u32) -> __m512i {
                _mm512_srlv_epi32(a, _mm512_set1_epi32(count as i32))
            }
            fn rotate_left(a: __m512i, count: u32) -> __m512i {
                _mm512_rolv_epi32(a, _mm512_set1_epi32(count as i32))
            }
            fn select_less(a: __m512i, b: __m512i, x: __m512i, y: __m512i) -> __m512i {
                _mm512_mask_blend_epi32(_mm512_cmplt_epi32_mask(a, b), y, x)
            }
            fn add_where_equal(sum: __m512, value: __m512, a: __m512i, b: __m512i) -> __m512 {
                _mm512_mask_add_ps(sum, _mm512_cmpeq_epi32_mask(a, b), sum, value)
            }
            fn last(a: __m512) -> f32 {
                _mm512_cvtss_f32(_mm512_permutexvar_ps(_mm512_set1_epi32(15), a))
            }
            fn last_word(a: __m512i) -> __m512i {
                _mm512_permutexvar_epi32(_mm512_set1_epi32(15), a)
            }
        }

        #[inline(always)]
        fn push<const N: usize>(self, a: __m512i) -> __m512i {
            let none = self.word(0);
            // SAFETY: as in `registers`.
            unsafe {
                match N {
                    1 => _mm512_alignr_epi32::<15>(a, none),
                    2 => _mm512_alignr_epi32::<14>(a, none),
                    4 => _mm512_alignr_epi32::<12>(a, none),
                    _ => _mm512_alignr_epi32::<8>(a, none),
                }
            }
        }
        #[inline(always)]
        fn load(self, from: &Block<f32>) -> __m512 {
            // SAFETY: a block is 16 numbers.
            unsafe { _mm512_loadu_ps(from.0.as_ptr()) }
        }
        #[inline(always)]
        fn load_word(self, from: &Block<u32>) -> __m512i {
            // SAFETY: a block is 16 numbers.
            unsafe { _mm512_loadu_si512(from.0.as_ptr().cast()) }
        }
        #[inline(always)]
        fn store(self, value: __m512, to: &mut Block<f32>) {
            // SAFETY: a block is 16 numbers.
            unsafe { _mm512_storeu_ps(to.0.as_mut_ptr(), value) }
        }
        #[inline(always)]
        fn store_word(self, value: __m512i, to: &mut Block<u32>) {
            // SAFETY: a block is 16 numbers.
            unsafe { _mm512_storeu_si512(to.0.as_mut_ptr().cast(), value) }
        }
        #[inline(always)]
        fn look_up(self, table: &Block<f32>, at: __m512i) -> __m512 {
            let table = self.load(table);
            // SAFETY: as in `registers`; the instruction takes the index modulo 16.
            unsafe { _mm512_permutexvar_ps(at, table) }
        }
        #[inline(always)]
        fn look_up_entry(self, table: &[u32; 256], at: __m512i) -> __m512i {
            let at = self.and(at, self.word(255));
            // SAFETY: the indices are below 256, the length of the table.
            unsafe { _mm512_i32gather_epi32::<4>(at, table.as_ptr().cast()) }
        }
        #[inline(always)]
        fn gather(self, from: &[Bundle], at: __m512i) -> Gathered<Self> {
            let last = last_address(from);
            let words = from.as_ptr().cast::<f32>();
            // SAFETY: as unsigned numbers the addresses are at most `last`, and what lies up to
            // three blocks behind it is still in the last bundle.
            unsafe {
                let at = _mm512_min_epu32(at, _mm512_set1_epi32(last));
                Gathered {
                    x: _mm512_i32gather_ps::<4>(at, words),
                    y: _mm512_i32gather_ps::<4>(at, words.add(LANES)),
                    yaw: _mm512_i32gather_ps::<4>(at, words.add(2 * LANES)),
                    mode: _mm512_i32gather_epi32::<4>(at, words.add(3 * LANES).cast()),
                }
            }
        }
        #[inline(always)]
        fn pick(self, from: &[Block<f32>], at: __m512i) -> __m512 {
            let last = last_index(from);
            // SAFETY: as unsigned numbers the indices are at most `last`, within the blocks.
            unsafe {
                let at = _mm512_min_epu32(at, _mm512_set1_epi32(last));
                _mm512_i32gather_ps::<4>(at, from.as_ptr().cast())
            }
        }
        #[inline(always)]
        fn scatter(self, to: &mut [Block<u32>], at: __m512i, values: __m512i) {
            let last = last_index(to);
            // SAFETY: as unsigned numbers the indices are at most `last`, within the blocks.
            unsafe {
                let at = _mm512_min_epu32(at, _mm512_set1_epi32(last));
                _mm512_i32scatter_epi32::<4>(to.as_mut_ptr().cast(), at, values);
            }
        }
    }

    type Pair = [__m256; 2];
    type WordPair = [__m256i; 2];

    /// Methods that are the same instruction on both registers of a pair.
    macro_rules! on_both {
        ($(fn $name:ident($($argument:ident: $kind:ty),*) -> $out:ty = $instruction:ident;)*) => {
            registers! {$(
                fn $name($($argument: $kind),*) -> $out {
                    [$instruction($($argument[0]),*), $instruction($($argument[1]),*)]
                }
            )*}
        };
    }

    impl Lanes for Avx2 {
        type Real = Pair;
        type Word = WordPair;

        on_both! {
            fn add(a: Pair, b: Pair) -> Pair = _mm256_add_ps;
            fn sub(a: Pair, b: Pair) -> Pair = _mm256_sub_ps;
            fn mul(a: Pair, b: Pair) -> Pair = _mm256_mul_ps;
            fn mul_add(a: Pair, b: Pair, c: Pair) -> Pair = _mm256_fmadd_ps;
            fn max(a: Pair, b: Pair) -> Pair = _mm256_max_ps;
            fn sqrt(a: Pair) -> Pair = _mm256_sqrt_ps;
            fn signed(a: WordPair) -> Pair = _mm256_cvtepi32_ps;
            fn bits(a: Pair) -> WordPair = _mm256_castps_si256;
            fn to_real(a: WordPair) -> Pair = _mm256_castsi256_ps;
            fn add_word(a: WordPair, b: WordPair) -> WordPair = _mm256_add_epi32;
            fn sub_word(a: WordPair, b: WordPair) -> WordPair = _mm256_sub_epi32;
            fn max_word(a: WordPair, b: WordPair) -> WordPair = _mm256_max_epi32;
            fn and(a: WordPair, b: WordPair) -> WordPair = _mm256_and_si256;
            fn or(a: WordPair, b: WordPair) -> WordPair = _mm256_or_si256;
            fn xor(a: WordPair, b: WordPair) -> WordPair = _mm256_xor_si256;
        }

        registers! {
            fn real(value: f32) -> Pair { [_mm256_set1_ps(value); 2] }
            fn word(value: u32) -> WordPair { [_mm256_set1_epi32(value as i32); 2] }
            fn shift_left(a: WordPair, count: u32) -> WordPair {
                [
                    _mm256_sllv_epi32(a[0], _mm256_set1_epi32(count as i32)),
                    _mm256_sllv_epi32(a[1], _mm256_set1_epi32(count as i32)),
                ]
            }
            fn shift_right(a: WordPair, count: u32) -> WordPair {
                [
                    _mm256_srlv_epi32(a[0], _mm256_set1_epi32(count as i32)),
                    _mm256_srlv_epi32(a[1], _mm256_set1_epi32(count as i32)),
                ]
            }
            fn select_less(a: WordPair, b: WordPair, x: WordPair, y: WordPair) -> WordPair {
                [
                    _mm256_blendv_epi8(y[0], x[0], _mm256_cmpgt_epi32(b[0], a[0])),
                    _mm256_blendv_epi8(y[1], x[1], _mm256_cmpgt_epi32(b[1], a[1])),
                ]
            }
            fn last(a: Pair) -> f32 {
                _mm256_cvtss_f32(_mm256_permutevar8x32_ps(a[1], _mm256_set1_epi32(7)))
            }
            fn last_word(a: WordPair) -> WordPair {
                [_mm256_permutevar8x32_epi32(a[1], _mm256_set1_epi32(7)); 2]
            }
        }

        #[inline(always)]
        fn push<const N: usize>(self, a: WordPair) -> WordPair {
            // SAFETY: as in `registers`.
            unsafe {
                let far = [
                    _mm256_permute2x128_si256::<0x08>(a[0], a[0]),
                    _mm256_permute2x128_si256::<0x21>(a[0], a[1]),
                ];
                // Each half of a register takes its first lanes from the half before it.
                match N {
                    1 => [
                        _mm256_alignr_epi8::<12>(a[0], far[0]),
                        _mm256_alignr_epi8::<12>(a[1], far[1]),
                    ],
                    2 => [
                        _mm256_alignr_epi8::<8>(a[0], far[0]),
                        _mm256_alignr_epi8::<8>(a[1], far[1]),
                    ],
                    4 => far,
                    _ => [_mm256_setzero_si256(), a[0]],
                }
            }
        }
        #[inline(always)]
        fn rotate_left(self, a: WordPair, count: u32) -> WordPair {
            self.or(self.shift_left(a, count), self.shift_right(a, 32 - count))
        }
        #[inline(always)]
        fn load(self, from: &Block<f32>) -> Pair {
            let [low, high] = halves(&from.0);
            // SAFETY: each half is 8 numbers.
            unsafe {
                [
                    _mm256_loadu_ps(low.as_ptr()),
                    _mm256_loadu_ps(high.as_ptr()),
                ]
            }
        }
        #[inline(always)]
        fn load_word(self, from: &Block<u32>) -> WordPair {
            let [low, high] = halves(&from.0).map(|half| half.as_ptr().cast());
            // SAFETY: each half is 8 numbers.
            unsafe { [_mm256_loadu_si256(low), _mm256_loadu_si256(high)] }
        }
        #[inline(always)]
        fn store(self, value: Pair, to: &mut Block<f32>) {
            // SAFETY: a block is 16 numbers.
            unsafe {
                _mm256_storeu_ps(to.0.as_mut_ptr(), value[0]);
                _mm256_storeu_ps(to.0.as_mut_ptr().add(8), value[1]);
            }
        }
        #[inline(always)]
        fn store_word(self, value: WordPair, to: &mut Block<u32>) {
            // SAFETY: a block is 16 numbers.
            unsafe {
                _mm256_storeu_si256(to.0.as_mut_ptr().cast(), value[0]);
                _mm256_storeu_si256(to.0.as_mut_ptr().add(8).cast(), value[1]);
            }
        }
        #[inline(always)]
        fn add_where_equal(self, sum: Pair, value: Pair, a: WordPair, b: WordPair) -> Pair {
            // SAFETY: as in `registers`.
            let equal = unsafe {
                [
                    _mm256_cmpeq_epi32(a[0], b[0]),
                    _mm256_cmpeq_epi32(a[1], b[1]),
                ]
            };
            self.add(sum, self.to_real(self.and(self.bits(value), equal)))
        }
        #[inline(always)]
        fn look_up(self, table: &Block<f32>, at: WordPair) -> Pair {
            let [low, high] = self.load(table);
            let high_half = self.to_real(self.shift_left(at, 28));
            // SAFETY: as in `registers`; the permutations take the index modulo 8, and the fourth
            // bit, moved to the sign, selects between them.
            unsafe {
                let of = |at, mask| {
                    let (a, b) = (
                        _mm256_permutevar8x32_ps(low, at),
                        _mm256_permutevar8x32_ps(high, at),
                    );
                    _mm256_blendv_ps(a, b, mask)
                };
                [of(at[0], high_half[0]), of(at[1], high_half[1])]
            }
        }
        #[inline(always)]
        fn look_up_entry(self, table: &[u32; 256], at: WordPair) -> WordPair {
            let at = self.and(at, self.word(255));
            let table = table.as_ptr().cast();
            // SAFETY: the indices are below 256, the length of the table.
            unsafe {
                [
                    _mm256_i32gather_epi32::<4>(table, at[0]),
                    _mm256_i32gather_epi32::<4>(table, at[1]),
                ]
            }
        }
        #[inline(always)]
        fn gather(self, from: &[Bundle], at: WordPair) -> Gathered<Self> {
            let last = last_address(from);
            let words = from.as_ptr().cast::<f32>();
            // SAFETY: as unsigned numbers the addresses are at most `last`, and what lies up to
            // three blocks behind it is still in the last bundle.
            unsafe {
                let last = _mm256_set1_epi32(last);
                let at = [_mm256_min_epu32(at[0], last), _mm256_min_epu32(at[1], last)];
                let part = |offset| {
                    let words = words.add(offset);
                    [
                        _mm256_i32gather_ps::<4>(words, at[0]),
                        _mm256_i32gather_ps::<4>(words, at[1]),
                    ]
                };
                Gathered {
                    x: part(0),
                    y: part(LANES),
                    yaw: part(2 * LANES),
                    mode: self.bits(part(3 * LANES)),
                }
            }
        }
        #[inline(always)]
        fn pick(self, from: &[Block<f32>], at: WordPair) -> Pair {
            let (last, numbers) = (last_index(from), from.as_ptr().cast::<f32>());
            // SAFETY: as unsigned numbers the indices are at most `last`, within the blocks.
            at.map(|at| unsafe {
                let at = _mm256_min_epu32(at, _mm256_set1_epi32(last));
                _mm256_i32gather_ps::<4>(numbers, at)
            })
        }
        #[inline(always)]
        fn scatter(self, to: &mut [Block<u32>], at: WordPair, values: WordPair) {
            let (mut indices, mut words) = (Block::splat(0), Block::splat(0));
            self.store_word(at, &mut indices);
            self.store_word(values, &mut words);
            // There is no such instruction.
            Plain::<true>.scatter(to, indices.0, words.0);
        }
    }

    /// The registers' parts of a block.
    #[inline(always)]
    fn halves<T>(lanes: &[T; LANES]) -> [&[T]; 2] {
        let (low, high) = lanes.split_at(LANES / 2);
        [low, high]
    }
}

//! What the kernels ask of a processor: 16 numbers at a time.

/// Lanes of every kernel, whatever the width of the processor's registers: the order of sums, and
/// with it every bit of the result, does not depend on the processor.
pub(super) const LANES: usize = 16;

/// Sixteen numbers, one cache line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(64))]
pub(super) struct Block<T>(pub [T; LANES]);

impl<T: Copy> Block<T> {
    /// The same number in all lanes.
    pub(super) const fn splat(value: T) -> Self {
        Self([value; LANES])
    }
}

/// Sixteen particles. One pass touches all of a particle, so its parts lie close together.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Bundle {
    /// m.
    pub x: Block<f32>,
    /// m.
    pub y: Block<f32>,
    /// rad, within ±π.
    pub yaw: Block<f32>,
    /// Below the number of modes.
    pub mode: Block<u32>,
}

/// Numbers in a bundle.
pub(super) const BUNDLE_WORDS: usize = 4 * LANES;

const _: () = assert!(size_of::<Bundle>() == 4 * BUNDLE_WORDS);
const _: () = assert!(size_of::<Block<f32>>() == 64 && align_of::<Block<f32>>() == 64);

/// Particles as the kernels see them in registers.
#[derive(Clone, Copy)]
pub(super) struct Gathered<L: Lanes> {
    pub x: L::Real,
    pub y: L::Real,
    pub yaw: L::Real,
    pub mode: L::Word,
}

/// Operations on 16 lanes. The value itself is the permission to use its instructions.
///
/// Every operation rounds as IEEE 754 says, so that all implementations whose
/// [`mul_add`](Self::mul_add) is fused agree in every bit.
pub(super) trait Lanes: Copy {
    /// 16 x f32.
    type Real: Copy;
    /// 16 x u32; shifts are logical, comparisons signed.
    type Word: Copy;

    fn real(self, value: f32) -> Self::Real;
    fn word(self, value: u32) -> Self::Word;
    fn load(self, from: &Block<f32>) -> Self::Real;
    fn load_word(self, from: &Block<u32>) -> Self::Word;
    fn store(self, value: Self::Real, to: &mut Block<f32>);
    fn store_word(self, value: Self::Word, to: &mut Block<u32>);

    fn add(self, a: Self::Real, b: Self::Real) -> Self::Real;
    fn sub(self, a: Self::Real, b: Self::Real) -> Self::Real;
    fn mul(self, a: Self::Real, b: Self::Real) -> Self::Real;
    /// `a b + c`, rounded once where the level has such an instruction, else twice.
    fn mul_add(self, a: Self::Real, b: Self::Real, c: Self::Real) -> Self::Real;
    /// The larger; neither may be NaN.
    fn max(self, a: Self::Real, b: Self::Real) -> Self::Real;
    fn sqrt(self, a: Self::Real) -> Self::Real;
    /// The word as a signed integer, rounded.
    fn signed(self, a: Self::Word) -> Self::Real;
    fn bits(self, a: Self::Real) -> Self::Word;
    fn to_real(self, a: Self::Word) -> Self::Real;

    /// Modulo 2^32, like the next.
    fn add_word(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn sub_word(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn and(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn or(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn xor(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn shift_left(self, a: Self::Word, count: u32) -> Self::Word;
    fn shift_right(self, a: Self::Word, count: u32) -> Self::Word;
    fn rotate_left(self, a: Self::Word, count: u32) -> Self::Word;
    /// `a < b ? x : y`.
    fn select_less(self, a: Self::Word, b: Self::Word, x: Self::Word, y: Self::Word) -> Self::Word;

    /// `sum + value` where `a == b`, else `sum`; `sum` is not the negative zero.
    fn add_where_equal(
        self,
        sum: Self::Real,
        value: Self::Real,
        a: Self::Word,
        b: Self::Word,
    ) -> Self::Real;

    /// `table[at mod 16]`.
    fn look_up(self, table: &Block<f32>, at: Self::Word) -> Self::Real;
    /// `table[at mod 256]`.
    fn look_up_entry(self, table: &[u32; 256], at: Self::Word) -> Self::Word;
    /// The particles at the addresses `at`: 64 times the bundle's index, plus the lane. Addresses
    /// out of range are clamped; there must be a bundle.
    fn gather(self, from: &[Bundle], at: Self::Word) -> Gathered<Self>;
    /// The numbers at the indices `at`. Indices out of range are clamped; there must be a block.
    fn pick(self, from: &[Block<f32>], at: Self::Word) -> Self::Real;
    /// Writes `values` at the indices `at`, in the order of lanes: of equal indices the last wins.
    /// Indices out of range are clamped; there must be a block.
    fn scatter(self, to: &mut [Block<u32>], at: Self::Word, values: Self::Word);

    fn max_word(self, a: Self::Word, b: Self::Word) -> Self::Word;
    /// Moves each lane up by `N`: 1, 2, 4 or 8; zeros enter.
    fn push<const N: usize>(self, a: Self::Word) -> Self::Word;
    /// The last lane.
    fn last(self, a: Self::Real) -> f32;
    /// The last lane in all lanes.
    fn last_word(self, a: Self::Word) -> Self::Word;

    /// The lane before, or 0.
    #[inline(always)]
    fn before(self, a: Self::Real) -> Self::Real {
        self.to_real(self.push::<1>(self.bits(a)))
    }

    /// Inclusive prefix sums.
    #[inline(always)]
    fn prefix_sum(self, a: Self::Real) -> Self::Real {
        let a = self.add(a, self.before(a));
        let a = self.add(a, self.to_real(self.push::<2>(self.bits(a))));
        let a = self.add(a, self.to_real(self.push::<4>(self.bits(a))));
        self.add(a, self.to_real(self.push::<8>(self.bits(a))))
    }

    /// Inclusive prefix maxima of words below 2^31.
    #[inline(always)]
    fn prefix_max(self, a: Self::Word) -> Self::Word {
        let a = self.max_word(a, self.push::<1>(a));
        let a = self.max_word(a, self.push::<2>(a));
        let a = self.max_word(a, self.push::<4>(a));
        self.max_word(a, self.push::<8>(a))
    }

    /// The lanes' sum in double precision, in the order of lanes.
    #[inline(always)]
    fn total(self, a: Self::Real) -> f64 {
        let mut block = Block::splat(0.0);
        self.store(a, &mut block);
        block.0.iter().map(|&lane| f64::from(lane)).sum()
    }

    /// The polynomial with `coefficients` from the constant up, by Horner's rule.
    #[inline(always)]
    fn polynomial<const N: usize>(self, x: Self::Real, coefficients: [f32; N]) -> Self::Real {
        let mut sum = self.real(coefficients[N - 1]);
        for &coefficient in coefficients[..N - 1].iter().rev() {
            sum = self.mul_add(sum, x, self.real(coefficient));
        }
        sum
    }
}

/// Code that runs on any lanes; its `run` and all that it calls are inlined, so that one body is
/// compiled for each level.
pub(super) trait Kernel {
    fn run<L: Lanes>(self, lanes: L);
}

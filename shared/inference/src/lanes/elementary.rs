//! Elementary functions in single precision, as polynomials fitted for least largest error.

use super::vector::Lanes;

/// Added to a number of magnitude below 2^22 it leaves the nearest integer (ties to even) in the
/// low bits; subtracted again, that integer as a number.
pub(super) const ROUNDER: f32 = 12_582_912.0;

/// The least exponent of a normal number: what is smaller than `2^-126` counts as that.
pub(super) const EXPONENT_MIN: f32 = -126.0;

/// The nearest integer, for magnitudes below 2^22.
#[inline(always)]
pub(super) fn round<L: Lanes>(l: L, x: L::Real) -> L::Real {
    let rounder = l.real(ROUNDER);
    l.sub(l.add(x, rounder), rounder)
}

/// `-ln x` for x in (0, 1]; relative error 2e-6.
#[inline(always)]
pub(super) fn negative_ln<L: Lanes>(l: L, x: L::Real) -> L::Real {
    // x = m 2^e with m in [√½, √2).
    let half_root = l.word(std::f32::consts::FRAC_1_SQRT_2.to_bits());
    let offset = l.sub_word(l.bits(x), half_root);
    // Arithmetic shift by 23: the exponent is 0 or negative, above -64.
    let exponent = l.sub_word(
        l.shift_right(l.add_word(offset, l.word(64 << 23)), 23),
        l.word(64),
    );
    let mantissa = l.add_word(l.and(offset, l.word(0x007f_ffff)), half_root);
    let f = l.sub(l.to_real(mantissa), l.real(1.0));
    let slope = l.polynomial(
        f,
        [
            -1.000_001,
            0.500_011_15,
            -0.333_145_08,
            0.249_097_44,
            -0.204_963_3,
            0.186_678_53,
            -0.118_961_02,
        ],
    );
    let whole = l.mul(l.signed(exponent), l.real(-std::f32::consts::LN_2));
    l.mul_add(f, slope, whole)
}

/// `2^x` for x from -126 to 126; relative error 3e-7.
#[inline(always)]
pub(super) fn exp2<L: Lanes>(l: L, x: L::Real) -> L::Real {
    let shifted = l.add(x, l.real(ROUNDER));
    let f = l.sub(x, l.sub(shifted, l.real(ROUNDER)));
    let mantissa = l.polynomial(
        f,
        [
            1.000_000_1,
            0.693_146_94,
            0.240_221_2,
            0.055_507_13,
            0.009_675_541,
            0.001_327_647_1,
        ],
    );
    l.to_real(l.add_word(l.bits(mantissa), l.shift_left(l.bits(shifted), 23)))
}

/// Sine and cosine of an angle (rad) within ±4π; error 3e-7.
#[inline(always)]
pub(super) fn sin_cos<L: Lanes>(l: L, angle: L::Real) -> (L::Real, L::Real) {
    // Half turns only change both signs: no swap of sine and cosine is needed.
    let turns = l.mul(angle, l.real(std::f32::consts::FRAC_1_PI));
    let shifted = l.add(turns, l.real(ROUNDER));
    let whole = l.sub(shifted, l.real(ROUNDER));
    let r = l.mul_add(whole, l.real(-std::f32::consts::PI), angle);
    let sign = l.shift_left(l.bits(shifted), 31);
    let t = l.mul(r, r);
    let sine = l.polynomial(
        t,
        [
            1.0,
            -0.166_666_57,
            0.008_333_025_5,
            -0.000_198_074_2,
            2.601_903e-6,
        ],
    );
    let cosine = l.polynomial(
        t,
        [
            1.0,
            -0.499_999_05,
            0.041_663_583,
            -0.001_385_370_4,
            2.315_393_2e-5,
        ],
    );
    let flip = |value| l.to_real(l.xor(l.bits(value), sign));
    (flip(l.mul(sine, r)), flip(cosine))
}

/// An angle (rad) of a few turns moved by whole turns into ±π.
#[inline(always)]
pub(super) fn wrap<L: Lanes>(l: L, angle: L::Real) -> L::Real {
    let turns = round(l, l.mul(angle, l.real(0.5 * std::f32::consts::FRAC_1_PI)));
    l.mul_add(turns, l.real(-std::f32::consts::TAU), angle)
}

//! The ways in which an encoder that follows its wheel is off by a size.

/// Ways with a size: gain, bias, drift, delay.
pub const WAYS: usize = 4;
/// Index of each among them.
pub const GAIN: usize = 0;
/// See [`GAIN`].
pub const BIAS: usize = 1;
/// See [`GAIN`].
pub const DRIFT: usize = 2;
/// See [`GAIN`].
pub const DELAY: usize = 3;
/// Prior shares among all ways in which an encoder breaks. Chosen: together a third of the
/// breakages; a gain costs 1 nat beside a freeze.
pub const SIZED_SHARES: [f64; WAYS] = [0.12, 0.12, 0.04, 0.08];

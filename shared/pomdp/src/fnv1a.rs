//! 64-bit FNV-1a: hashes of models.

/// Offset basis.
pub const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// Continues `hash` over `bytes`.
pub fn hash(hash: u64, bytes: &[u8]) -> u64 {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(PRIME);
    bytes.iter().fold(hash, step)
}

/// Continues `hash` over the little-endian bytes of `value`.
pub fn hash_u64(hash: u64, value: u64) -> u64 {
    self::hash(hash, &value.to_le_bytes())
}

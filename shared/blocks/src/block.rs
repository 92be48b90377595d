//! The block trait, and the macro that defines a block with its schema hash.

use bytemuck::Pod;

use crate::header::Header;

/// A fixed-size wire block. Implement it with the [`block!`](crate::block!) macro only: it derives
/// the schema hash from the names, types and offsets of the fields, so that two sides whose layouts
/// differ never connect.
pub trait Block: Pod + PartialEq + core::fmt::Debug {
    /// FNV-1a hash over the block's name and, per field, name, type text and offset, then size
    /// and alignment. Also stored in [`Header::schema`] of each block.
    const SCHEMA: u64;
    /// Name under which the transport matches types: `vigil.<Name>.v1.<schema in hex>`.
    const TYPE_NAME: &'static str;

    /// The common header (first field of every block).
    fn header(&self) -> &Header;
    /// The common header, for the writer.
    fn header_mut(&mut self) -> &mut Header;
}

/// 64-bit FNV-1a over `bytes`, starting from `hash` (use [`fnv1a::BASIS`] to begin).
pub mod fnv1a {
    /// Offset basis of 64-bit FNV-1a.
    pub const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;

    /// Continues `hash` over `bytes`.
    #[must_use]
    pub const fn hash(mut hash: u64, bytes: &[u8]) -> u64 {
        let mut i = 0;
        while i < bytes.len() {
            hash = (hash ^ bytes[i] as u64).wrapping_mul(PRIME);
            i += 1;
        }
        hash
    }

    /// Continues `hash` over the little-endian bytes of `value`.
    #[must_use]
    pub const fn hash_u64(hash: u64, value: u64) -> u64 {
        self::hash(hash, &value.to_le_bytes())
    }
}

/// Builds `<prefix><hex of hash>` at compile time; `N` must be `prefix.len() + 16`.
#[doc(hidden)]
#[must_use]
pub const fn name_with_hash<const N: usize>(prefix: &str, hash: u64) -> [u8; N] {
    let (mut out, bytes) = ([0_u8; N], prefix.as_bytes());
    assert!(N == bytes.len() + 16);
    let mut i = 0;
    while i < bytes.len() {
        out[i] = bytes[i];
        i += 1;
    }
    let mut digit = 0;
    while digit < 16 {
        let nibble = ((hash >> (60 - 4 * digit)) & 0xf) as u8;
        out[bytes.len() + digit] = if nibble < 10 {
            b'0' + nibble
        } else {
            b'a' + nibble - 10
        };
        digit += 1;
    }
    out
}

/// Reads compile-time ASCII as text.
#[doc(hidden)]
#[must_use]
pub const fn ascii(bytes: &'static [u8]) -> &'static str {
    match core::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(_) => "invalid",
    }
}

/// Defines a block: the `#[repr(C)]` struct, its schema hash, its type name, and the compile-time
/// assertions on header position, alignment and size. Whoever uses it needs `bytemuck`.
#[macro_export]
macro_rules! block {
    (
        $(#[$meta:meta])*
        pub struct $name:ident, size $size:literal {
            $( $(#[$field_meta:meta])* pub $field:ident : $ty:ty, )+
        }
    ) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $( $(#[$field_meta])* pub $field : $ty, )+ }

        $crate::layout!($name { $( $([$field_meta])* $field : $ty, )+ });

        impl $crate::Block for $name {
            const SCHEMA: u64 = {
                let mut h = $crate::fnv1a::hash($crate::fnv1a::BASIS, stringify!($name).as_bytes());
                $(
                    h = $crate::fnv1a::hash(h, stringify!($field).as_bytes());
                    h = $crate::fnv1a::hash(h, stringify!($ty).as_bytes());
                    h = $crate::fnv1a::hash_u64(h, core::mem::offset_of!($name, $field) as u64);
                )+
                h = $crate::fnv1a::hash_u64(h, size_of::<$name>() as u64);
                $crate::fnv1a::hash_u64(h, align_of::<$name>() as u64)
            };
            const TYPE_NAME: &'static str = {
                const PREFIX: &str = concat!("vigil.", stringify!($name), ".v1.");
                const BYTES: [u8; PREFIX.len() + 16] =
                    $crate::name_with_hash(PREFIX, <$name as $crate::Block>::SCHEMA);
                $crate::ascii(&BYTES)
            };
            fn header(&self) -> &$crate::Header { &self.header }
            fn header_mut(&mut self) -> &mut $crate::Header { &mut self.header }
        }

        const _: () = {
            assert!(core::mem::offset_of!($name, header) == 0);
            assert!(align_of::<$name>() <= 8);
            assert!(size_of::<$name>() == $size);
        };

        impl Default for $name {
            /// All zero: a valid, empty block.
            fn default() -> Self { bytemuck::Zeroable::zeroed() }
        }
    };
}
pub(crate) use block;

#[cfg(test)]
mod tests {
    use crate::{Block, SensorFrame};

    #[test]
    fn fnv1a_matches_its_published_test_vectors() {
        use super::fnv1a::{BASIS, hash};
        assert_eq!(hash(BASIS, b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(hash(BASIS, b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(hash(BASIS, b"foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn swapping_two_fields_of_equal_type_changes_the_schema() {
        mod a {
            block! { pub struct Swap, size 64 {
            pub header: crate::Header, pub first: u64, pub second: u64, } }
        }
        mod b {
            block! { pub struct Swap, size 64 {
            pub header: crate::Header, pub second: u64, pub first: u64, } }
        }
        assert_ne!(a::Swap::SCHEMA, b::Swap::SCHEMA);
        assert_ne!(a::Swap::TYPE_NAME, b::Swap::TYPE_NAME);
    }

    #[test]
    fn the_type_name_carries_the_schema_hash() {
        let expected = format!("vigil.SensorFrame.v1.{:016x}", SensorFrame::SCHEMA);
        assert_eq!(SensorFrame::TYPE_NAME, expected);
    }
}

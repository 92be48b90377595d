//! What a struct of the wire looks like, field by field: other languages' types are made of it.

/// One field of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: &'static str,
    /// Type as it is written in Rust: `u64`, `[f64; WHEELS]`, `Header`.
    pub type_text: &'static str,
    /// Bytes before it.
    pub offset: usize,
    /// Bytes of it.
    pub size: usize,
    /// Its documentation, line by line, each as the attribute says it: `doc = r" Text."`.
    pub doc: &'static [&'static str],
}

/// A struct whose fields are known.
pub trait Layout {
    /// Name of the struct.
    const NAME: &'static str;
    /// Its fields, in order and without gaps.
    const FIELDS: &'static [Field];
}

/// Implements [`Layout`] for a struct, given its fields again.
#[doc(hidden)]
#[macro_export]
macro_rules! layout {
    ($name:ident { $( $([$doc:meta])* $field:ident : $ty:ty, )+ }) => {
        impl $crate::layout::Layout for $name {
            const NAME: &'static str = stringify!($name);
            const FIELDS: &'static [$crate::layout::Field] = &[ $(
                $crate::layout::Field {
                    name: stringify!($field),
                    type_text: stringify!($ty),
                    offset: core::mem::offset_of!($name, $field),
                    size: size_of::<$ty>(),
                    doc: &[ $( stringify!($doc) ),* ],
                },
            )+ ];
        }
    };
}

/// Defines a struct that is part of blocks: `#[repr(C)]`, plain data, without gaps.
macro_rules! part {
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

        const _: () = assert!(size_of::<$name>() == $size);

        impl Default for $name {
            /// All zero.
            fn default() -> Self { bytemuck::Zeroable::zeroed() }
        }
    };
}
pub(crate) use part;

#[cfg(test)]
mod tests {
    use super::Layout;
    use crate::{
        Action, DetectionBelief, FaultBelief, Header, Health, ParticleBlock, SensorFrame, Truth,
    };

    #[test]
    fn fields_follow_each_other_without_gaps() {
        fn check<T: Layout>() {
            let mut end = 0;
            for field in T::FIELDS {
                assert_eq!(field.offset, end, "{}::{}", T::NAME, field.name);
                assert!(!field.doc.is_empty(), "{}::{}", T::NAME, field.name);
                end += field.size;
            }
            assert_eq!(end, size_of::<T>(), "{}", T::NAME);
        }
        check::<Header>();
        check::<SensorFrame>();
        check::<DetectionBelief>();
        check::<ParticleBlock>();
        check::<FaultBelief>();
        check::<Action>();
        check::<Health>();
        check::<Truth>();
    }
}

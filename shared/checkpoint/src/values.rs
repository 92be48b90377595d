//! Numbers, and what is made of values.

use std::collections::VecDeque;

use rand_pcg::Pcg64Mcg;

use crate::reader::CheckpointReader;
use crate::state::{Checkpoint, CheckpointValue};
use crate::writer::CheckpointWriter;

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Checkpoint for $number {
            #[inline]
            fn save(&self, to: &mut CheckpointWriter<'_>) {
                to.put(&self.to_le_bytes());
            }
            #[inline]
            fn load(&mut self, from: &mut CheckpointReader<'_>) {
                *self = Self::read(from);
            }
        }
        impl CheckpointValue for $number {
            #[inline]
            fn read(from: &mut CheckpointReader<'_>) -> Self {
                Self::from_le_bytes(from.take())
            }
        }
    )*};
}

numbers!(u8, u16, u32, u64, i32, i64, f64);

/// A value that is saved as another one.
macro_rules! saved_as {
    ($value:ty, $other:ty, $to:expr, $from:expr) => {
        impl Checkpoint for $value {
            fn save(&self, to: &mut CheckpointWriter<'_>) {
                let into: fn(&$value) -> $other = $to;
                into(self).save(to);
            }
            fn load(&mut self, from: &mut CheckpointReader<'_>) {
                *self = Self::read(from);
            }
        }
        impl CheckpointValue for $value {
            fn read(from: &mut CheckpointReader<'_>) -> Self {
                let back: fn($other, &mut CheckpointReader<'_>) -> $value = $from;
                let other = <$other>::read(from);
                back(other, from)
            }
        }
    };
}

saved_as!(usize, u64, |value| *value as u64, |saved, from| {
    usize::try_from(saved).unwrap_or_else(|_| {
        from.fail("usize");
        0
    })
});
saved_as!(bool, u8, |value| u8::from(*value), |saved, from| {
    if saved > 1 {
        from.fail("bool");
    }
    saved == 1
});
// The library shows its state to serde alone.
saved_as!(
    Pcg64Mcg,
    [u8; 16],
    |rng| {
        let mut bytes = [0; 16];
        let fixed = bincode::config::standard().with_fixed_int_encoding();
        let written = bincode::serde::encode_into_slice(rng, &mut bytes, fixed);
        assert!(
            matches!(written, Ok(16)),
            "a generator's state is of 16 bytes"
        );
        bytes
    },
    |bytes, from| {
        let fixed = bincode::config::standard().with_fixed_int_encoding();
        let read = bincode::serde::decode_from_slice(&bytes, fixed);
        read.map(|(rng, _)| rng).unwrap_or_else(|_| {
            from.fail("Pcg64Mcg");
            Pcg64Mcg::new(1)
        })
    }
);

impl<T: Checkpoint, const N: usize> Checkpoint for [T; N] {
    fn save(&self, to: &mut CheckpointWriter<'_>) {
        self.iter().for_each(|one| one.save(to));
    }
    fn load(&mut self, from: &mut CheckpointReader<'_>) {
        self.iter_mut().for_each(|one| one.load(from));
    }
}

impl<T: CheckpointValue, const N: usize> CheckpointValue for [T; N] {
    fn read(from: &mut CheckpointReader<'_>) -> Self {
        std::array::from_fn(|_| T::read(from))
    }
}

impl<T: Checkpoint + ?Sized> Checkpoint for Box<T> {
    fn save(&self, to: &mut CheckpointWriter<'_>) {
        (**self).save(to);
    }
    fn load(&mut self, from: &mut CheckpointReader<'_>) {
        (**self).load(from);
    }
}

impl<T: CheckpointValue> CheckpointValue for Box<T> {
    fn read(from: &mut CheckpointReader<'_>) -> Self {
        Self::new(T::read(from))
    }
}

macro_rules! sequences {
    ($($sequence:ident),*) => {$(
        impl<T: CheckpointValue> Checkpoint for $sequence<T> {
            fn save(&self, to: &mut CheckpointWriter<'_>) {
                to.mark(self.len() as u32);
                self.iter().for_each(|one| one.save(to));
            }
            /// Keeps the room that there is.
            fn load(&mut self, from: &mut CheckpointReader<'_>) {
                self.clear();
                let length = from.length(stringify!($sequence));
                // Nothing more after a misfit: a length alone takes no memory.
                let sound = (0..length).map_while(|_| from.is_sound().then(|| T::read(from)));
                self.extend(sound);
            }
        }
        impl<T: CheckpointValue> CheckpointValue for $sequence<T> {
            fn read(from: &mut CheckpointReader<'_>) -> Self {
                let mut all = Self::new();
                all.load(from);
                all
            }
        }
    )*};
}

sequences!(Vec, VecDeque);

impl<T: CheckpointValue> Checkpoint for Option<T> {
    fn save(&self, to: &mut CheckpointWriter<'_>) {
        self.is_some().save(to);
        if let Some(value) = self {
            value.save(to);
        }
    }
    fn load(&mut self, from: &mut CheckpointReader<'_>) {
        *self = Self::read(from);
    }
}

impl<T: CheckpointValue> CheckpointValue for Option<T> {
    fn read(from: &mut CheckpointReader<'_>) -> Self {
        bool::read(from).then(|| T::read(from))
    }
}

macro_rules! tuples {
    ($(($($name:ident $place:tt),*)),*) => {$(
        impl<$($name: Checkpoint),*> Checkpoint for ($($name,)*) {
            fn save(&self, to: &mut CheckpointWriter<'_>) {
                $(self.$place.save(to);)*
            }
            fn load(&mut self, from: &mut CheckpointReader<'_>) {
                $(self.$place.load(from);)*
            }
        }
        impl<$($name: CheckpointValue),*> CheckpointValue for ($($name,)*) {
            fn read(from: &mut CheckpointReader<'_>) -> Self {
                ($($name::read(from),)*)
            }
        }
    )*};
}

tuples!((A 0, B 1), (A 0, B 1, C 2));

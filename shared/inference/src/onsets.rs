//! Components of a detection filter by the age of their onset, in bounded number.
//!
//! Onsets are resolved in proportion to their age: the last one or two are kept one by one, older
//! ones in pairs, then in fours, and so on. Where two components become one, what
//! [`Onset::merged`] keeps of both is kept.

/// Levels: a component of level j holds 2^j successive onsets, one of the last level any number.
/// Two of each of nine levels resolve 1022 onsets, 51 s of 50 ms observations; older ones share
/// one.
const LEVELS: usize = 9;
/// Components per level at most. With one, delays are longer by up to a third; with four they are
/// not shorter.
const PER_LEVEL: usize = 2;
const COMPONENTS: usize = LEVELS * PER_LEVEL;

/// A component: something that began at one of some successive steps.
pub trait Onset: Copy {
    /// One component in place of this one and an older one.
    #[must_use]
    fn merged(&self, older: &Self) -> Self;
}

/// The components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onsets<C> {
    /// By level, the younger of a level first.
    components: [Option<C>; COMPONENTS],
}

impl<C: Onset> Default for Onsets<C> {
    fn default() -> Self {
        Self {
            components: [None; COMPONENTS],
        }
    }
}

impl<C: Onset> Onsets<C> {
    /// The components there are.
    pub fn iter(&self) -> impl Iterator<Item = &C> + Clone {
        self.components.iter().flatten()
    }

    /// The same, for the caller's prediction and update.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut C> {
        self.components.iter_mut().flatten()
    }

    /// Drops the components that are not wanted.
    pub fn retain(&mut self, wanted: impl Fn(&C) -> bool) {
        for place in &mut self.components {
            *place = place.filter(&wanted);
        }
    }

    /// Adds the youngest component. A full level hands its two on as one.
    pub fn enter(&mut self, mut younger: C) {
        for level in 0..LEVELS {
            let first = level * PER_LEVEL;
            let (one, two) = (self.components[first], self.components[first + 1]);
            self.components[first] = Some(younger);
            let (Some(one), Some(two)) = (one, two) else {
                self.components[first + 1] = one.or(two);
                return;
            };
            let both = one.merged(&two);
            if level == LEVELS - 1 {
                self.components[first + 1] = Some(both);
                return;
            }
            self.components[first + 1] = None;
            younger = both;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many onsets a component holds.
    impl Onset for u64 {
        fn merged(&self, older: &Self) -> Self {
            self + older
        }
    }

    #[test]
    fn the_younger_an_onset_the_finer_it_is_kept() {
        let mut onsets = Onsets::<u64>::default();
        for step in 1..=2000 {
            onsets.enter(1);
            assert_eq!(onsets.iter().sum::<u64>(), step);
        }
        let held: Vec<u64> = onsets.iter().copied().collect();
        assert!(held.is_sorted() && held[0] == 1 && held.len() <= COMPONENTS);
        assert!(
            held[..held.len() - 1]
                .iter()
                .all(|held| held.is_power_of_two())
        );
        onsets.retain(|held| *held > 1);
        assert!(onsets.iter().all(|held| *held > 1));
    }
}

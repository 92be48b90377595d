//! A bounded number of components of a detection filter, by the age of their onset.
//!
//! Onsets are resolved in proportion to their age: the last one or two singly, older ones in pairs,
//! then in fours, and so on. [`Onset::merged`] makes one component of two.

use vigil_checkpoint::CheckpointValue;

/// Levels: a component of level j holds 2^j successive onsets, one of the last level any number.
/// Chosen by hand: two of each of nine levels resolve 1022 onsets, 51 s at 20 observations per
/// second; older ones share one. Fewer levels blur faults that are hard to detect; more cost time.
const LEVELS: usize = 9;
/// Largest number of components of a level. Measured on simulated biases: with one, delays are up
/// to a third longer; with four, not shorter.
const PER_LEVEL: usize = 2;
const COMPONENTS: usize = LEVELS * PER_LEVEL;

/// A component: a hypothesis that began at one of some successive steps.
pub trait Onset: Copy {
    /// The component that replaces this one and an older one.
    #[must_use]
    fn merged(&self, older: &Self) -> Self;
}

/// The components.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
#[checkpoint(bound = "C: CheckpointValue")]
pub struct Onsets<C> {
    /// By level; in a level the younger first.
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
    /// The components, from the youngest to the oldest.
    pub fn iter(&self) -> impl Iterator<Item = &C> + Clone {
        self.components.iter().flatten()
    }

    /// The components, for the caller's prediction and update.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut C> {
        self.components.iter_mut().flatten()
    }

    /// Drops the components that are not wanted.
    pub fn retain(&mut self, wanted: impl Fn(&C) -> bool) {
        for place in &mut self.components {
            *place = place.filter(&wanted);
        }
    }

    /// Adds the youngest component. A full level passes its two on to the next level as one.
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
    fn a_full_level_passes_its_two_on_as_one() {
        let mut onsets = Onsets::<u64>::default();
        let after = |onsets: &mut Onsets<u64>| {
            onsets.enter(1);
            onsets.iter().copied().collect::<Vec<_>>()
        };
        let expected: [&[u64]; 7] = [
            &[1],
            &[1, 1],
            &[1, 2],
            &[1, 1, 2],
            &[1, 2, 2],
            &[1, 1, 2, 2],
            &[1, 2, 4],
        ];
        for expected in expected {
            assert_eq!(after(&mut onsets), expected);
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

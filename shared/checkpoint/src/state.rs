//! State that can be saved and loaded.

use crate::reader::CheckpointReader;
use crate::writer::CheckpointWriter;

/// State that is saved, and loaded in place into what was built from the same configuration.
pub trait Checkpoint {
    /// Writes the state.
    fn save(&self, to: &mut CheckpointWriter<'_>);

    /// Sets the state. After a misfit, which the reader keeps, part of the state is set, and the
    /// value is of no further use.
    fn load(&mut self, from: &mut CheckpointReader<'_>);
}

/// State that nothing of the configuration is part of: it can be made anew.
pub trait CheckpointValue: Checkpoint + Sized {
    /// Reads a value; any value after a misfit.
    fn read(from: &mut CheckpointReader<'_>) -> Self;
}

/// Saves a collection whose length follows from the configuration.
pub fn save_each<'a, T: Checkpoint + 'a>(
    all: impl ExactSizeIterator<Item = &'a T>,
    to: &mut CheckpointWriter<'_>,
) {
    to.mark(all.len() as u32);
    all.for_each(|one| one.save(to));
}

/// Loads a collection that [`save_each`] saved, each element in place.
pub fn load_each<'a, T: Checkpoint + 'a>(
    all: impl ExactSizeIterator<Item = &'a mut T>,
    from: &mut CheckpointReader<'_>,
) {
    from.expect(all.len() as u32, "a collection of fixed length");
    all.for_each(|one| one.load(from));
}

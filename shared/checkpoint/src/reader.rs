//! Reads state from bytes.

use crate::error::CheckpointError;

/// Reads what a [`crate::CheckpointWriter`] wrote. The first misfit stands; after it everything
/// reads as 0.
#[derive(Debug)]
pub struct CheckpointReader<'a> {
    bytes: &'a [u8],
    at: usize,
    failure: Option<CheckpointError>,
}

impl<'a> CheckpointReader<'a> {
    /// Reads `bytes` from the first on.
    #[must_use]
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            failure: None,
        }
    }

    /// Fills `room` with the next bytes; with zeros if there are not so many.
    #[inline]
    pub fn fill(&mut self, room: &mut [u8]) {
        let end = self.at.saturating_add(room.len());
        match self.bytes.get(self.at..end) {
            Some(bytes) if self.failure.is_none() => {
                room.copy_from_slice(bytes);
                self.at = end;
            }
            _ => {
                room.fill(0);
                let bytes = self.bytes.len();
                self.failure.get_or_insert(CheckpointError::Cut { bytes });
            }
        }
    }

    /// The next `N` bytes.
    #[inline]
    pub fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        self.fill(&mut bytes);
        bytes
    }

    /// Reads a mark, which is to be this one.
    #[inline]
    pub fn expect(&mut self, mark: u32, type_name: &'static str) {
        if u32::from_le_bytes(self.take()) != mark {
            self.fail(type_name);
        }
    }

    /// Reads which of `count` variants follows, counted from `mark`; 0 if there is no such variant.
    pub fn variant(&mut self, mark: u32, count: u32, type_name: &'static str) -> u32 {
        let variant = u32::from_le_bytes(self.take()).wrapping_sub(mark);
        if variant >= count {
            self.fail(type_name);
            return 0;
        }
        variant
    }

    /// Reads how many values follow, each of a byte at least; 0 if there cannot be so many.
    pub fn length(&mut self, type_name: &'static str) -> usize {
        let length = u32::from_le_bytes(self.take()) as usize;
        if length > self.bytes.len().saturating_sub(self.at) {
            self.fail(type_name);
            return 0;
        }
        length
    }

    /// True as long as everything has fitted.
    #[must_use]
    pub const fn is_sound(&self) -> bool {
        self.failure.is_none()
    }

    /// What was read does not fit `type_name`.
    pub const fn fail(&mut self, type_name: &'static str) {
        if self.failure.is_none() {
            self.failure = Some(CheckpointError::Misfit { type_name });
        }
    }

    /// Ends reading.
    ///
    /// # Errors
    /// What did not fit first; that bytes are left.
    pub const fn finish(self) -> Result<(), CheckpointError> {
        let bytes = self.bytes.len() - self.at;
        match self.failure {
            Some(failure) => Err(failure),
            None if bytes > 0 => Err(CheckpointError::Left { bytes }),
            None => Ok(()),
        }
    }
}

//! Writes state into a buffer.

use crate::error::CheckpointError;

/// Writes state into a buffer of fixed size, little endian. What does not fit is counted.
#[derive(Debug)]
pub struct CheckpointWriter<'a> {
    buffer: &'a mut [u8],
    bytes: usize,
}

impl<'a> CheckpointWriter<'a> {
    /// Writes to the beginning of `buffer`.
    #[must_use]
    pub const fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, bytes: 0 }
    }

    /// Adds bytes as they are.
    #[inline]
    pub fn put(&mut self, bytes: &[u8]) {
        let end = self.bytes.saturating_add(bytes.len());
        if let Some(room) = self.buffer.get_mut(self.bytes..end) {
            room.copy_from_slice(bytes);
        }
        self.bytes = end;
    }

    /// Adds what [`crate::CheckpointReader::expect`] expects.
    #[inline]
    pub fn mark(&mut self, mark: u32) {
        self.put(&mark.to_le_bytes());
    }

    /// Bytes that were written.
    ///
    /// # Errors
    /// [`CheckpointError::Full`], with the size that would be needed.
    pub const fn finish(self) -> Result<usize, CheckpointError> {
        if self.bytes > self.buffer.len() {
            return Err(CheckpointError::Full {
                bytes: self.bytes,
                capacity: self.buffer.len(),
            });
        }
        Ok(self.bytes)
    }
}

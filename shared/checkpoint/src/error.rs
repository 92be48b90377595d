//! What can be wrong with a checkpoint.

/// Why a state could not be saved or loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CheckpointError {
    /// It is larger than the buffer.
    #[error("a state of {bytes} bytes; there is room for {capacity}")]
    Full {
        /// Bytes of the state.
        bytes: usize,
        /// Bytes of the buffer.
        capacity: usize,
    },
    /// It was saved by another version, or in another configuration.
    #[error("the state of `{type_name}` is of another version or another configuration")]
    Misfit {
        /// The first type that does not fit.
        type_name: &'static str,
    },
    /// It ends too early.
    #[error("the state ends after {bytes} bytes")]
    Cut {
        /// Bytes that there are.
        bytes: usize,
    },
    /// Something is left over.
    #[error("{bytes} bytes are left behind the state")]
    Left {
        /// Bytes that nobody has read.
        bytes: usize,
    },
}

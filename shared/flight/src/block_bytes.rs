//! Blocks from bytes, wherever these lie in memory.

use vigil_blocks::{Block, Header};

/// What a block of any type begins with; `None` of too few bytes.
#[must_use]
pub fn read_header(bytes: &[u8]) -> Option<Header> {
    let head = bytes.get(..size_of::<Header>())?;
    Some(bytemuck::pod_read_unaligned(head))
}

/// The header of a block of this type; `None` if the bytes are something else.
pub(crate) fn block_header<B: Block>(bytes: &[u8]) -> Option<Header> {
    let header = read_header(bytes)?;
    (header.schema == B::SCHEMA && bytes.len() == size_of::<B>()).then_some(header)
}

/// A block of this type; `None` if the bytes are something else.
#[must_use]
pub fn read_block<B: Block>(bytes: &[u8]) -> Option<B> {
    block_header::<B>(bytes).map(|_| bytemuck::pod_read_unaligned(bytes))
}

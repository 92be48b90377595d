//! Exact beliefs to compare the filters with: no service runs them.

mod forward;
mod sequences;

pub use forward::Forward;
pub use sequences::Sequences;

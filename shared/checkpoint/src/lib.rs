#![doc = include_str!("../README.md")]

mod error;
mod matrices;
mod reader;
mod state;
mod values;
mod writer;

pub use error::CheckpointError;
pub use reader::CheckpointReader;
pub use state::{Checkpoint, CheckpointValue, load_each, save_each};
pub use vigil_checkpoint_derive::{Checkpoint, CheckpointValue};
pub use writer::CheckpointWriter;

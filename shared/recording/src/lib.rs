//! Recorded runs as tables: frames, and labels of what was true in them. Reads files; knows no
//! transport and no clock.

pub mod frames;
pub mod labels;
pub mod table;

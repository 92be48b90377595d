//! Configuration schema, validation and defaults.

pub mod schema;

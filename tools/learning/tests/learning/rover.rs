//! The rover of `config/`.

use std::path::PathBuf;

use vigil_robot::Description;

/// Path from the root of the workspace.
pub fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(name)
}

/// The rover.
pub fn robot() -> Description {
    toml::from_str(&std::fs::read_to_string(path("config/robots/rover.toml")).unwrap()).unwrap()
}

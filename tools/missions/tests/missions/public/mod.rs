//! The public models below `$VIGIL_DATA/pomdp`, and what is known of policies on them.

pub mod heuristics;

use std::path::{Path, PathBuf};

use vigil_pomdp::Pomdp;

/// Folder of the public models; says so if there is none.
pub fn folder() -> Option<PathBuf> {
    let data = std::env::var_os("VIGIL_DATA");
    if data.is_none() {
        eprintln!("SKIPPED: VIGIL_DATA is not set; public POMDP files are not read");
    }
    data.map(|data| PathBuf::from(data).join("pomdp"))
}

/// One of them, by name.
pub fn read(folder: &Path, name: &str) -> Pomdp {
    let path = folder.join(format!("{name}.pomdp"));
    Pomdp::parse(&std::fs::read_to_string(path).unwrap()).unwrap()
}

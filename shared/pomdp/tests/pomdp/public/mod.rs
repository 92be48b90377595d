//! The public models below `$VIGIL_DATA/pomdp`, what is known of them, and one written by hand.

#![allow(dead_code)] // Each test uses a part.

pub mod bounds;

use std::path::{Path, PathBuf};

use vigil_pomdp::Pomdp;

/// The tiger behind one of two doors.
pub const TIGER: &str = include_str!("tiger.pomdp");

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
    parse(&folder.join(format!("{name}.pomdp")))
}

/// All of them, and where they lie.
pub fn all(folder: &Path) -> impl Iterator<Item = (PathBuf, Pomdp)> {
    let files = std::fs::read_dir(folder).unwrap();
    files.map(|entry| {
        let path = entry.unwrap().path();
        let model = parse(&path);
        (path, model)
    })
}

fn parse(path: &Path) -> Pomdp {
    Pomdp::parse(&std::fs::read_to_string(path).unwrap()).unwrap()
}

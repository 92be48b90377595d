//! What the programs on the robot link, by `cargo tree`.

use std::collections::BTreeMap;
use std::io;
use std::process::Command;

use crate::source::root;

/// The programs that run on a robot.
const PROGRAMS: [&str; 6] = [
    "vigil-sensor-sim",
    "vigil-detector",
    "vigil-identifier",
    "vigil-supervisor",
    "vigil-launcher",
    "vigil-blackbox",
];

/// A crate of the workspace that a program on the robot links.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkedCrate {
    /// Its folder from the workspace's root, with `/` at the end.
    pub folder: String,
    /// The features that are enabled.
    pub features: Vec<String>,
}

/// The crates of the workspace that the services and the launcher link.
///
/// # Errors
/// If cargo cannot say it.
pub fn linked_crates() -> io::Result<Vec<LinkedCrate>> {
    let root = root().canonicalize()?;
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command
        .current_dir(&root)
        .args(["tree", "--locked", "--edges", "normal", "--prefix", "none"]);
    command.args(["--no-dedupe", "--format", "{p}|{f}"]);
    command.args(PROGRAMS.iter().flat_map(|program| ["--package", program]));
    let output = command.output()?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(io::Error::other(format!("cargo tree: {text}")));
    }
    let mut found = BTreeMap::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let (package, features) = line.split_once('|').unwrap_or((line, ""));
        let folder = package
            .split_once('(')
            .and_then(|(_, tail)| tail.split(')').next());
        let below = folder.and_then(|folder| folder.strip_prefix(root.to_str()?));
        if let Some(folder) = below {
            let features = features.split(',').map(str::to_owned);
            found.insert(
                format!("{}/", folder.trim_start_matches('/')),
                features.collect(),
            );
        }
    }
    let crates = found.into_iter();
    Ok(crates
        .map(|(folder, features)| LinkedCrate { folder, features })
        .collect())
}

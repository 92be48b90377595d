//! What a start asks of the services beside the configuration.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::args::LauncherArgs;

/// Options of a start, for the services. They are left beside the graph, for a launcher that adopts
/// it.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StartOptions {
    /// What is to be broken; see [`LauncherArgs::inject`].
    pub inject: Vec<String>,
    /// Folder for the times of cycles.
    pub stamps: Option<PathBuf>,
    /// Cycles whose times are kept.
    pub stamped_cycles: usize,
    /// No latencies are recorded.
    pub no_timing: bool,
}

impl StartOptions {
    /// Those of a command line, whose paths stay the same in every folder.
    pub fn new(args: &LauncherArgs) -> io::Result<Self> {
        Ok(Self {
            inject: args.inject.clone(),
            stamps: args.stamps.as_ref().map(std::path::absolute).transpose()?,
            stamped_cycles: args.stamped_cycles,
            no_timing: args.no_timing,
        })
    }

    /// Leaves them in a file, all of them or none.
    pub fn leave(&self, file: &Path) -> io::Result<()> {
        let part = file.with_extension("part");
        std::fs::write(&part, serde_json::to_vec(self)?)?;
        std::fs::rename(part, file)
    }

    /// Those that another launcher has left.
    pub fn read(file: &Path) -> io::Result<Self> {
        Ok(serde_json::from_slice(&std::fs::read(file)?)?)
    }
}

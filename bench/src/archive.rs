//! An archived run: `bench/runs/<date>-<host>/<question>/` with raw data and a summary.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::machine;

/// Folder of one archived run.
#[derive(Debug)]
pub struct Archive {
    folder: PathBuf,
    summary: String,
}

impl Archive {
    /// Makes the folder for `question` and stores the machine's facts in it.
    ///
    /// # Errors
    /// The file system's.
    pub fn new(question: &str) -> io::Result<Self> {
        let date = output(Command::new("date").args(["-u", "+%Y-%m-%d"]));
        let host = output(&mut Command::new("hostname"));
        let runs = Path::new(env!("CARGO_MANIFEST_DIR")).join("runs");
        let folder = runs.join(format!("{date}-{host}")).join(question);
        fs::create_dir_all(&folder)?;
        let facts = machine::facts();
        fs::write(folder.join("machine.json"), format!("{facts:#}\n"))?;
        let summary = format!("# {question}, {date}\n\nMachine: `machine.json`.\n\n");
        Ok(Self { folder, summary })
    }

    /// Where it lies.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Stores raw data.
    ///
    /// # Errors
    /// The file system's.
    pub fn store(&self, name: &str, data: &Value) -> io::Result<()> {
        fs::write(self.folder.join(name), format!("{data:#}\n"))
    }

    /// Stores raw data as text.
    ///
    /// # Errors
    /// The file system's.
    pub fn store_text(&self, name: &str, text: &str) -> io::Result<()> {
        fs::write(self.folder.join(name), text)
    }

    /// Adds a line to the summary, and shows it.
    pub fn say(&mut self, line: &str) {
        println!("{line}");
        self.summary.push_str(line);
        self.summary.push('\n');
    }

    /// Writes the summary; returns the folder.
    ///
    /// # Errors
    /// The file system's.
    pub fn close(self) -> io::Result<PathBuf> {
        fs::write(self.folder.join("README.md"), self.summary)?;
        Ok(self.folder)
    }
}

/// First line that a command prints; empty if it cannot run.
pub(crate) fn output(command: &mut Command) -> String {
    let output = command.output().map(|o| o.stdout).unwrap_or_default();
    String::from_utf8_lossy(&output)
        .lines()
        .next()
        .unwrap_or_default()
        .trim()
        .to_owned()
}

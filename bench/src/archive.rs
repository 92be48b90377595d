//! An archived run: `bench/runs/<date>-<host>/<question>/` with raw data and a summary.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
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
    /// Makes the folder for `question` and stores the machine's facts in it. It is made anew: what
    /// an earlier run of the same day has left in it goes, so that no summary lies beside data of
    /// another run.
    ///
    /// # Errors
    /// The file system's, and a `question` that is no name of a folder.
    pub fn new(question: &str) -> io::Result<Self> {
        if !is_name(question) {
            let text = format!("archive '{question}': allowed is the name of one folder");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        }
        let date = output(Command::new("date").args(["-u", "+%Y-%m-%d"]));
        let host = output(&mut Command::new("hostname"));
        let runs = Path::new(env!("CARGO_MANIFEST_DIR")).join("runs");
        let folder = runs.join(format!("{date}-{host}")).join(question);
        if fs::exists(&folder)? {
            fs::remove_dir_all(&folder)?;
        }
        fs::create_dir_all(&folder)?;
        let facts = machine::facts();
        fs::write(folder.join("machine.json"), format!("{facts:#}\n"))?;
        let commit = machine::commit_in_words(&facts);
        let summary = format!("# {question}, {date}\n\n{commit} Machine: `machine.json`.\n\n");
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

/// True for the name of one folder: what an archive clears must not lie elsewhere.
fn is_name(text: &str) -> bool {
    let mut parts = Path::new(text).components();
    let first = parts.next();
    matches!(first, Some(Component::Normal(name)) if name == text) && parts.next().is_none()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_archive_has_the_name_of_one_folder() {
        for name in [
            "latency",
            "latency-1000hz-cpu-fifo",
            "latency-0.5hz-idle-other",
        ] {
            assert!(is_name(name), "{name}");
        }
        for name in [
            "",
            ".",
            "..",
            "/",
            "/latency",
            "../latency",
            "a/b",
            "a/",
            "./a",
        ] {
            assert!(!is_name(name), "{name}");
        }
    }
}

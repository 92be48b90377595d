//! Archives a measurement: its result in `bench/results/`, its raw data in `target/bench/`. Or
//! prints the same result as JSON.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use serde_json::{Map, Value};

use vigil_terminal::output::{json, line};

use crate::machine::{self, output};
use crate::results::{Raw, Run, SCHEMA_VERSION};
use crate::root;

/// Where results lie, from the project's folder.
const RESULTS: &str = "bench/results";
/// Where raw data lie, from the project's folder: not kept in git.
const RAW: &str = "target/bench";

/// Where a result goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outlet {
    /// To `bench/results/`, raw data to `target/bench/`; lines to standard output.
    Files,
    /// To standard output, as one JSON document; lines to standard error. No file is written.
    Json,
}

impl Outlet {
    /// As `--json` says.
    #[must_use]
    pub const fn by_flag(json: bool) -> Self {
        match json {
            true => Self::Json,
            false => Self::Files,
        }
    }
}

/// A measurement that is being archived, or printed.
#[derive(Debug)]
pub struct Archive {
    outlet: Outlet,
    run: Run,
    host: String,
    /// Names of raw files that are pages to read.
    pages: Vec<String>,
    /// Whether all lines could be shown.
    shown: io::Result<()>,
}

impl Archive {
    /// Reads the machine's facts. With files it makes the folder of raw data for `question` anew:
    /// what an earlier measurement has left in it goes, so that no result lies beside data of
    /// another one.
    ///
    /// # Errors
    /// The file system's, and a `question` that is no name of a folder.
    pub fn new(question: &str, outlet: Outlet) -> io::Result<Self> {
        if !is_name(question) {
            let text = format!("archive '{question}': allowed is the name of one folder");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        }
        let words: Vec<String> = std::env::args().skip(1).collect();
        let mut machine = machine::facts();
        let commit = machine.as_object_mut().and_then(|of| of.remove("commit"));
        let run = Run {
            schema_version: SCHEMA_VERSION,
            question: question.to_owned(),
            command: format!("scripts/bench {}", words.join(" ")),
            commit: commit.and_then(|it| it.as_str().map(str::to_owned)),
            date: output(Command::new("date").args(["-u", "+%Y-%m-%d"])),
            machine,
            summary: Vec::new(),
            remarks: Vec::new(),
            figures: Map::new(),
            raw: Vec::new(),
        };
        let host = output(&mut Command::new("hostname"));
        let archive = Self {
            outlet,
            run,
            host,
            pages: Vec::new(),
            shown: Ok(()),
        };
        if let Some(folder) = archive.folder() {
            if fs::exists(&folder)? {
                fs::remove_dir_all(&folder)?;
            }
            fs::create_dir_all(&folder)?;
        }
        Ok(archive)
    }

    /// Where its raw data lie, if they are kept.
    #[must_use]
    pub fn folder(&self) -> Option<PathBuf> {
        let folder = || root().join(RAW).join(&self.run.question);
        (self.outlet == Outlet::Files).then(folder)
    }

    /// Stores data; they are figures of the result, too: in its file if that stays small with them.
    ///
    /// # Errors
    /// The file system's.
    pub fn store(&mut self, name: &str, data: &Value) -> io::Result<()> {
        self.run.figures.insert(name.to_owned(), data.clone());
        self.store_text(name, &format!("{data:#}\n"))
    }

    /// Stores raw data as text.
    ///
    /// # Errors
    /// The file system's.
    pub fn store_text(&self, name: &str, text: &str) -> io::Result<()> {
        self.folder()
            .map_or(Ok(()), |folder| fs::write(folder.join(name), text))
    }

    /// Stores a page beside the raw data; where it lies is said at the end.
    ///
    /// # Errors
    /// The file system's.
    pub fn store_page(&mut self, name: &str, html: &str) -> io::Result<()> {
        self.pages.push(name.to_owned());
        self.store_text(name, html)
    }

    /// What was measured, on what: name and value, for a page.
    #[must_use]
    pub fn facts(&self) -> Vec<Vec<String>> {
        let (run, machine) = (&self.run, &self.run.machine);
        let of = |name: &str| match &machine[name] {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let commit = machine::commit_in_words(run.commit.as_deref(), machine);
        let all = [
            ("command", run.command.clone()),
            ("day", run.date.clone()),
            ("measured", commit),
            ("processor", of("processor")),
            ("cores", of("cores")),
            ("kernel", of("kernel")),
            ("virtual machine", of("hypervisor")),
        ];
        let row = |(name, value): (&str, String)| vec![name.to_owned(), value];
        all.into_iter().map(row).collect()
    }

    /// Adds lines to the summary, and shows them.
    pub fn say(&mut self, lines: &str) {
        match self.outlet {
            Outlet::Files if self.shown.is_ok() => self.shown = line(lines),
            Outlet::Files => {}
            Outlet::Json => eprintln!("{lines}"),
        }
        self.add(lines);
    }

    fn add(&mut self, lines: &str) {
        let lines = lines.split('\n').map(str::to_owned);
        self.run.summary.extend(lines);
    }

    /// Keeps figures and lines that were already shown.
    ///
    /// # Errors
    /// The file system's.
    pub fn keep(
        question: &str,
        figures: &[(impl AsRef<str>, Value)],
        lines: &[String],
    ) -> io::Result<()> {
        let mut archive = Self::new(question, Outlet::Files)?;
        for (name, found) in figures {
            archive.store(name.as_ref(), found)?;
        }
        lines.iter().for_each(|line| archive.add(line));
        archive.close()
    }

    /// Writes the result, and says where it and the raw data lie; or prints it.
    ///
    /// # Errors
    /// The file system's; output that cannot be written.
    pub fn close(mut self) -> io::Result<()> {
        let summary = self.run.summary.join("\n");
        self.store_text("summary.md", &format!("{summary}\n"))?;
        let Some(raw) = self.folder() else {
            return json(&self.run);
        };
        self.run.raw = Raw::list(&raw)?;
        let Self {
            mut run,
            host,
            pages,
            shown,
            ..
        } = self;
        run.shrink();
        let folder = format!("{RESULTS}/{}-{host}", run.date);
        fs::create_dir_all(root().join(&folder))?;
        let path = format!("{folder}/{}.json", run.question);
        fs::write(root().join(&path), run.text())?;
        shown?;
        line(&format!(
            "\nresult: {path}; `scripts/bench page` brings it into bench/README.md\n\
             raw data: {RAW}/{}/",
            run.question
        ))?;
        for page in pages {
            line(&format!("page: {RAW}/{}/{page}", run.question))?;
        }
        Ok(())
    }
}

/// Where results lie.
#[must_use]
pub fn results() -> PathBuf {
    root().join(RESULTS)
}

/// True for the name of one folder: what an archive clears must not lie elsewhere.
fn is_name(text: &str) -> bool {
    let mut parts = Path::new(text).components();
    let first = parts.next();
    matches!(first, Some(Component::Normal(name)) if name == text) && parts.next().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_leaves_the_raw_data_of_an_archive_alone() {
        let folder = root().join(RAW).join("printed");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("kept.json"), "1").unwrap();
        let mut archive = Archive::new("printed", Outlet::Json).unwrap();
        archive.store("figures.json", &Value::Null).unwrap();
        archive.store_page("page.html", "").unwrap();
        assert_eq!(archive.folder(), None);
        let left = Raw::list(&folder).unwrap();
        let names: Vec<&str> = left.iter().map(|raw| raw.name.as_str()).collect();
        assert_eq!(names, ["kept.json"]);
        fs::remove_dir_all(folder).unwrap();
    }

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

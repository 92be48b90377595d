//! The workspace's text files.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::{fs, io};

use crate::configured::{Build, Condition};
use crate::rust::{ModuleFile, Rust};

/// Folders that hold nothing of ours.
const SKIPPED: [&str; 6] = [
    "target",
    "shared-data",
    ".git",
    ".venv",
    ".cache",
    "__pycache__",
];
/// Endings of text files; scripts have none.
const ENDINGS: [&str; 12] = [
    "", "rs", "toml", "md", "sh", "py", "c", "h", "txt", "help", "json", "pomdp",
];

/// One text file.
#[derive(Debug, Clone)]
pub struct Source {
    /// Path from the workspace's root, with `/`.
    pub path: String,
    /// The text.
    pub text: String,
    /// The text with comments and literals blanked; equal to `text` for files that are not Rust.
    pub code: String,
    /// What it holds, if it is Rust.
    pub rust: Rust,
    /// Condition of the whole file, from where it is declared as a module.
    condition: Option<Condition>,
}

impl Source {
    /// A source from its path and text.
    ///
    /// # Errors
    /// A Rust file that is no Rust.
    pub fn new(path: &str, text: &str) -> io::Result<Self> {
        let mut source = Self {
            path: path.to_owned(),
            text: text.to_owned(),
            code: text.to_owned(),
            rust: Rust::default(),
            condition: None,
        };
        if source.is_rust() {
            let wrong = |error| io::Error::other(format!("{path}: {error}"));
            source.rust = Rust::read(text).map_err(wrong)?;
            source.code = std::mem::take(&mut source.rust.masked);
        }
        Ok(source)
    }

    /// True for Rust files.
    #[must_use]
    pub fn is_rust(&self) -> bool {
        self.path.ends_with(".rs")
    }

    /// True if the path lies under one of the `rooms` (path prefixes).
    #[must_use]
    pub fn is_under(&self, rooms: &[&str]) -> bool {
        rooms.iter().any(|room| self.path.starts_with(room))
    }

    /// True if the whole file is test code by its place.
    fn is_test_file(&self) -> bool {
        let mut parts = self.path.split('/');
        let is_shown = |part| ["tests", "benches", "examples"].contains(&part);
        parts.next() == Some("tests") || parts.any(is_shown)
    }

    /// True if the line, from 1, is test code.
    #[must_use]
    pub fn is_test(&self, line: usize) -> bool {
        let build = Build {
            test: false,
            features: None,
        };
        self.is_test_file() || !self.is_in(line - 1, build)
    }

    /// True if the line, from 0, is part of a build.
    pub(crate) fn is_in(&self, line: usize, build: Build<'_>) -> bool {
        let around = self
            .rust
            .conditions
            .iter()
            .filter(|(lines, _)| lines.contains(&line));
        let mut around = around
            .map(|(_, condition)| condition)
            .chain(&self.condition);
        around.all(|condition| condition.holds(build))
    }
}

/// Root of the workspace.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All text files of the workspace, in order of their paths.
///
/// # Errors
/// The file system's, and Rust files that are none.
pub fn workspace() -> io::Result<Vec<Source>> {
    let root = root();
    let mut paths = BTreeSet::new();
    collect(&root, "", &mut paths)?;
    let read = |path: String| Source::new(&path, &fs::read_to_string(root.join(&path))?);
    let mut sources = paths
        .into_iter()
        .map(read)
        .collect::<io::Result<Vec<Source>>>()?;
    condition_modules(&mut sources);
    Ok(sources)
}

fn collect(root: &Path, folder: &str, paths: &mut BTreeSet<String>) -> io::Result<()> {
    for entry in fs::read_dir(root.join(folder))? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = format!("{folder}{name}");
        let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
        if SKIPPED.contains(&name.as_str()) {
            continue;
        }
        if entry.file_type()?.is_dir() {
            collect(root, &format!("{path}/"), paths)?;
        } else if ENDINGS.contains(&ending) {
            paths.insert(path);
        }
    }
    Ok(())
}

/// Files of modules that are declared on a condition stand under it, and so do their own modules.
fn condition_modules(sources: &mut [Source]) {
    let mut found = Vec::new();
    for source in &*sources {
        for module in &source.rust.modules {
            if let Some(condition) = &module.condition {
                found.push((module_path(&source.path, module), condition.clone()));
            }
        }
    }
    for source in sources {
        let stem = source.path.trim_end_matches(".rs");
        let mine = found.iter().filter(|(path, _)| {
            let below = stem.strip_prefix(path.as_str());
            below.is_some_and(|below| below.is_empty() || below.starts_with('/'))
        });
        let mine: Vec<Condition> = mine.map(|(_, condition)| condition.clone()).collect();
        source.condition = (!mine.is_empty()).then_some(Condition::All(mine));
    }
}

/// Path, without its ending, of a module that is declared in the file `parent`.
fn module_path(parent: &str, module: &ModuleFile) -> String {
    let (folder, file) = parent.rsplit_once('/').unwrap_or(("", parent));
    match (&module.path, file) {
        (Some(path), _) => format!("{folder}/{}", path.trim_end_matches(".rs")),
        (None, "lib.rs" | "main.rs" | "mod.rs") => format!("{folder}/{}", module.name),
        (None, _) => format!("{}/{}", parent.trim_end_matches(".rs"), module.name),
    }
}

/// Lines of a range that satisfy a condition.
pub(crate) fn count(lines: Range<usize>, is: impl Fn(usize) -> bool) -> usize {
    lines.filter(|line| is(*line)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_code_is_known_by_path_by_item_and_by_declaration() {
        let source = |path: &str, text: &str| Source::new(path, text).unwrap();
        assert!(source("tests/tidy/main.rs", "fn a() {}").is_test(1));
        assert!(source("shared/robot/tests/slip.rs", "fn a() {}").is_test(1));
        assert!(source("shared/robot/examples/slip.rs", "fn a() {}").is_test(1));
        assert!(!source("shared/robot/src/tests.rs", "fn a() {}").is_test(1));
        let lines = "fn a() {}\n#[cfg(test)]\n#[allow(x)]\nmod tests {\n}\nfn b() {}\n\
                     impl A {\n    #[cfg(test)]\n    fn c() {}\n}\n";
        let mixed = source("shared/a/src/b.rs", lines);
        let marks: Vec<usize> = (1..=10).filter(|line| mixed.is_test(*line)).collect();
        assert_eq!(marks, [2, 3, 4, 5, 8, 9]);
        let mut sources = [
            source("shared/a/src/lib.rs", "#[cfg(test)]\nmod fixtures;\nmod b;"),
            source("shared/a/src/fixtures.rs", "mod inner;"),
            source("shared/a/src/fixtures/inner.rs", "fn a() {}"),
            source(
                "shared/a/src/b.rs",
                "#[cfg(test)]\n#[path = \"c.rs\"]\nmod tests;",
            ),
            source("shared/a/src/c.rs", "fn a() {}"),
            source("shared/a/src/d.rs", "fn a() {}"),
        ];
        condition_modules(&mut sources);
        let marks: Vec<bool> = sources.iter().map(|source| source.is_test(1)).collect();
        assert_eq!(marks, [true, true, true, true, true, false]);
    }

    #[test]
    fn comments_and_literals_are_blanked_and_code_is_kept() {
        let text = "fn f<'a>(x: &'a str) {\n    // x {\n    g(\"a{\", '{', 1.5); /* } */\n}\n";
        let source = Source::new("shared/a/src/b.rs", text).unwrap();
        let code = source.code.replace(' ', "");
        assert_eq!(code, "fnf<'a>(x:&'astr){\n\ng(\",',1.5);\n}\n");
        assert_eq!(source.code.len(), text.len());
    }
}

//! The workspace's text files, and what of them is test code.

use crate::mask::mask;
use crate::test_regions::test_regions;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// One text file.
pub struct Source {
    /// Path from the workspace's root, with `/`.
    pub path: String,
    /// The text.
    pub text: String,
    /// The text with comments and literals masked; equal to `text` for files that are not Rust.
    pub code: String,
    /// For each line (from 0): true if it is test code.
    pub test_lines: Vec<bool>,
}

impl Source {
    /// A source from its path and text.
    pub fn new(path: &str, text: &str) -> Self {
        let is_rust = path.ends_with(".rs");
        let code = if is_rust {
            mask(text)
        } else {
            text.to_string()
        };
        let test_lines = if is_test_path(path) {
            vec![true; text.lines().count()]
        } else {
            test_regions(&code).lines
        };
        Self {
            path: path.to_string(),
            text: text.to_string(),
            code,
            test_lines,
        }
    }

    /// True for Rust files.
    pub fn is_rust(&self) -> bool {
        self.path.ends_with(".rs")
    }

    /// True if the 1-based `line` is test code.
    pub fn is_test(&self, line: usize) -> bool {
        self.test_lines.get(line - 1).copied().unwrap_or(false)
    }

    /// True if the path lies under one of the `rooms` (path prefixes).
    pub fn is_under(&self, rooms: &[&str]) -> bool {
        rooms.iter().any(|room| self.path.starts_with(room))
    }
}

/// Tests, benchmarks and what spans processes: as a whole outside the shipped code.
fn is_test_path(path: &str) -> bool {
    let parts: Vec<&str> = path.split('/').collect();
    matches!(parts[0], "tests" | "bench")
        || parts
            .get(2)
            .is_some_and(|part| matches!(*part, "tests" | "benches"))
}

/// Root of the workspace.
pub fn root() -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests
        .parent()
        .expect("the tests' crate lies in the workspace")
        .to_path_buf()
}

/// All text files of the workspace, read once.
pub fn workspace() -> &'static [Source] {
    static SOURCES: OnceLock<Vec<Source>> = OnceLock::new();
    SOURCES.get_or_init(|| {
        let root = root();
        let mut sources = Vec::new();
        collect(&root, &root, &mut sources);
        sources.sort_by(|a, b| a.path.cmp(&b.path));
        mark_test_modules(&mut sources);
        for must in [
            "Cargo.toml",
            "shared/blocks/src/lib.rs",
            "services/detector/src/lib.rs",
        ] {
            let found = sources.iter().any(|source| source.path == must);
            assert!(
                found,
                "{must} was not read: the checks would pass without looking"
            );
        }
        sources
    })
}

/// Directories that hold nothing of ours.
const SKIPPED: [&str; 5] = ["target", ".git", ".venv", ".cache", "__pycache__"];

fn collect(root: &Path, folder: &Path, sources: &mut Vec<Source>) {
    let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for entry in entries {
        let path = entry
            .expect("an entry of a folder that was just opened")
            .path();
        let relative = path.strip_prefix(root).expect("below the root");
        let name = relative
            .to_str()
            .expect("names of files are UTF-8")
            .replace('\\', "/");
        let last = name.rsplit('/').next().unwrap_or_default();
        if SKIPPED.contains(&name.as_str()) || SKIPPED.contains(&last) {
            continue;
        }
        if path.is_dir() {
            collect(root, &path, sources);
        } else if is_text(last)
            && let Ok(text) = fs::read_to_string(&path)
        {
            sources.push(Source::new(&name, &text));
        }
    }
}

/// Data files and pictures are not ours to check; scripts have no extension.
fn is_text(name: &str) -> bool {
    let extension = name.rsplit_once('.').map_or("", |(_, extension)| extension);
    ["", "rs", "toml", "md", "sh", "py", "c", "h", "txt", "pomdp"].contains(&extension)
}

/// Marks files that a `#[cfg(test)] mod name;` elsewhere makes test code.
fn mark_test_modules(sources: &mut [Source]) {
    let mut paths = BTreeSet::new();
    for source in sources.iter().filter(|source| source.is_rust()) {
        for (at, name) in test_regions(&source.code).modules {
            paths.insert(module_path(&source.path, &source.text[at..], &name));
        }
    }
    for source in sources {
        let inside = paths.iter().any(|path| {
            source.path == format!("{path}.rs") || source.path.starts_with(&format!("{path}/"))
        });
        if inside {
            source.test_lines.fill(true);
        }
    }
}

/// Path, without `.rs`, of module `name` declared in the file `parent`; `declaration` is the
/// text from the first attribute on.
fn module_path(parent: &str, declaration: &str, name: &str) -> String {
    let (folder, file) = parent.rsplit_once('/').unwrap_or(("", parent));
    let declaration = &declaration[..declaration.find(';').unwrap_or(declaration.len())];
    if let Some((_, path)) = declaration.split_once("#[path = \"") {
        let path = path.split('"').next().unwrap_or_default();
        return format!("{folder}/{}", path.trim_end_matches(".rs"));
    }
    match file {
        "lib.rs" | "main.rs" | "mod.rs" => format!("{folder}/{name}"),
        _ => format!("{}/{name}", parent.trim_end_matches(".rs")),
    }
}

#[test]
fn test_code_is_known_by_path_and_by_declaration() {
    assert!(Source::new("tests/tidy/main.rs", "fn a() {}").is_test(1));
    assert!(Source::new("shared/robot/tests/slip.rs", "fn a() {}").is_test(1));
    assert!(!Source::new("shared/robot/src/tests.rs", "fn a() {}").is_test(1));
    let mut sources = [
        Source::new("shared/a/src/lib.rs", "#[cfg(test)]\nmod fixtures;\nmod b;"),
        Source::new("shared/a/src/fixtures.rs", "fn a() {}"),
        Source::new(
            "shared/a/src/b.rs",
            "#[cfg(test)]\n#[path = \"c.rs\"]\nmod tests;",
        ),
        Source::new("shared/a/src/c.rs", "fn a() {}"),
        Source::new("shared/a/src/d.rs", "fn a() {}"),
    ];
    mark_test_modules(&mut sources);
    let marks: Vec<bool> = sources.iter().map(|source| source.is_test(1)).collect();
    assert_eq!(marks, [true, true, true, true, false]);
}

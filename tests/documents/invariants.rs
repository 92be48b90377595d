//! The tables of invariants: the file that is named asserts something, and the test that is named
//! exists in the same crate.

use std::fs::read_to_string;
use std::path::{Path, PathBuf};

use crate::built::root;

/// A row of a table of invariants.
#[derive(Clone)]
struct Row<'a> {
    statement: &'a str,
    files: Vec<&'a str>,
    tests: Vec<&'a str>,
}

/// What stands between backticks.
fn code(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// Rows of the tables below the heading `Invariants`.
fn rows(text: &str) -> Vec<Row<'_>> {
    let after = text
        .split_once("\n## Invariants\n")
        .map_or("", |(_, after)| after);
    let section = after.split("\n## ").next().unwrap_or_default();
    let tables = section.lines().filter_map(|line| line.strip_prefix("| "));
    let cells = tables.map(|line| line.trim_end_matches('|').split(" | ").collect::<Vec<_>>());
    let rows = cells.filter(|cells| cells.len() == 3 && cells[2].contains('`'));
    rows.map(|cells| Row {
        statement: cells[0],
        files: code(cells[1]),
        tests: code(cells[2]),
    })
    .collect()
}

/// The named files, from the folder of the document, of its sources, of the file before, or of the
/// repository.
fn find(folder: &Path, names: &[&str]) -> Result<Vec<PathBuf>, String> {
    let mut found: Vec<PathBuf> = Vec::new();
    for name in names {
        let before = found.last().map_or(folder, |path| path.parent().unwrap());
        let folders = [folder, &folder.join("src"), before, &root()];
        let mut paths = folders.iter().map(|folder| folder.join(name));
        let path = paths.find(|path| path.is_file());
        found.push(path.ok_or_else(|| format!("no file {name}"))?);
    }
    Ok(found)
}

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let (folders, files): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|path| path.is_dir());
    let rust = files
        .into_iter()
        .filter(|path| path.extension().is_some_and(|e| e == "rs"));
    rust.chain(folders.iter().flat_map(|folder| sources(folder)))
        .collect()
}

/// The folder of the crate that a file belongs to.
fn crate_of(file: &Path) -> &Path {
    let mut folders = file.ancestors().skip(1);
    folders
        .find(|folder| folder.join("Cargo.toml").is_file())
        .unwrap()
}

fn asserts(file: &Path) -> bool {
    let text = read_to_string(file).unwrap();
    ["assert!(", "assert_eq!(", "assert_ne!(", "invariants::"]
        .iter()
        .any(|word| text.contains(word))
}

fn problem(row: &Row<'_>, folder: &Path) -> Result<(), String> {
    let files = find(folder, &row.files)?;
    let first = files.first().ok_or("no file is named")?;
    if let Some(silent) = files.iter().find(|file| !asserts(file)) {
        return Err(format!("{} asserts nothing", silent.display()));
    }
    let texts: Vec<String> = sources(crate_of(first))
        .iter()
        .map(|path| read_to_string(path).unwrap())
        .collect();
    let is_there = |test: &str| {
        texts
            .iter()
            .any(|text| text.contains(&format!("fn {test}(")))
    };
    let missing = row.tests.iter().find(|test| !is_there(test));
    missing.map_or(Ok(()), |test| Err(format!("no test {test}")))
}

/// The number of invariants in a document, and those of which something is missing.
pub fn check(document: &Path) -> (usize, Vec<String>) {
    let text = read_to_string(document).unwrap();
    let rows = rows(&text);
    let folder = document.parent().unwrap();
    let wrong = rows.iter().filter_map(|row| {
        let problem = problem(row, folder).err()?;
        Some(format!(
            "{}: '{}': {problem}",
            document.display(),
            row.statement
        ))
    });
    (rows.len(), wrong.collect())
}

#[test]
fn rows_are_read_and_what_is_missing_is_found() {
    let text = "# A\n\n## Invariants\n\n| statement | file | test |\n|---|---|---|\n\
                | sums to 1 | `invariants.rs` | `nobody_wrote_this` |\n\n## B\n| a | `b` | `c` |\n";
    let rows = rows(text);
    assert_eq!(rows.len(), 1);
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("documents");
    let missing = Err("no test nobody_wrote_this".into());
    assert_eq!(problem(&rows[0], &here), missing);
    let tests = vec!["rows_are_read_and_what_is_missing_is_found"];
    let row = Row {
        tests,
        ..rows[0].clone()
    };
    assert_eq!(problem(&row, &here), Ok(()));
    let files = vec!["missing.rs"];
    let row = Row {
        files,
        ..rows[0].clone()
    };
    assert_eq!(problem(&row, &here), Err("no file missing.rs".into()));
}

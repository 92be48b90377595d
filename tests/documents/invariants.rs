//! The tables of invariants: code of the file that is named asserts something, and the test that is
//! named, in the same crate, sees a panic.

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

/// True if code that is no test asserts something.
fn asserts(text: &str) -> bool {
    let shipped = text.split("#[cfg(test)]").next().unwrap_or_default();
    ["assert!(", "assert_eq!(", "assert_ne!(", "invariants::"]
        .iter()
        .any(|word| shipped.contains(word))
}

/// True if the text holds this test, and it waits for a panic.
fn breaks(text: &str, test: &str) -> bool {
    text.match_indices(&format!("fn {test}(")).any(|(at, _)| {
        let before = text[..at].rsplit('\n').skip(1);
        let mut attributes = before.take_while(|line| !line.trim().is_empty() && *line != "}");
        attributes.any(|line| line.contains("should_panic"))
    })
}

fn problem(row: &Row<'_>, folder: &Path) -> Result<(), String> {
    let files = find(folder, &row.files)?;
    let first = files.first().ok_or("no file is named")?;
    let is_silent = |file: &&PathBuf| !asserts(&read_to_string(file).unwrap());
    if let Some(silent) = files.iter().find(is_silent) {
        return Err(format!("{} asserts nothing", silent.display()));
    }
    let texts: Vec<String> = sources(crate_of(first))
        .iter()
        .map(|path| read_to_string(path).unwrap())
        .collect();
    let is_broken = |test: &str| texts.iter().any(|text| breaks(text, test));
    let missing = row.tests.iter().find(|test| !is_broken(test));
    missing.map_or(Ok(()), |test| {
        Err(format!("no test {test} that sees a panic"))
    })
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
                | never back | `shared/cycle/src/deadline.rs` | \
                `an_account_that_goes_back_is_found` |\n\
                \n## B\n| a | `b` | `c` |\n";
    let rows = rows(text);
    assert_eq!(rows.len(), 1);
    let judged = |row: Row<'_>| problem(&row, &root());
    assert_eq!(judged(rows[0].clone()), Ok(()));
    let changed = |files, tests| Row {
        statement: "never back",
        files,
        tests,
    };
    let (file, unknown) = (rows[0].files.clone(), vec!["nobody_wrote_this"]);
    let missing = Err("no test nobody_wrote_this that sees a panic".into());
    assert_eq!(judged(changed(file, unknown)), missing);
    let (gone, test) = (vec!["missing.rs"], rows[0].tests.clone());
    assert_eq!(
        judged(changed(gone, test)),
        Err("no file missing.rs".into())
    );
}

#[test]
fn only_shipped_assertions_and_tests_that_see_a_panic_count() {
    assert!(asserts("fn f() {\n    assert!(x, \"so\");\n}\n"));
    assert!(!asserts(
        "fn f() {}\n#[cfg(test)]\nmod tests { assert!(x); }\n"
    ));
    let quiet = "}\n\n#[test]\nfn a() {\n}\n";
    assert!(!breaks(quiet, "a"));
    let loud = "}\n\n#[test]\n#[should_panic(expected = \"so\")]\nfn a() {\n}\n";
    assert!(breaks(loud, "a") && !breaks(loud, "b"));
}

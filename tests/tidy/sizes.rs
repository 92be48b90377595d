//! Limits on the size of lines, functions and files.

use crate::functions::functions;
use crate::source::{Source, workspace};

const LINE_COLUMNS_MAX: usize = 100;
const FUNCTION_LINES_MAX: usize = 70;
const FILE_LINES_MAX: usize = 500;

fn long_lines(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for (index, line) in source.text.lines().enumerate() {
        let columns = line.chars().count();
        // An address cannot be broken.
        let is_address = line.contains("//") && line.contains("://");
        if columns > LINE_COLUMNS_MAX && !is_address {
            found.push(format!("{}:{}: {columns} columns", source.path, index + 1));
        }
    }
    found
}

fn long_functions(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for function in functions(&source.code) {
        let lines = function.line_last - function.line_first + 1;
        if lines > FUNCTION_LINES_MAX {
            let (path, line) = (&source.path, function.line_first);
            found.push(format!(
                "{path}:{line}: fn {} has {lines} lines",
                function.name
            ));
        }
    }
    found
}

fn long_file(source: &Source) -> Vec<String> {
    let lines = source.text.lines().count();
    let long = lines > FILE_LINES_MAX;
    long.then(|| format!("{}: {lines} lines", source.path))
        .into_iter()
        .collect()
}

fn in_workspace(check: fn(&Source) -> Vec<String>) -> Vec<String> {
    workspace()
        .iter()
        .filter(|source| source.is_rust())
        .flat_map(check)
        .collect()
}

#[test]
fn lines_have_at_most_100_columns() {
    crate::demand_none("Break the line.", &in_workspace(long_lines));
}

#[test]
fn functions_have_at_most_70_lines() {
    crate::demand_none(
        "Split the function: one that decides, and some that do.",
        &in_workspace(long_functions),
    );
}

#[test]
fn files_have_at_most_500_lines() {
    crate::demand_none(
        "Split the file by concept; move long tests to a module in a file of their own.",
        &in_workspace(long_file),
    );
}

#[test]
fn what_is_too_long_is_refused() {
    let columns = |n: usize| Source::new("shared/robot/src/slip.rs", &"é".repeat(n));
    assert!(long_lines(&columns(100)).is_empty());
    assert_eq!(long_lines(&columns(101)).len(), 1);
    let address = format!("/// See <https://example.org/{}>.", "a".repeat(100));
    assert!(long_lines(&Source::new("shared/robot/src/slip.rs", &address)).is_empty());

    let function = |lines: usize| {
        let body = "    let s = \"}\"; // }\n".repeat(lines - 2);
        Source::new(
            "shared/robot/src/slip.rs",
            &format!("fn long() {{\n{body}}}\n"),
        )
    };
    assert!(long_functions(&function(70)).is_empty());
    let found = long_functions(&function(71));
    assert_eq!(found, ["shared/robot/src/slip.rs:1: fn long has 71 lines"]);

    let file = |lines: usize| Source::new("shared/robot/src/slip.rs", &"x\n".repeat(lines));
    assert!(long_file(&file(500)).is_empty());
    assert_eq!(long_file(&file(501)).len(), 1);
}

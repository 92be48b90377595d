//! Limits on the size of lines, functions and files.

use vigil_size::Source;

use crate::{sample, workspace};

const LINE_COLUMNS_MAX: usize = 100;
const FUNCTION_LINES_MAX: usize = 70;
/// Of one that a comment calls a straight constructor.
const CONSTRUCTOR_LINES_MAX: usize = 90;
const FILE_LINES_MAX: usize = 500;
/// Of a result, and of all results.
const RESULT_BYTES_MAX: usize = 20_000;
const RESULTS_BYTES_MAX: usize = 2_000_000;

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
    let most = |is_constructor| match is_constructor {
        true => CONSTRUCTOR_LINES_MAX,
        false => FUNCTION_LINES_MAX,
    };
    let all = source.rust.functions.iter();
    let long = all.filter(|function| function.lines > most(function.is_constructor));
    let say = |function: &vigil_size::Function| {
        let (path, line) = (&source.path, function.line);
        format!(
            "{path}:{line}: fn {} has {} lines",
            function.name, function.lines
        )
    };
    long.map(say).collect()
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
fn results_are_small() {
    let results = workspace()
        .iter()
        .filter(|source| source.path.starts_with("bench/results/"));
    let sizes = results.map(|source| (source.path.as_str(), source.text.len()));
    let sizes: Vec<(&str, usize)> = sizes.collect();
    assert!(sizes.iter().map(|(_, bytes)| bytes).sum::<usize>() <= RESULTS_BYTES_MAX);
    let large = sizes.iter().filter(|(_, bytes)| *bytes > RESULT_BYTES_MAX);
    let large = large.map(|(path, bytes)| format!("{path}: {bytes} bytes"));
    crate::demand_none(
        "Keep figures here and raw data out.",
        &large.collect::<Vec<String>>(),
    );
}

#[test]
fn what_is_too_long_is_refused() {
    let columns = |n: usize| sample("docs/slip.md", &"é".repeat(n));
    assert!(long_lines(&columns(100)).is_empty());
    assert_eq!(long_lines(&columns(101)).len(), 1);
    let address = format!("/// See <https://example.org/{}>.", "a".repeat(100));
    assert!(
        long_lines(&sample(
            "shared/robot/src/slip.rs",
            &format!("{address}\nconst A: u8 = 1;")
        ))
        .is_empty()
    );

    let function = |lines: usize| {
        let body = "    let s = \"}\"; // }\n".repeat(lines - 2);
        sample(
            "shared/robot/src/slip.rs",
            &format!("fn long() {{\n{body}}}\n"),
        )
    };
    assert!(long_functions(&function(70)).is_empty());
    let found = long_functions(&function(71));
    assert_eq!(found, ["shared/robot/src/slip.rs:1: fn long has 71 lines"]);

    let marked = format!("// A straight constructor.\n{}", function(90).text);
    assert!(long_functions(&sample("shared/robot/src/slip.rs", &marked)).is_empty());

    let file = |lines: usize| sample("shared/robot/src/slip.rs", &"fn f() {}\n".repeat(lines));
    assert!(long_file(&file(500)).is_empty());
    assert_eq!(long_file(&file(501)).len(), 1);
}

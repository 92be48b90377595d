//! Names are nouns and verbs of the field; no drawer for everything, no machine's own path.

use vigil_size::Source;

use crate::{demand_none, sample, workspace};

/// Participles and the like that say nothing as the name of a type.
const NO_NOUNS: [&str; 25] = [
    "Decided", "Driven", "Ended", "Found", "Given", "Heard", "Held", "Judged", "Kept", "Known",
    "Late", "Observed", "Obeyed", "Of", "Prepared", "Ran", "Reported", "Said", "Scored", "Seen",
    "Stored", "Told", "Used", "Wanted", "Watched",
];

const DRAWERS: [&str; 7] = [
    "common", "util", "utils", "core", "types", "misc", "helpers",
];

/// Where the project was written, in two halves, so that this file does not refuse itself.
const FOREIGN: [(&str, &str); 8] = [
    ("/wo", "rk/"),
    ("/ro", "ot/"),
    ("/ho", "me/"),
    ("/tmp/bri", "efs"),
    ("/tmp/tar", "get-"),
    ("DESI", "GN.md"),
    ("DESI", "GN section"),
    ("shared/no", "tes"),
];

fn names(source: &Source) -> Vec<String> {
    let at = |line: usize, what: String| format!("{}:{line}: {what}", source.path);
    let types = source
        .rust
        .types
        .iter()
        .filter(|of| NO_NOUNS.contains(&of.name.as_str()));
    let types = types.map(|of| at(of.line, format!("type {}", of.name)));
    let functions = source.rust.functions.iter().filter(|of| of.name == "of");
    types
        .chain(functions.map(|of| at(of.line, "fn of".into())))
        .collect()
}

/// Crates and modules are folders and files.
fn drawers(source: &Source) -> Vec<String> {
    let stem = source.path.split('.').next().unwrap_or_default();
    let in_path = source.is_rust() || source.path.ends_with("Cargo.toml");
    let is_drawer = in_path && stem.split('/').any(|part| DRAWERS.contains(&part));
    is_drawer.then(|| source.path.clone()).into_iter().collect()
}

fn foreign_words(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for (index, line) in source.text.lines().enumerate() {
        for word in FOREIGN.map(|(head, tail)| format!("{head}{tail}")) {
            if line.contains(&word) {
                found.push(format!("{}:{}: {word}", source.path, index + 1));
            }
        }
    }
    found
}

fn in_workspace(check: fn(&Source) -> Vec<String>) -> Vec<String> {
    workspace().iter().flat_map(check).collect()
}

#[test]
fn types_are_nouns_and_no_function_is_called_of() {
    demand_none(
        "Name the type after what it holds, and the function after what it does.",
        &in_workspace(names),
    );
}

#[test]
fn no_crate_or_module_is_a_drawer() {
    crate::demand_none(
        "Name the crate or module after the one concept it holds, and split it if there are two.",
        &in_workspace(drawers),
    );
}

#[test]
fn no_text_names_a_machine_or_a_file_outside_the_project() {
    crate::demand_none(
        "Use a path relative to the project, or say it in the project's own documents.",
        &in_workspace(foreign_words),
    );
}

#[test]
fn participles_drawers_and_foreign_words_are_refused() {
    let code =
        "struct Seen;\nenum Seeing {}\nimpl A {\n    pub const fn of() {}\n}\n// struct Told\n";
    assert_eq!(names(&sample("shared/a/src/b.rs", code)).len(), 2);
    for path in [
        "shared/utils/Cargo.toml",
        "shared/a/src/types.rs",
        "shared/a/src/core/b.rs",
    ] {
        assert_eq!(drawers(&sample(path, "")), [path]);
    }
    assert!(drawers(&sample("shared/a/src/slip.rs", "")).is_empty());
    let path = ["see /wo", "rk/main"].concat();
    assert_eq!(foreign_words(&sample("README.md", &path)).len(), 1);
    assert!(foreign_words(&sample("README.md", "a work/rest cycle, shared/blocks\n")).is_empty());
}

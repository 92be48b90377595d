//! Nothing in shipped code panics on purpose.

use crate::mask::{line_of, occurrences};
use crate::source::{Source, workspace};

const BANNED: [&str; 9] = [
    ".unwrap()",
    ".expect(",
    "panic!",
    "todo!",
    "unimplemented!",
    "dbg!",
    // Switching the lints off.
    "clippy::unwrap_used",
    "clippy::expect_used",
    "clippy::panic",
];

fn violations(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for source in sources.iter().filter(|source| source.is_rust()) {
        for token in BANNED {
            let lines = occurrences(&source.code, token).map(|at| line_of(&source.code, at));
            for line in lines.filter(|&line| !source.is_test(line)) {
                found.push(format!("{}:{line}: {token}", source.path));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn shipped_code_neither_unwraps_nor_panics() {
    crate::demand_none(
        "Return an error that names what was found and what is allowed; in a cycle, count it and \
         go on. (A method of your own called `expect` needs another name.)",
        &violations(workspace()),
    );
}

#[test]
fn unwrapping_is_refused_outside_tests_only() {
    let lines = "let a = b.unwrap();\nlet c = d\n    .expect(\"e\");\ntodo!();\ndbg!(a);\n";
    let path = "services/detector/src/guard.rs";
    assert_eq!(
        violations(&[Source::new(path, &format!("fn f() {{\n{lines}}}\n"))]).len(),
        4
    );
    let test = format!("#[cfg(test)]\nmod tests {{\n#![allow(clippy::panic)]\n{lines}}}\n");
    assert_eq!(
        violations(&[Source::new(path, &test)]),
        Vec::<String>::new()
    );
    let quiet = "let a = b.unwrap_or(0); // .unwrap()\nlet c = \"todo!\";\n";
    assert_eq!(
        violations(&[Source::new(path, quiet)]),
        Vec::<String>::new()
    );
    let hidden = "#[allow(dead_code, clippy::unwrap_used)]\nfn f() {}\n";
    assert_eq!(violations(&[Source::new(path, hidden)]).len(), 1);
}

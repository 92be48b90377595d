//! No word of where and how the project was written.

use crate::source::{Source, workspace};

/// Written in two halves, so that this file does not refuse itself.
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

fn violations(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for source in sources {
        for (index, line) in source.text.lines().enumerate() {
            for word in FOREIGN.map(|(head, tail)| format!("{head}{tail}")) {
                if line.contains(&word) {
                    found.push(format!("{}:{}: {word}", source.path, index + 1));
                }
            }
        }
    }
    found
}

#[test]
fn no_text_names_a_machine_or_a_file_outside_the_project() {
    crate::demand_none(
        "Use a path relative to the project, or say it in the project's own documents.",
        &violations(workspace()),
    );
}

#[test]
fn foreign_words_are_refused() {
    let path = ["see /wo", "rk/main"].concat();
    let source = Source::new("shared/robot/src/slip.rs", &path);
    assert_eq!(violations(&[source]).len(), 1);
    let source = Source::new(
        "README.md",
        "a work/rest cycle, shared/blocks, target-rate\n",
    );
    assert_eq!(violations(&[source]), Vec::<String>::new());
}

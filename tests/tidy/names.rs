//! No drawer for everything: a name says what is inside.

use crate::mask::{is_word, line_of, occurrences};
use crate::source::{Source, workspace};

const DRAWERS: [&str; 7] = [
    "common", "util", "utils", "core", "types", "misc", "helpers",
];

fn violations(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for source in sources {
        let stem = source
            .path
            .rsplit_once('.')
            .map_or(source.path.as_str(), |(stem, _)| stem);
        let in_path = source.is_rust() || source.path.ends_with("Cargo.toml");
        if in_path && stem.split('/').any(|part| DRAWERS.contains(&part)) {
            found.push(format!("{}: named after a drawer", source.path));
        }
        if source.path.ends_with("Cargo.toml") {
            let names = source
                .text
                .lines()
                .filter_map(|line| line.strip_prefix("name = "));
            for name in names.map(|name| name.trim_matches('"')) {
                if DRAWERS.contains(&name.trim_start_matches("vigil-")) {
                    found.push(format!("{}: crate '{name}'", source.path));
                }
            }
        }
        if source.is_rust() {
            found.extend(drawer_modules(source));
        }
    }
    found
}

fn drawer_modules(source: &Source) -> Vec<String> {
    let code = source.code.as_str();
    let name_after = |at: usize| {
        let tail = code[at + 3..].trim_start();
        let length = tail.bytes().take_while(|&b| is_word(b)).count();
        &tail[..length]
    };
    occurrences(code, "mod")
        .filter(|&at| DRAWERS.contains(&name_after(at)))
        .map(|at| {
            format!(
                "{}:{}: mod {}",
                source.path,
                line_of(code, at),
                name_after(at)
            )
        })
        .collect()
}

#[test]
fn no_crate_or_module_is_a_drawer() {
    crate::demand_none(
        "Name the crate or module after the one concept it holds, and split it if there are two.",
        &violations(workspace()),
    );
}

#[test]
fn drawers_are_refused() {
    let bad = [
        Source::new("shared/utils/Cargo.toml", "name = \"vigil-utils\"\n"),
        Source::new("shared/robot/src/types.rs", ""),
        Source::new("shared/robot/src/core/slip.rs", ""),
        Source::new("shared/robot/src/lib.rs", "mod slip;\npub mod common {}\n"),
    ];
    assert_eq!(violations(&bad).len(), 5);
    let good = [
        Source::new("shared/robot/Cargo.toml", "name = \"vigil-robot\"\n"),
        Source::new(
            "shared/robot/src/lib.rs",
            "mod slip; // mod types\nuse core::mem;",
        ),
    ];
    assert_eq!(violations(&good), Vec::<String>::new());
}

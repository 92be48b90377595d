//! Commands of the laboratory: another program, `vigil-lab`, beside this one, so that a graph can
//! be started without building it.

use std::ffi::OsString;

use vigil_terminal::{CommandError, Outcome};

use crate::beside;

/// The program's name.
const PROGRAM: &str = "vigil-lab";
/// Its commands, and what each does.
const COMMANDS: [(&str, &str); 8] = [
    ("init", "Writes the files of a new robot, from its log"),
    ("import", "Turns another program's log into frames"),
    ("learn", "Learns a model from recorded frames, or shows one"),
    ("diagnose", "Diagnoses recorded runs"),
    ("evaluate", "Scores the diagnosis on labelled runs"),
    ("report", "Writes a page about a recording or runs"),
    (
        "replay",
        "Computes a recording again, and compares it bit by bit",
    ),
    (
        "pomdp",
        "Checks, solves, compares and learns decision models",
    ),
];

/// What the help says of them.
pub fn help() -> String {
    let mut text = format!("Commands of {PROGRAM}, built by `cargo build --release`:\n");
    for (name, about) in COMMANDS {
        text.push_str(&format!("  {name:<16} {about}\n"));
    }
    text
}

/// Becomes `vigil-lab` with these words.
///
/// # Errors
/// A command that neither program has; a program that is not built.
pub fn run(words: &[OsString]) -> Result<Outcome, CommandError> {
    let command = words
        .first()
        .and_then(|word| word.to_str())
        .unwrap_or_default();
    if !COMMANDS.iter().any(|(name, _)| *name == command) {
        let message = format!("'{command}' is no command; `vigil --help` lists them");
        return Err(CommandError::usage(message));
    }
    let program = beside::Program {
        name: PROGRAM,
        build: "-p vigil-lab",
    };
    match beside::become_program(program, words.iter().cloned())? {}
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::COMMANDS;

    /// A file of the repository.
    fn read(path: &str) -> String {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        std::fs::read_to_string(root.join(path)).unwrap()
    }

    #[test]
    fn the_laboratory_its_page_and_this_list_have_the_same_commands() {
        let listed = COMMANDS.map(|(name, _)| name);

        let program = read("tools/lab/src/main.rs");
        let (_, after) = program.split_once("enum Command {\n").unwrap();
        let (variants, _) = after.split_once("\n}").unwrap();
        let variants = variants.lines().map(str::trim);
        let variants = variants.filter(|line| line.starts_with(|c: char| c.is_ascii_uppercase()));
        let names = variants.map(|line| line.split_once('(').unwrap().0.to_lowercase());
        assert_eq!(names.collect::<Vec<_>>(), listed);

        let page = read("tools/lab/README.md");
        let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
        let names = rows.map(|row| row.split_once('`').unwrap().0);
        assert_eq!(names.collect::<Vec<_>>(), listed);

        let commands = read("docs/commands.md");
        for name in listed {
            let row = format!("\n| `target/release/vigil {name} ");
            assert!(commands.contains(&row), "docs/commands.md lacks {name}");
        }
    }
}

//! Commands of the laboratory: another program, `vigil-lab`, beside this one, so that a graph can
//! be started without building it.

use std::ffi::OsString;

use vigil_terminal::{CommandError, Outcome};

use crate::beside;

/// The program.
pub const PROGRAM: beside::Program = beside::Program {
    name: "vigil-lab",
    build: "-p vigil-lab",
};
/// A word that is as like a name as this, by Jaro and Winkler, may be that name. Chosen: swapped,
/// missing and doubled letters are above it.
const LIKENESS_MIN: f64 = 0.85;
/// Its commands, and what each does.
const COMMANDS: [(&str, &str); 10] = [
    ("init", "Writes the files of a new robot, from its log"),
    ("import", "Turns another program's log into frames"),
    ("frames", "Writes the frames of a recording as a table"),
    ("learn", "Learns a model from recorded frames, or shows one"),
    ("diagnose", "Diagnoses recorded runs"),
    ("evaluate", "Scores the diagnosis on labelled runs"),
    ("report", "Writes a page about a recording or runs"),
    (
        "replay",
        "Computes a recording again, and compares it bit by bit",
    ),
    ("mend", "Makes a recording whole that was cut short"),
    (
        "pomdp",
        "Checks, solves, compares and learns decision models",
    ),
];

/// Its documents that have a schema: `vigil-lab schema` prints it. Here, they can be listed without
/// building that program.
pub const SCHEMAS: [&str; 20] = [
    "init",
    "import",
    "import-look",
    "import-suggest",
    "frames",
    "learn",
    "learn-channels",
    "learn-show",
    "learn-show-channels",
    "evaluate",
    "replay",
    "pomdp-compare",
    "pomdp-convert",
    "pomdp-fit",
    "pomdp-info",
    "pomdp-learn",
    "pomdp-missions",
    "pomdp-solve",
    "pomdp-track",
    "pomdp-value",
];

/// What the help says of them.
pub fn help() -> String {
    let mut text = format!(
        "Commands of {}, built by `cargo build --release`:\n",
        PROGRAM.name
    );
    for (name, about) in COMMANDS {
        text.push_str(&format!("  {name:<16} {about}\n"));
    }
    text
}

/// Becomes `vigil-lab` with a command of its own, and these words. Those of `vigil` are `own`.
///
/// # Errors
/// A command that neither program has; a program that is not built.
pub fn run(words: &[OsString], own: &clap::Command) -> Result<Outcome, CommandError> {
    let command = words
        .first()
        .and_then(|word| word.to_str())
        .unwrap_or_default();
    if !COMMANDS.iter().any(|(name, _)| *name == command) {
        let own = own.get_subcommands().map(clap::Command::get_name);
        let names = own.chain(COMMANDS.iter().map(|(name, _)| *name));
        let meant = similar(command, names)
            .map_or_else(String::new, |name| format!("; is `vigil {name}` meant?"));
        let message = format!("'{command}' is no command{meant}; `vigil --help` lists them");
        return Err(CommandError::usage(message));
    }
    start(words)
}

/// Becomes `vigil-lab` with these words, whether its command is one of those listed or not.
///
/// # Errors
/// A program that is not built.
pub fn start(words: &[OsString]) -> Result<Outcome, CommandError> {
    match beside::become_program(PROGRAM, words.iter().cloned())? {}
}

/// The name that is most like a word, if one is like it.
fn similar<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let rated = names.map(|name| (strsim::jaro_winkler(word, name), name));
    let likely = rated.filter(|(likeness, _)| *likeness >= LIKENESS_MIN);
    let nearest = likely.max_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{COMMANDS, SCHEMAS, similar};

    #[test]
    fn a_command_that_is_misspelt_is_guessed_and_another_word_is_not() {
        let names = || ["status", "stop", "replay", "report"].into_iter();
        assert_eq!(similar("statsu", names()), Some("status"));
        assert_eq!(similar("repaly", names()), Some("replay"));
        assert_eq!(similar("frobnicate", names()), None);
        assert_eq!(similar("", names()), None);
    }

    /// A file of the repository.
    fn read(path: &str) -> String {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        std::fs::read_to_string(root.join(path)).unwrap()
    }

    #[test]
    fn the_laboratory_its_page_and_this_list_have_the_same_commands() {
        let listed = COMMANDS.iter().map(|(name, _)| *name);
        // `vigil` has a command of that name, too, which starts the laboratory's.
        let listed: Vec<&str> = listed.chain(["schema"]).collect();

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

    #[test]
    fn the_laboratory_and_this_list_have_the_same_schemas() {
        let program = read("tools/lab/src/commands/schema.rs");
        let (_, after) = program.split_once("const SCHEMAS: ").unwrap();
        let (table, _) = after.split_once("];").unwrap();
        let names: Vec<&str> = table.split('"').skip(1).step_by(2).collect();
        assert_eq!(names, SCHEMAS);
    }
}

//! What the documents say is so: their commands run and print the lines that stand below them,
//! their options and links exist. A shell block says whether it runs:
//!
//! | info string | means |
//! |---|---|
//! | `sh run` | its commands run and end with 0 |
//! | `sh run exit 2`, `sh run exit any` | they end with 2, or with anything |
//! | `sh run window` | its command runs beside the blocks up to the next `text shown window` |
//! | `sh not run: REASON` | it needs what a test does not have |
//! | `text shown` | lines that the block before prints; numbers may differ |
//! | `text shown window` | lines that the window prints, which then ends |
//!
//! Times are those of the documents, but a graph of which no lines are shown ends after two
//! seconds.

#![cfg(test)]

mod blocks;
#[path = "../built/mod.rs"]
mod built;
mod follow;
mod invariants;
mod links;
mod programs;

use std::path::PathBuf;
use std::process::Command;

use blocks::{Kind, of_document};
use built::root;
use programs::unknown_words;

/// README, ARCHITECTURE and the pages in `docs`, from the root.
fn documents() -> Vec<String> {
    let pages = std::fs::read_dir(root().join("docs")).unwrap();
    let pages = pages.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let pages = pages.filter(|name| name.ends_with(".md"));
    let mut all: Vec<String> = pages.map(|name| format!("docs/{name}")).collect();
    all.extend(["README.md".into(), "ARCHITECTURE.md".into()]);
    all.sort();
    all
}

fn is_followed(document: &str) -> bool {
    let runs = |kind: &Kind| matches!(kind, Kind::Run { .. } | Kind::Window);
    let blocks = of_document(&root().join(document));
    blocks.iter().any(|block| runs(&block.kind))
}

#[test]
fn every_document_with_commands_is_followed_by_a_test() {
    let all = documents();
    let followed: Vec<&String> = all.iter().filter(|name| is_followed(name)).collect();
    assert_eq!(followed, follow::DOCUMENTS, "write a test below for each");
}

#[test]
fn readme() {
    follow::follow("README.md");
}

#[test]
fn commands() {
    follow::follow("docs/commands.md");
}

#[test]
fn first_fault() {
    follow::follow("docs/first-fault.md");
}

#[test]
fn library() {
    follow::follow("docs/library.md");
}

#[test]
fn make_it_yours() {
    follow::follow("docs/make-it-yours.md");
}

#[test]
fn operation() {
    follow::follow("docs/operation.md");
}

#[test]
fn your_robot() {
    follow::follow("docs/your-robot.md");
}

#[test]
fn blocks_that_do_not_run_say_why() {
    for document in documents() {
        for block in of_document(&root().join(&document)) {
            if let Kind::NotRun(reason) = &block.kind {
                eprintln!("{document}:{}: not run: {reason}", block.line);
            }
        }
    }
}

#[test]
fn commands_and_options_in_the_text_exist() {
    let mut wrong = Vec::new();
    for document in documents() {
        let text = std::fs::read_to_string(root().join(&document)).unwrap();
        // Blocks that do not run, and code within sentences and tables.
        let blocks = of_document(&root().join(&document));
        let in_blocks = blocks.iter().filter(|b| matches!(b.kind, Kind::NotRun(_)));
        let mut commands: Vec<String> = in_blocks.flat_map(|block| block.commands()).collect();
        let lines = text.lines().filter(|line| !line.starts_with("```"));
        let spans = lines.flat_map(|line| line.split('`').skip(1).step_by(2));
        commands.extend(spans.map(str::to_owned));
        for command in commands {
            let found = unknown_words(&command).into_iter();
            wrong.extend(found.map(|problem| format!("{document}: {problem}")));
        }
    }
    assert_eq!(wrong, [""; 0]);
}

#[test]
fn links_lead_somewhere() {
    let paths = documents().into_iter().map(|name| root().join(name));
    let dead: Vec<String> = paths.flat_map(|path: PathBuf| links::dead(&path)).collect();
    assert_eq!(dead, [""; 0]);
}

#[test]
fn named_files_exist() {
    let paths = documents().into_iter().map(|name| root().join(name));
    let missing: Vec<String> = paths
        .flat_map(|path| links::missing_paths(&path, &root()))
        .collect();
    assert_eq!(missing, [""; 0]);
}

#[test]
fn help_without_a_build_is_the_launchers() {
    let output = Command::new(built::program("vigil-launcher"))
        .arg("--help")
        .env_remove("VIGIL_CONFIG")
        .env_remove("COLUMNS")
        .output()
        .unwrap();
    let kept = std::fs::read_to_string(root().join("scripts/up.help")).unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), kept);
}

#[test]
fn invariants_are_asserted_and_tested() {
    let (count, mut wrong) = invariants::check(&root().join("ARCHITECTURE.md"));
    assert!(count > 0, "ARCHITECTURE lists none");
    for house in ["shared", "services", "tools"] {
        let rooms = std::fs::read_dir(root().join(house)).unwrap();
        let pages = rooms.map(|room| room.unwrap().path().join("README.md"));
        for page in pages.filter(|page| page.is_file()) {
            wrong.extend(invariants::check(&page).1);
        }
    }
    assert_eq!(wrong, [""; 0]);
}

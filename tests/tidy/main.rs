//! Tidy checks: what the project demands of its own text and clippy does not see.
//!
//! Each check is a pure function from sources to a list of violations, run once on the whole
//! workspace and once on a bad sample that it must refuse.
#![cfg(test)]

mod arrows;
mod modules;
mod names;
mod pure;
mod sentences;
mod signatures;
mod sizes;
mod unsafety;

use std::sync::OnceLock;

use vigil_size::Source;

/// All text files, read once.
fn workspace() -> &'static [Source] {
    static SOURCES: OnceLock<Vec<Source>> = OnceLock::new();
    SOURCES.get_or_init(|| {
        let sources = vigil_size::workspace().unwrap();
        for must in ["Cargo.toml", "shared/blocks/src/lib.rs", "docs/results.md"] {
            let found = sources.iter().any(|source| source.path == must);
            assert!(
                found,
                "{must} was not read: the checks would pass without looking"
            );
        }
        sources
    })
}

/// A source of a bad or good sample.
fn sample(path: &str, text: &str) -> Source {
    Source::new(path, text).unwrap()
}

/// Fails with all `violations`, one a line, under the sentence that says what to do.
fn demand_none(advice: &str, violations: &[String]) {
    assert!(
        violations.is_empty(),
        "\n{advice}\n{} violation(s):\n  {}\n",
        violations.len(),
        violations.join("\n  ")
    );
}

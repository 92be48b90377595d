//! `unsafe` stays in the rooms that need it. That each has its reason is clippy's to see.

use vigil_size::Source;

use crate::{sample, workspace};

/// System calls and shared memory live in the first; the file is the yardstick that both are
/// compared with.
const ROOMS: &[&str] = &["shared/cycle/", "bench/src/chain/futex.rs"];

/// Lints that nobody switches off outside of them, and those that nobody switches off at all.
const UNSAFE: &str = "unsafe_code";
const PANICS: [&str; 3] = [
    "clippy::unwrap_used",
    "clippy::expect_used",
    "clippy::panic",
];

fn violations(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for (index, line) in source.code.lines().enumerate() {
        let allows = line.contains("allow(") || line.contains("expect(");
        let is_unsafe = line.contains(UNSAFE) && !source.is_under(ROOMS);
        let panics = PANICS.iter().any(|lint| line.contains(lint));
        if source.is_rust() && allows && (is_unsafe || panics) {
            found.push(format!("{}:{}: {}", source.path, index + 1, line.trim()));
        }
    }
    found
}

#[test]
fn lints_of_unsafe_and_panic_stay_on() {
    let found: Vec<String> = workspace().iter().flat_map(violations).collect();
    crate::demand_none(
        "Write it without `unsafe`, or move it behind a safe function of shared/cycle; return an \
         error instead of a panic.",
        &found,
    );
}

#[test]
fn lints_that_are_switched_off_are_refused() {
    let allow = "#[allow(unsafe_code)]\nfn f() {}\n";
    assert_eq!(
        violations(&sample("shared/robot/src/slip.rs", allow)).len(),
        1
    );
    assert!(violations(&sample("shared/cycle/src/port.rs", allow)).is_empty());
    let panics = "#[allow(clippy::panic)]\nfn f() {}\n";
    assert_eq!(
        violations(&sample("shared/cycle/src/port.rs", panics)).len(),
        1
    );
}

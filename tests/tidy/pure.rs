//! What only computes meets no clock, file, thread or lock.

use vigil_size::Source;

use crate::{sample, workspace};

const ROOMS: &[&str] = &[
    "shared/inference/src/",
    "shared/pomdp/src/",
    "shared/robot/src/",
    "shared/diagnosis/src/",
    "shared/decision/src/",
];

/// What these rooms never name.
const CALLS: [&str; 10] = [
    "Instant::now",
    "SystemTime",
    "thread::",
    "Mutex",
    "RwLock",
    "fs::",
    "File::open",
    "net::",
    "println!",
    "print!",
];

fn violations(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    for (index, line) in source.code.lines().enumerate() {
        let names = |call: &str| {
            let mut all = line.match_indices(call);
            all.any(|(at, _)| !line[..at].ends_with(is_word))
        };
        let calls = CALLS.iter().filter(|call| names(call));
        if source.is_under(ROOMS) && !source.is_test(index + 1) {
            found.extend(calls.map(|call| format!("{}:{}: {call}", source.path, index + 1)));
        }
    }
    found
}

#[test]
fn what_computes_meets_nothing_but_its_state_and_input() {
    let found: Vec<String> = workspace().iter().flat_map(violations).collect();
    crate::demand_none(
        "Equal journals and seeds give equal beliefs, live and offline: what meets the world \
         belongs to a service's wiring or to shared/setup.",
        &found,
    );
}

#[test]
fn clocks_and_files_are_refused() {
    let bad =
        "fn step() {\n    std::time::Instant::now();\n    fs::read(p);\n    f(\"fs::\");\n}\n";
    assert_eq!(
        violations(&sample("shared/inference/src/filter.rs", bad)).len(),
        2
    );
    assert!(violations(&sample("services/detector/src/main.rs", bad)).is_empty());
}

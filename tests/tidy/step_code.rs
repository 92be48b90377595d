//! `step` code knows no clock, file, thread or lock, and a steady cycle allocates nothing.

use crate::functions::{Function, functions};
use crate::mask::{is_word, line_of, occurrences};
use crate::source::{Source, workspace};

/// Where inference and decision happen, live and offline alike.
const ROOMS: &[&str] = &[
    "services/sensor-sim/src/",
    "services/detector/src/",
    "services/identifier/src/",
    "services/supervisor/src/",
    "shared/decision/src/",
    "shared/diagnosis/src/",
    "shared/inference/src/",
    "shared/robot/src/",
    "shared/pomdp/src/",
];

/// Files of a service that connect its `step` to the world.
const WIRING: [&str; 3] = ["main.rs", "wiring.rs", "wiring"];

/// Calls that `step` code never makes, and what to do instead.
const CALLS: [(&str, &str); 15] = [
    ("Instant::now", "use differences of t_capture_ns"),
    ("SystemTime", "use differences of t_capture_ns"),
    ("thread::", "the wiring owns the thread"),
    ("Mutex", "a step owns its state"),
    ("RwLock", "a step owns its state"),
    ("std::fs", "let the wiring read and pass the content"),
    ("fs::", "let the wiring read and pass the content"),
    ("File::open", "let the wiring read and pass the content"),
    ("std::net", "blocks are the only way in and out"),
    ("UdpSocket", "blocks are the only way in and out"),
    ("println!", "publish it in a block"),
    ("eprintln!", "publish it in a block"),
    ("print!", "publish it in a block"),
    ("eprint!", "publish it in a block"),
    ("iceoryx2", "ports belong to shared/cycle"),
];

/// Words that allocate.
const ALLOCATIONS: [&str; 13] = [
    "vec!",
    "Vec::new",
    "Vec::with_capacity",
    "format!",
    ".to_string()",
    ".to_owned()",
    ".to_vec()",
    "Box::new",
    "Arc::new",
    "String::from",
    ".collect()",
    ".collect::",
    "BTreeMap::new",
];

/// First words in the names of functions that run every cycle.
const STEADY: &[&str] = &[
    "step", "update", "predict", "decide", "take", "observe", "report",
];

/// The same for decision, where solvers update their bounds offline.
const STEADY_DECISION: &[&str] = &["step", "decide"];

fn is_step_code(source: &Source) -> bool {
    let parts: Vec<&str> = source.path.split('/').collect();
    let wiring = parts[0] == "services" && parts[3..].iter().any(|part| WIRING.contains(part));
    source.is_rust() && !wiring
}

fn step_sources(sources: &[Source]) -> impl Iterator<Item = &Source> {
    sources
        .iter()
        .filter(|source| source.is_under(ROOMS) && is_step_code(source))
}

fn banned_calls(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for source in step_sources(sources) {
        for (call, instead) in CALLS {
            let lines = occurrences(&source.code, call).map(|at| line_of(&source.code, at));
            for line in lines.filter(|&line| !source.is_test(line)) {
                found.push(format!("{}:{line}: {call}: {instead}", source.path));
            }
        }
    }
    found.sort();
    found
}

fn is_steady(source: &Source, function: &Function) -> bool {
    let decision = source.is_under(&["shared/pomdp/"]);
    let prefixes = if decision { STEADY_DECISION } else { STEADY };
    let runs_every_cycle = prefixes.iter().any(|prefix| {
        let tail = function.name.strip_prefix(prefix);
        tail.is_some_and(|tail| tail.is_empty() || tail.starts_with('_'))
    });
    runs_every_cycle && !source.is_test(function.line_first)
}

fn allocations(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for source in step_sources(sources) {
        for function in functions(&source.code)
            .iter()
            .filter(|f| is_steady(source, f))
        {
            let body = &source.code[function.body.clone()];
            for word in ALLOCATIONS {
                for at in places(body, word) {
                    let line = line_of(&source.code, function.body.start + at);
                    let (path, name) = (&source.path, &function.name);
                    found.push(format!("{path}:{line}: fn {name} allocates: {word}"));
                }
            }
        }
    }
    found.sort();
    found.dedup();
    found
}

/// Offsets of `word` in `body`; unlike whole words, `Vec::new` also counts in `Vec::new_in`.
fn places<'a>(body: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let starts = move |at: usize| at == 0 || !is_word(body.as_bytes()[at - 1]);
    let whole = is_word(word.as_bytes()[0]);
    body.match_indices(word)
        .map(|(at, _)| at)
        .filter(move |&at| !whole || starts(at))
}

#[test]
fn step_code_calls_nothing_outside_its_state_and_input() {
    assert!(step_sources(workspace()).count() >= ROOMS.len());
    crate::demand_none(
        "Equal journals and seeds must give equal beliefs, live and offline; what meets the world \
         belongs to a service's main.rs or wiring.rs.",
        &banned_calls(workspace()),
    );
}

#[test]
fn functions_of_a_steady_cycle_do_not_allocate() {
    crate::demand_none(
        "Allocate in the constructor and reuse the buffer; where the function does not run every \
         cycle, do not call it step, update, predict or decide.",
        &allocations(workspace()),
    );
}

#[test]
fn clocks_files_and_locks_are_refused_in_step_code() {
    let bad =
        "fn step() {\n  let t = std::time::Instant::now();\n  fs::read(p);\n  println!();\n}\n";
    let found = |path: &str| banned_calls(&[Source::new(path, bad)]).len();
    assert_eq!(found("services/detector/src/lib.rs"), 3);
    assert_eq!(found("shared/inference/src/filter.rs"), 3);
    assert_eq!(found("services/detector/src/main.rs"), 0);
    assert_eq!(found("services/detector/src/wiring/ports.rs"), 0);
    assert_eq!(found("services/launcher/src/watch.rs"), 0);
    let test = format!("#[cfg(test)]\nmod tests {{\n{bad}}}\n");
    let source = Source::new("services/detector/src/lib.rs", &test);
    assert_eq!(banned_calls(&[source]), Vec::<String>::new());
}

#[test]
fn allocations_are_refused_in_steady_functions_only() {
    let body = "{ let a = vec![0; 3]; let b: Vec<_> = a.iter().collect::<Vec<_>>(); }";
    let found = |path: &str, name: &str| {
        allocations(&[Source::new(path, &format!("fn {name}() {body}"))]).len()
    };
    assert_eq!(found("shared/inference/src/filter.rs", "step"), 2);
    assert_eq!(found("services/detector/src/lib.rs", "predict_only"), 2);
    assert_eq!(found("services/detector/src/lib.rs", "new"), 0);
    assert_eq!(found("services/detector/src/lib.rs", "steps"), 0);
    assert_eq!(found("shared/pomdp/src/fib.rs", "update"), 0);
    assert_eq!(found("shared/pomdp/src/policy.rs", "decide"), 2);
    assert_eq!(found("tools/evaluation/src/score.rs", "update"), 0);
    let quiet = "fn step(&mut self) { self.buffer.clear(); } // vec![0; 3]\n";
    let source = Source::new("shared/inference/src/filter.rs", quiet);
    assert_eq!(allocations(&[source]), Vec::<String>::new());
}

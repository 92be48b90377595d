//! `unsafe` stays in the rooms that need it, each time with its reason.

use crate::mask::{line_of, occurrences};
use crate::source::{Source, workspace};

/// Shared memory and system calls live in the first two; the file is the yardstick that both are
/// compared with.
const ROOMS: &[&str] = &[
    "shared/blocks/",
    "shared/cycle/",
    "bench/src/chain/futex.rs",
];

/// Lines above `unsafe` in which its reason must begin.
const REASON_LINES_MAX: usize = 10;

/// A private `unsafe fn` needs no reason of its own: its callers give theirs, and a trait's method
/// is covered by the reason of the `unsafe impl`.
fn violations(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for source in sources.iter().filter(|source| source.is_rust()) {
        for at in occurrences(&source.code, "unsafe") {
            let line = line_of(&source.code, at);
            let declares = source.code[at..].starts_with("unsafe fn");
            let private = declares && !source.code.lines().nth(line - 1).unwrap().contains("pub");
            if !source.is_under(ROOMS) {
                found.push(format!("{}:{line}: unsafe outside {ROOMS:?}", source.path));
            } else if !private && !has_reason(source, line) {
                found.push(format!(
                    "{}:{line}: unsafe without a SAFETY comment",
                    source.path
                ));
            }
        }
    }
    found
}

/// True if a `SAFETY:` comment (for a function: a `# Safety` section) stands on the 1-based
/// `line` or directly above, with no blank line and no other `unsafe` in between.
fn has_reason(source: &Source, line: usize) -> bool {
    let lines: Vec<&str> = source.text.lines().collect();
    let code: Vec<&str> = source.code.lines().collect();
    let states_reason = |text: &str| text.contains("// SAFETY:") || text.contains("/// # Safety");
    if states_reason(lines[line - 1]) {
        return true;
    }
    let above = (0..line - 1).rev().take(REASON_LINES_MAX);
    above
        .take_while(|&i| {
            let other = occurrences(code[i], "unsafe").next().is_some();
            !lines[i].trim().is_empty() && !other
        })
        .any(|i| states_reason(lines[i]))
}

#[test]
fn unsafe_code_is_where_it_may_be_and_gives_its_reason() {
    crate::demand_none(
        "Write it without `unsafe`, or move it behind a safe function of shared/cycle, and state \
         in a `// SAFETY:` comment directly above why it is sound.",
        &violations(workspace()),
    );
}

#[test]
fn unsafe_code_without_place_or_reason_is_refused() {
    let with = "// SAFETY: the descriptor is open.\nlet n = unsafe { read(fd) };\n";
    let method = "// SAFETY: plain data.\nunsafe impl A for B {\n    unsafe fn c() {}\n}\n";
    let section =
        "/// Reads.\n///\n/// # Safety\n/// `p` is valid.\npub unsafe fn f(p: *mut u8) {}\n";
    let good = [
        Source::new("shared/cycle/src/port.rs", method),
        Source::new("shared/cycle/src/clock.rs", with),
        Source::new("shared/blocks/src/block.rs", section),
        Source::new("bench/src/chain/futex.rs", with),
        Source::new(
            "shared/robot/src/slip.rs",
            "#![deny(unsafe_code)] // unsafe \n",
        ),
    ];
    assert_eq!(violations(&good), Vec::<String>::new());
    for (path, text) in [
        ("shared/robot/src/slip.rs", with),
        ("tests/graph.rs", with),
        ("shared/inference/src/lanes/kernels.rs", with),
        ("shared/cycle/src/clock.rs", "let n = unsafe { read(fd) };"),
        (
            "shared/cycle/src/clock.rs",
            "// SAFETY: far away.\n\nlet n = unsafe { read(fd) };",
        ),
    ] {
        assert_eq!(
            violations(&[Source::new(path, text)]).len(),
            1,
            "{path}: {text}"
        );
    }
    let one_reason_for_two = "// SAFETY: x.\nunsafe { a() };\nunsafe { b() };";
    let source = Source::new("shared/cycle/src/clock.rs", one_reason_for_two);
    assert_eq!(
        violations(&[source]),
        ["shared/cycle/src/clock.rs:3: unsafe without a SAFETY comment"]
    );
}

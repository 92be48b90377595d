//! Finds functions in masked code.

use crate::mask::{closing, is_word, line_of, occurrences};
use std::ops::Range;

/// One function with a body.
#[derive(Debug, PartialEq, Eq)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// 1-based line of the word `fn`.
    pub line_first: usize,
    /// 1-based line of the closing brace.
    pub line_last: usize,
    /// Bytes of the body, braces included.
    pub body: Range<usize>,
}

/// All functions with a body in masked `code`, nested ones included, in order.
pub fn functions(code: &str) -> Vec<Function> {
    occurrences(code, "fn")
        .filter_map(|at| function(code, at))
        .collect()
}

fn function(code: &str, at: usize) -> Option<Function> {
    let bytes = code.as_bytes();
    let start = at
        + 2
        + bytes[at + 2..]
            .iter()
            .position(|b| !b.is_ascii_whitespace())?;
    let length = bytes[start..].iter().take_while(|&&b| is_word(b)).count();
    if length == 0 {
        return None; // A function pointer's type.
    }
    let open = body_start(code, start + length)?;
    let end = closing(code, open);
    Some(Function {
        name: code[start..start + length].to_string(),
        line_first: line_of(code, at),
        line_last: line_of(code, end - 1),
        body: open..end,
    })
}

/// Offset of the brace that opens the body; `None` for a declaration without one.
fn body_start(code: &str, from: usize) -> Option<usize> {
    let bytes = code.as_bytes();
    let (mut i, mut last) = (from, b' ');
    while i < bytes.len() {
        match bytes[i] {
            b'(' | b'[' => i = closing(code, i) - 1,
            b'{' if last == b'<' => i = closing(code, i) - 1, // A constant argument.
            b'{' => return Some(i),
            b';' => return None,
            _ => {}
        }
        if !bytes[i].is_ascii_whitespace() {
            last = bytes[i];
        }
        i += 1;
    }
    None
}

#[test]
fn functions_are_found_with_their_lines() {
    let code = "trait T { fn a(&self) -> [u8; 3]; }\nfn b<F: Fn(u8)>(f: fn(u8) -> u8)\nwhere\n    \
                F: Copy,\n{\n  fn c() -> A<{ N }> {}\n}\n";
    let found = functions(code);
    let summary: Vec<_> = found
        .iter()
        .map(|f| (f.name.as_str(), f.line_first, f.line_last))
        .collect();
    assert_eq!(summary, [("b", 2, 7), ("c", 6, 6)]);
    assert_eq!(&code[found[1].body.clone()], "{}");
}

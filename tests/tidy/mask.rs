//! Masks comments and literals, so that checks see code only.

/// `text` with every comment and every character inside a literal replaced by spaces. The quotes
/// around strings and all line breaks stay, so offsets and line numbers are those of the original.
pub fn mask(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = bytes.to_vec();
    let mut at = 0;
    while at < bytes.len() {
        let comment = comment_end(bytes, at);
        let Some(end) = comment.or_else(|| literal_end(bytes, at)) else {
            at += 1;
            continue;
        };
        for byte in out[at..end].iter_mut().filter(|byte| **byte != b'\n') {
            *byte = b' ';
        }
        let is_string = comment.is_none() && bytes[at] != b'\'';
        let quotes = |&i: &usize| is_string && bytes[i] == b'"';
        let first = (at..end).find(quotes);
        let last = (at..end).rfind(quotes);
        first.into_iter().chain(last).for_each(|i| out[i] = b'"');
        at = end;
    }
    String::from_utf8(out).expect("whole characters were replaced by ASCII spaces")
}

/// The same for TOML: `#` comments and basic strings on one line.
pub fn mask_toml(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let mut quoted = false;
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                '#' if !quoted => break,
                _ => {}
            }
            out.push(if quoted && c != '"' { ' ' } else { c });
        }
        out.push('\n');
    }
    out
}

/// True if `byte` can be part of an identifier.
pub const fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80
}

/// Byte offsets at which `token` occurs in `code`; where the token begins or ends with a word,
/// only whole words count.
pub fn occurrences<'a>(code: &'a str, token: &'a str) -> impl Iterator<Item = usize> + 'a {
    let (bytes, pattern) = (code.as_bytes(), token.as_bytes());
    code.match_indices(token)
        .map(|(at, _)| at)
        .filter(move |&at| {
            let end = at + token.len();
            let starts = !is_word(pattern[0]) || at == 0 || !is_word(bytes[at - 1]);
            let ends =
                !is_word(pattern[pattern.len() - 1]) || end == bytes.len() || !is_word(bytes[end]);
            starts && ends
        })
}

/// 1-based number of the line that holds byte `at`.
pub fn line_of(code: &str, at: usize) -> usize {
    code.as_bytes()[..at]
        .iter()
        .filter(|&&b| b == b'\n')
        .count()
        + 1
}

/// Offset after the bracket that closes the one at `open`; the end of `code` if none does.
pub fn closing(code: &str, open: usize) -> usize {
    let mut depth = 0usize;
    for (offset, byte) in code.as_bytes()[open..].iter().enumerate() {
        match byte {
            b'{' | b'(' | b'[' => depth += 1,
            b'}' | b')' | b']' => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return open + offset + 1;
                }
            }
            _ => {}
        }
    }
    code.len()
}

fn comment_end(bytes: &[u8], at: usize) -> Option<usize> {
    if bytes[at..].starts_with(b"//") {
        let length = bytes[at..].iter().position(|&b| b == b'\n');
        return Some(length.map_or(bytes.len(), |n| at + n));
    }
    if !bytes[at..].starts_with(b"/*") {
        return None;
    }
    let (mut depth, mut i) = (0usize, at);
    while i < bytes.len() {
        if bytes[i..].starts_with(b"/*") {
            depth += 1;
            i += 2;
        } else if bytes[i..].starts_with(b"*/") {
            depth -= 1;
            i += 2;
            if depth == 0 {
                return Some(i);
            }
        } else {
            i += 1;
        }
    }
    Some(bytes.len())
}

fn literal_end(bytes: &[u8], at: usize) -> Option<usize> {
    match bytes[at] {
        b'"' => Some(quoted_end(bytes, at + 1, b'"')),
        b'\'' => char_end(bytes, at),
        b'r' => raw_end(bytes, at),
        _ => None,
    }
}

/// Offset after the closing `quote`, from `i` inside the literal; backslash escapes.
fn quoted_end(bytes: &[u8], mut i: usize, quote: u8) -> usize {
    while i < bytes.len() {
        match bytes[i] {
            b'\\' => i += 2,
            b if b == quote => return i + 1,
            _ => i += 1,
        }
    }
    bytes.len()
}

/// End of a character literal; `None` for a lifetime or label.
fn char_end(bytes: &[u8], at: usize) -> Option<usize> {
    let first = *bytes.get(at + 1)?;
    if first == b'\\' {
        return Some(quoted_end(bytes, at + 1, b'\''));
    }
    let length = (1..=4).find(|n| bytes.get(at + 1 + n).is_none_or(|b| b & 0xC0 != 0x80))?;
    (bytes.get(at + 1 + length) == Some(&b'\'')).then_some(at + length + 2)
}

/// End of a raw string whose `r` is at `at`; `None` for an identifier.
fn raw_end(bytes: &[u8], at: usize) -> Option<usize> {
    let before = |n: usize| at.checked_sub(n).map(|i| bytes[i]);
    let starts_word = match before(1) {
        Some(b'b' | b'c') => !before(2).is_some_and(is_word),
        other => !other.is_some_and(is_word),
    };
    let hashes = bytes[at + 1..].iter().take_while(|&&b| b == b'#').count();
    let open = at + 1 + hashes;
    if !starts_word || bytes.get(open) != Some(&b'"') {
        return None;
    }
    let mut i = open + 1;
    while i < bytes.len() {
        let tail = &bytes[i + 1..];
        let closes = tail.len() >= hashes && tail[..hashes].iter().all(|&b| b == b'#');
        if bytes[i] == b'"' && closes {
            return Some(i + 1 + hashes);
        }
        i += 1;
    }
    Some(bytes.len())
}

#[test]
fn comments_and_literals_are_masked_and_code_is_kept() {
    assert_eq!(mask("a // x\nb"), "a     \nb");
    assert_eq!(mask("a /* x /* y */ z */ b"), "a                   b");
    let literals = r#"f("x\"y", 'z', '\'', 'é', '"')"#;
    assert_eq!(mask(literals), "f(\"    \",    ,     ,     ,    )");
    assert_eq!(mask("fn f<'a>(x: &'a str) {}"), "fn f<'a>(x: &'a str) {}");
    assert_eq!(
        mask("r#\"un\"safe\"# r#type bar"),
        "  \"       \"  r#type bar"
    );
    assert_eq!(mask("br\"{\" + \"{\""), "b \" \" + \" \"");
    let text = "let s = \"é{\"; // {\nlet c = '{';";
    assert_eq!(mask(text).len(), text.len());
    assert!(!mask(text).contains('{'));
    assert_eq!(mask_toml("a = \"x # y\" # z\n"), "a = \"     \" \n");
}

#[test]
fn words_lines_and_brackets_are_found() {
    let code = "unsafe_code unsafe {\n a(b[c]) }\nz";
    assert_eq!(occurrences(code, "unsafe").collect::<Vec<_>>(), [12]);
    assert_eq!(line_of(code, 19), 1);
    assert_eq!(line_of(code, 22), 2);
    assert_eq!(&code[19..closing(code, 19)], "{\n a(b[c]) }");
}

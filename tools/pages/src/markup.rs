//! Texts within markup.

/// Text that is no markup.
pub fn escaped(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => found.push_str("&amp;"),
            '<' => found.push_str("&lt;"),
            '>' => found.push_str("&gt;"),
            '"' => found.push_str("&quot;"),
            // Not allowed in a page, whatever a command line holds.
            letter if letter.is_control() => found.push('\u{fffd}'),
            letter => found.push(letter),
        }
    }
    found
}

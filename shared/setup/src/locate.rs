//! Finds the line of a key in a TOML text, so that a message about a value can name it.

use toml::de::{DeTable, DeValue};

/// Line (from 1) of `byte` in `text`.
pub(crate) fn line_of_byte(text: &str, byte: usize) -> usize {
    let end = byte.min(text.len());
    1 + text.as_bytes()[..end]
        .iter()
        .filter(|&&b| b == b'\n')
        .count()
}

/// Line (from 1) of the key at `path` (`services.detector.core`, `drive.2.speed_m_s`), or of the
/// deepest part of the path that exists; 1 if nothing of it does.
pub(crate) fn line_of_key(text: &str, path: &str) -> usize {
    let (byte, _) = place_of_key(text, path);
    line_of_byte(text, byte)
}

/// Line (from 1) of the key at `path`, if it is there.
pub(crate) fn line_of_given_key(text: &str, path: &str) -> Option<usize> {
    let (byte, parts) = place_of_key(text, path);
    (parts == path.split('.').count()).then(|| line_of_byte(text, byte))
}

/// Where the deepest part of the path that exists begins, and how many parts exist.
fn place_of_key(text: &str, path: &str) -> (usize, usize) {
    let (mut byte, mut parts) = (0, 0);
    let Ok(root) = DeTable::parse(text) else {
        return (byte, parts);
    };
    let mut table = Some(root.get_ref());
    let mut array: Option<&[toml::Spanned<DeValue<'_>>]> = None;
    for part in path.split('.') {
        let value = if let Some(items) = array.take() {
            let Some(item) = part.parse().ok().and_then(|i: usize| items.get(i)) else {
                break;
            };
            byte = item.span().start;
            item
        } else if let Some(entries) = table.take() {
            let Some((key, value)) = entries.iter().find(|(key, _)| key.get_ref() == part) else {
                break;
            };
            byte = key.span().start;
            value
        } else {
            break;
        };
        match value.get_ref() {
            DeValue::Table(inner) => table = Some(inner),
            DeValue::Array(items) => array = Some(items),
            _ => {}
        }
        parts += 1;
    }
    (byte, parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[graph]\nname = \"a\"\n\n[services]\ndetector = { core = 0,\n  b = 1 }\n\
                        [[drive]]\nx = 1\n[[drive]]\ny = 2\n";

    #[test]
    fn finds_keys_in_tables_inline_tables_and_arrays() {
        assert_eq!(line_of_key(TEXT, "graph.name"), 2);
        assert_eq!(line_of_key(TEXT, "services.detector.core"), 5);
        assert_eq!(line_of_key(TEXT, "services.detector.b"), 6);
        assert_eq!(line_of_key(TEXT, "drive.1.y"), 10);
        assert_eq!(line_of_given_key(TEXT, "services.detector.b"), Some(6));
        assert_eq!(line_of_given_key(TEXT, "services.detector.c"), None);
        assert_eq!(line_of_given_key("[graph", "graph"), None);
    }

    #[test]
    fn falls_back_to_the_deepest_part_that_exists() {
        assert_eq!(line_of_key(TEXT, "services.identifier.core"), 4);
        assert_eq!(line_of_key(TEXT, "nothing"), 1);
        assert_eq!(line_of_key("not toml [", "a"), 1);
    }
}

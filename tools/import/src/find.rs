//! The runs of a log: files or folders by pattern.

use std::fs;
use std::path::{Path, PathBuf};

use super::ImportError;

/// Every file or folder below `folder` that a pattern names, in the order of the patterns, then by
/// name.
pub(super) fn runs(folder: &Path, patterns: &[String]) -> Result<Vec<PathBuf>, ImportError> {
    let mut found = Vec::new();
    for pattern in patterns {
        let mut paths = vec![folder.to_path_buf()];
        for part in pattern.split('/').filter(|part| !part.is_empty()) {
            let mut next = Vec::new();
            for path in &paths {
                next.extend(children(path, part)?);
            }
            paths = next;
        }
        paths.sort();
        found.extend(paths);
    }
    if found.is_empty() {
        return Err(ImportError::NoRuns {
            folder: folder.to_path_buf(),
            patterns: patterns.join(", "),
        });
    }
    Ok(found)
}

fn children(folder: &Path, part: &str) -> Result<Vec<PathBuf>, ImportError> {
    if !part.contains('*') {
        let path = folder.join(part);
        return Ok(if path.exists() {
            vec![path]
        } else {
            Vec::new()
        });
    }
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let io = |error| ImportError::Io {
        path: folder.to_path_buf(),
        error,
    };
    let mut out = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        if matches(part, &entry.file_name().to_string_lossy()) {
            out.push(entry.path());
        }
    }
    Ok(out)
}

/// True if `name` is `pattern` with every `*` replaced by some text.
fn matches(pattern: &str, name: &str) -> bool {
    let Some((before, after)) = pattern.split_once('*') else {
        return pattern == name;
    };
    let Some(rest) = name.strip_prefix(before) else {
        return false;
    };
    let mut starts = (0..=rest.len()).filter(|&i| rest.is_char_boundary(i));
    starts.any(|i| matches(after, rest.get(i..).unwrap_or("")))
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn a_star_stands_for_any_text() {
        for (pattern, name) in [("*", ""), ("a*", "a"), ("*_b*.csv", "a_b1.csv"), ("x", "x")] {
            assert!(matches(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [("a*", "b"), ("*.csv", "a.csv2"), ("x", "xy"), ("", "x")] {
            assert!(!matches(pattern, name), "{pattern} {name}");
        }
    }
}

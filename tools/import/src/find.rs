//! The runs of a log: files or folders by pattern.

use std::fs;
use std::path::{Path, PathBuf};

use super::ImportError;

/// A file or folder that a pattern names.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FoundRun {
    /// Where it is.
    pub path: PathBuf,
    /// What the first `*` of the last part with one stands for; empty without one.
    pub star: String,
}

/// Every file or folder below `folder` that a pattern names, in the order of the patterns, then by
/// name.
pub(super) fn runs(folder: &Path, patterns: &[String]) -> Result<Vec<FoundRun>, ImportError> {
    let mut found = Vec::new();
    for pattern in patterns {
        let mut paths = vec![FoundRun {
            path: folder.to_path_buf(),
            star: String::new(),
        }];
        for part in pattern.split('/').filter(|part| !part.is_empty()) {
            let mut next = Vec::new();
            for place in &paths {
                next.extend(children(place, part)?);
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

fn children(place: &FoundRun, part: &str) -> Result<Vec<FoundRun>, ImportError> {
    let folder = &place.path;
    if !part.contains('*') {
        let (path, star) = (folder.join(part), place.star.clone());
        return Ok(if path.exists() {
            vec![FoundRun { path, star }]
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
        if let Some(star) = matches(part, &entry.file_name().to_string_lossy()) {
            out.push(FoundRun {
                path: entry.path(),
                star: star.to_owned(),
            });
        }
    }
    Ok(out)
}

/// What the first `*` of `pattern` stands for if `name` is `pattern` with every `*` replaced by
/// some text; empty without one.
fn matches<'a>(pattern: &str, name: &'a str) -> Option<&'a str> {
    let Some((before, after)) = pattern.split_once('*') else {
        return (pattern == name).then_some("");
    };
    let rest = name.strip_prefix(before)?;
    let mut ends = (0..=rest.len()).filter_map(|i| rest.split_at_checked(i));
    ends.find_map(|(star, rest)| matches(after, rest).map(|_| star))
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn a_star_stands_for_any_text() {
        for (pattern, name) in [("*", ""), ("a*", "a"), ("*_b*.csv", "a_b1.csv"), ("x", "x")] {
            assert!(matches(pattern, name).is_some(), "{pattern} {name}");
        }
        for (pattern, name) in [("a*", "b"), ("*.csv", "a.csv2"), ("x", "xy"), ("", "x")] {
            assert!(matches(pattern, name).is_none(), "{pattern} {name}");
        }
        assert_eq!(matches("pro_*.csv", "pro_07.csv"), Some("07"));
    }
}

//! The counts.

use serde::Serialize;

use crate::cargo::LinkedCrate;
use crate::configured::Build;
use crate::source::{Source, count};

/// Lines of a set of sources.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Lines {
    /// Lines of shipped code.
    pub code: usize,
    /// Lines of comments beside it.
    pub comments: usize,
    /// Lines of test code.
    pub tests: usize,
}

/// How long functions or files are, in lines of text.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Distribution {
    /// How many there are.
    #[serde(rename = "n")]
    pub count: usize,
    /// Half are no longer.
    pub median: usize,
    /// Nine of ten are no longer.
    pub p90: usize,
    /// The longest.
    pub max: usize,
}

impl Distribution {
    fn new(mut lines: Vec<usize>) -> Self {
        lines.sort_unstable();
        let count = lines.len();
        let at = |share: f64| {
            let index = (share * count as f64).ceil() as usize;
            lines.get(index.saturating_sub(1)).copied().unwrap_or(0)
        };
        Self {
            count,
            median: at(0.5),
            p90: at(0.9),
            max: at(1.0),
        }
    }
}

/// How large the workspace is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Size {
    /// Lines by room: `shared`, `services`, `tools`, `bench`, `examples`, `python`,
    /// `tests`.
    pub rooms: Vec<(&'static str, Lines)>,
    /// Lines of code by crate, but for those without.
    pub crates: Vec<(String, Lines)>,
    /// Lines of code that the services and the launcher link, by crate.
    pub linked: Vec<(String, usize)>,
    /// Functions of shipped code.
    pub functions: Distribution,
    /// Files of Rust.
    pub files: Distribution,
}

/// The top folders.
const ROOMS: [&str; 7] = [
    "shared", "services", "tools", "bench", "examples", "python", "tests",
];

/// Counts.
#[must_use]
pub fn measure(sources: &[Source], linked: &[LinkedCrate]) -> Size {
    let rust: Vec<&Source> = sources.iter().filter(|source| source.is_rust()).collect();
    let under = |folder: &str| {
        let mine = rust.iter().filter(|source| source.path.starts_with(folder));
        mine.fold(Lines::default(), |sum, source| sum.plus(lines(source)))
    };
    let linked = linked.iter().map(|of| {
        let source = format!("{}src/", of.folder);
        let build = Build {
            test: false,
            features: Some(&of.features),
        };
        let mine = rust.iter().filter(|one| one.path.starts_with(&source));
        let code = mine.map(|one| code_lines(one, build)).sum();
        (of.folder.trim_end_matches('/').to_owned(), code)
    });
    let functions = rust.iter().flat_map(|source| {
        let all = source.rust.functions.iter();
        all.filter(|function| !source.is_test(function.line))
            .map(|function| function.lines)
    });
    let mut crates: Vec<String> = sources.iter().filter_map(crate_folder).collect();
    crates.sort_unstable();
    Size {
        rooms: ROOMS
            .map(|room| (room, under(&format!("{room}/"))))
            .to_vec(),
        crates: crates
            .into_iter()
            .map(|folder| (folder.clone(), under(&folder)))
            .collect(),
        linked: linked.collect(),
        functions: Distribution::new(functions.collect()),
        files: Distribution::new(rust.iter().map(|one| one.text.lines().count()).collect()),
    }
}

/// The folder of a manifest, with `/` at the end.
fn crate_folder(source: &Source) -> Option<String> {
    let folder = source.path.strip_suffix("Cargo.toml")?;
    (!folder.is_empty()).then(|| folder.to_owned())
}

impl Lines {
    /// The sum.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self {
            code: self.code + other.code,
            comments: self.comments + other.comments,
            tests: self.tests + other.tests,
        }
    }
}

fn lines(source: &Source) -> Lines {
    let all = 0..source.text.lines().count();
    let code = |line: usize| source.rust.code_lines[line];
    let is_blank: Vec<bool> = source
        .text
        .lines()
        .map(|line| line.trim().is_empty())
        .collect();
    let is_test = |line: usize| source.is_test(line + 1) || source.path.starts_with("examples/");
    Lines {
        code: count(all.clone(), |line| code(line) && !is_test(line)),
        comments: count(all.clone(), |line| {
            !code(line) && !is_blank[line] && !is_test(line)
        }),
        tests: count(all, |line| code(line) && is_test(line)),
    }
}

fn code_lines(source: &Source, build: Build<'_>) -> usize {
    let all = 0..source.rust.code_lines.len();
    count(all, |line| {
        source.rust.code_lines[line] && source.is_in(line, build)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_code_have_a_token_and_features_count_where_they_are_enabled() {
        let text = "//! Docs.\n\n/// More.\nfn a() {\n    // Why.\n    let b = \"\n    c\";\n}\n\
                    #[cfg(feature = \"x\")]\nfn d() {}\n#[cfg(test)]\nmod tests {\n}\n";
        let source = Source::new("shared/a/src/lib.rs", text).unwrap();
        let found = lines(&source);
        assert_eq!(
            found,
            Lines {
                code: 6,
                comments: 3,
                tests: 3
            }
        );
        let manifest = Source::new("shared/a/Cargo.toml", "").unwrap();
        let linked = |features: &[&str]| LinkedCrate {
            folder: "shared/a/".into(),
            features: features.iter().map(ToString::to_string).collect(),
        };
        let sources = [source, manifest];
        let without = measure(&sources, &[linked(&[])]);
        assert_eq!(without.linked, [("shared/a".to_owned(), 4)]);
        assert_eq!(measure(&sources, &[linked(&["x"])]).linked[0].1, 6);
        assert_eq!(
            without.functions,
            Distribution {
                count: 2,
                median: 1,
                p90: 5,
                max: 5
            }
        );
    }
}

//! Tells which lines of a source are compiled for tests only.

use crate::mask::{closing, line_of};

/// What of a file is test code.
pub struct TestRegions {
    /// For each line (from 0): true if it belongs to an item under `#[cfg(test)]` or `#[test]`.
    pub lines: Vec<bool>,
    /// Offsets of the items under `#[cfg(test)]` that are modules in files of their own.
    pub modules: Vec<(usize, String)>,
}

/// Finds the test regions of masked `code`.
pub fn test_regions(code: &str) -> TestRegions {
    let count = code.lines().count();
    let whole_file = code.contains("#![cfg(test)]");
    let mut regions = TestRegions {
        lines: vec![whole_file; count],
        modules: Vec::new(),
    };
    for attribute in ["#[cfg(test)]", "#[cfg(all(test", "#[test]"] {
        for (at, _) in code.match_indices(attribute) {
            let Some((item_end, module)) = item(code, at) else {
                continue;
            };
            let first = first_attribute_line(code, line_of(code, at) - 1);
            let last = line_of(code, item_end - 1) - 1;
            regions.lines[first..=last].fill(true);
            regions.modules.extend(module.map(|name| (at, name)));
        }
    }
    regions
}

/// End of the item whose attribute is at `at`, and its name if it is `mod name;`.
fn item(code: &str, at: usize) -> Option<(usize, Option<String>)> {
    let bytes = code.as_bytes();
    let (mut i, mut item_start) = (at, at);
    while i < bytes.len() {
        match bytes[i] {
            b'#' => {
                i = closing(code, i + 1);
                item_start = i;
                continue;
            }
            b'(' | b'[' => i = closing(code, i) - 1,
            b'{' => return Some((closing(code, i), None)),
            b';' => {
                let mut words = code[item_start..i].split_whitespace();
                let module = words
                    .any(|word| word == "mod")
                    .then(|| words.next())
                    .flatten();
                return Some((i + 1, module.map(str::to_string)));
            }
            _ => {}
        }
        i += 1;
    }
    None
}

/// Index of the first line of the attributes directly above line `index`.
fn first_attribute_line(code: &str, index: usize) -> usize {
    let lines: Vec<&str> = code.lines().collect();
    let mut first = index;
    while first > 0 && lines[first - 1].trim_start().starts_with("#[") {
        first -= 1;
    }
    first
}

#[test]
fn test_items_are_told_from_others() {
    let code = "fn a() {}\n#[allow(x)]\n#[cfg(test)]\n#[path = \"   \"]\nmod tests {\n  fn b() {}\n\
                }\nfn c() {}\n#[test]\nfn d() {}\n";
    let marks: String = test_regions(code)
        .lines
        .iter()
        .map(|&test| if test { 't' } else { '.' })
        .collect();
    assert_eq!(marks, ".tttttt.tt");
    assert!(
        test_regions("#![cfg(test)]\nfn a() {}")
            .lines
            .iter()
            .all(|&test| test)
    );
    let not_only_tests = "#[cfg(any(test, feature = \"x\"))]\nfn a() {}";
    assert!(test_regions(not_only_tests).lines.iter().all(|&test| !test));
}

#[test]
fn test_modules_in_files_of_their_own_are_named() {
    let modules = test_regions("#[cfg(test)]\npub(crate) mod fixtures;\nmod other;").modules;
    assert_eq!(modules, [(0, "fixtures".to_string())]);
}

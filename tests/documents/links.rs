//! Links between documents: the file is there, and so is its heading.

use std::path::Path;

/// Targets of the links in a text, but those into the web.
fn targets(text: &str) -> Vec<&str> {
    let after = text.split("](").skip(1);
    let targets = after.filter_map(|rest| rest.split_once(')'));
    let targets = targets.map(|(target, _)| target);
    targets.filter(|target| !target.contains("://")).collect()
}

/// The anchor of a heading: its letters, digits, `-` and `_`, small, with `-` for blanks.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let text: String = heading.trim().chars().filter(kept).collect();
    text.to_lowercase().replace(' ', "-")
}

fn has_anchor(text: &str, wanted: &str) -> bool {
    let mut is_code = false;
    text.lines().any(|line| {
        is_code ^= line.starts_with("```");
        let heading = line.trim_start_matches('#');
        !is_code && heading.len() < line.len() && anchor(heading) == wanted
    })
}

/// Links of a document that lead nowhere.
pub fn dead(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let leads = |target: &&str| {
        let (file, wanted) = target.split_once('#').unwrap_or((target, ""));
        let file = match file {
            "" => path.to_path_buf(),
            file => path.parent().unwrap().join(file),
        };
        let read = || std::fs::read_to_string(&file).unwrap_or_default();
        file.exists() && (wanted.is_empty() || has_anchor(&read(), wanted))
    };
    let dead = targets(&text).into_iter().filter(|target| !leads(target));
    dead.map(|target| format!("{}: {target}", path.display()))
        .collect()
}

/// Paths of the repository that a document names and that do not exist.
pub fn missing_paths(path: &Path, root: &Path) -> Vec<String> {
    const FOLDERS: [&str; 9] = [
        "bench/",
        "config/",
        "docs/",
        "examples/",
        "python/",
        "scripts/",
        "services/",
        "shared/",
        "tests/",
    ];
    let text = std::fs::read_to_string(path).unwrap();
    let spans = text
        .lines()
        .flat_map(|line| line.split('`').skip(1).step_by(2));
    let is_path = |word: &&str| {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
        FOLDERS.iter().any(|folder| word.starts_with(folder)) && word.chars().all(is_name)
    };
    let missing = spans
        .filter(is_path)
        .filter(|name| !root.join(name).exists());
    missing
        .map(|name| format!("{}: {name}", path.display()))
        .collect()
}

#[test]
fn dead_links_are_found() {
    let text = "# A `b` c?\n[x](y.md#z) and ![p](q.svg), [w](https://a.b/c)\n";
    assert_eq!(targets(text), ["y.md#z", "q.svg"]);
    assert!(has_anchor(text, "a-b-c"));
    assert!(!has_anchor("```\n# a\n```\n", "a"));
}

//! Modules see each other one way, and by their own names.

use std::collections::{BTreeMap, BTreeSet};

use vigil_size::{Import, Source};

use crate::{demand_none, sample, workspace};

/// A module: `robot`, `learned`, `form` of `shared/robot/src/learned/form.rs`.
type Path = Vec<String>;

/// The sources of one crate.
struct Crate<'a> {
    folder: &'a str,
    sources: Vec<(Path, &'a Source)>,
}

/// The crates by the folder of their sources.
fn crates(sources: &[Source]) -> Vec<Crate<'_>> {
    let mut found: BTreeMap<&str, Vec<(Path, &Source)>> = BTreeMap::new();
    for source in sources.iter().filter(|source| source.is_rust()) {
        let Some((folder, file)) = source.path.split_once("/src/") else {
            continue;
        };
        let mut path: Path = file
            .trim_end_matches(".rs")
            .split('/')
            .map(str::to_owned)
            .collect();
        if path
            .last()
            .is_some_and(|last| ["lib", "main", "mod"].contains(&last.as_str()))
        {
            path.pop();
        }
        found.entry(folder).or_default().push((path, source));
    }
    found
        .into_iter()
        .map(|(folder, sources)| Crate { folder, sources })
        .collect()
}

/// The path from the crate's root that an import in the module `from` names.
fn absolute(from: &Path, import: &Import) -> Option<Path> {
    let mut at = [from.as_slice(), &import.inside].concat();
    let mut segments = import.path.iter();
    match segments.next()?.as_str() {
        "crate" => at.clear(),
        "super" => at.truncate(at.len().checked_sub(1)?),
        "self" => {}
        _ => return None,
    }
    for segment in segments {
        match segment.as_str() {
            "super" => at.truncate(at.len().checked_sub(1)?),
            name => at.push(name.to_owned()),
        }
    }
    Some(at)
}

impl Crate<'_> {
    /// The module that a path leads into.
    fn module(&self, path: &Path) -> Path {
        let lengths = (0..=path.len()).rev();
        let is_module = |length: &usize| self.sources.iter().any(|(at, _)| *at == path[..*length]);
        let length = lengths.clone().find(is_module).unwrap_or(0);
        path[..length].to_vec()
    }

    /// For each module with children, which of them sees which other, with a place of it.
    fn arrows(&self) -> BTreeMap<Path, BTreeMap<(String, String), String>> {
        let mut found: BTreeMap<Path, BTreeMap<(String, String), String>> = BTreeMap::new();
        for (from, source) in &self.sources {
            for import in source
                .rust
                .imports
                .iter()
                .filter(|one| !source.is_test(one.line))
            {
                let Some(to) = absolute(from, import).map(|path| self.module(&path)) else {
                    continue;
                };
                let same = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
                if let (Some(a), Some(b)) = (from.get(same), to.get(same)) {
                    let arrow = (a.clone(), b.clone());
                    let place = format!("{}:{}", source.path, import.line);
                    found
                        .entry(to[..same].to_vec())
                        .or_default()
                        .entry(arrow)
                        .or_insert(place);
                }
            }
        }
        found
    }

    /// Arrows that lie on a circle.
    fn circles(&self) -> Vec<String> {
        let mut found = Vec::new();
        for (parent, arrows) in self.arrows() {
            for ((from, to), place) in &arrows {
                if reaches(&arrows, to, from) {
                    let parent = parent.join("::");
                    found.push(format!("{place}: {parent}: {from} and {to} see each other"));
                }
            }
        }
        found
    }

    /// Names that a file takes from its own crate's face instead of from where they are.
    fn face_imports(&self) -> Vec<String> {
        let faces = self.sources.iter().filter(|(path, _)| path.is_empty());
        let names = faces.flat_map(|(_, face)| face.rust.imports.iter());
        let names = names
            .filter(|import| import.is_public)
            .filter_map(|one| one.path.last());
        let shown: BTreeSet<&String> = names.collect();
        let mut found = Vec::new();
        for (from, source) in self.sources.iter().filter(|(path, _)| !path.is_empty()) {
            for import in source
                .rust
                .imports
                .iter()
                .filter(|one| !source.is_test(one.line))
            {
                let Some(path) = absolute(from, import) else {
                    continue;
                };
                let is_module = self
                    .sources
                    .iter()
                    .any(|(at, _)| at[..] == path[..1.min(path.len())]);
                if path.first().is_some_and(|name| shown.contains(name)) && !is_module {
                    found.push(format!(
                        "{}:{}: crate::{}",
                        source.path, import.line, path[0]
                    ));
                }
            }
        }
        found
    }
}

/// True if there is a way along the arrows.
fn reaches(arrows: &BTreeMap<(String, String), String>, from: &str, to: &str) -> bool {
    let (mut waiting, mut known) = (vec![from], BTreeSet::new());
    while let Some(at) = waiting.pop() {
        if at == to {
            return true;
        }
        if known.insert(at) {
            waiting.extend(
                arrows
                    .keys()
                    .filter(|(a, _)| a == at)
                    .map(|(_, b)| b.as_str()),
            );
        }
    }
    false
}

fn circles(sources: &[Source]) -> Vec<String> {
    crates(sources).iter().flat_map(Crate::circles).collect()
}

fn face_imports(sources: &[Source]) -> Vec<String> {
    crates(sources)
        .iter()
        .flat_map(Crate::face_imports)
        .collect()
}

#[test]
fn sibling_modules_see_each_other_one_way() {
    assert!(
        crates(workspace())
            .iter()
            .any(|one| one.folder == "shared/cycle")
    );
    demand_none(
        "Move what both need to a module of its own, or pass it in.",
        &circles(workspace()),
    );
}

#[test]
fn no_file_imports_through_the_face_of_its_own_crate() {
    demand_none(
        "Name the module that defines it: crate::room::Name.",
        &face_imports(workspace()),
    );
}

#[test]
fn circles_and_imports_through_the_face_are_refused() {
    let sources = [
        sample(
            "shared/a/src/lib.rs",
            "mod b;\nmod c;\nmod d;\npub use b::B;\npub use c::C;\n",
        ),
        sample(
            "shared/a/src/b.rs",
            "use crate::c::C;\npub struct B;\nfn f() { super::d::g() }\n",
        ),
        sample("shared/a/src/c.rs", "use super::b::B;\npub struct C;\n"),
        sample(
            "shared/a/src/d.rs",
            "#[cfg(test)]\nuse crate::b::B;\npub fn g() {}\n",
        ),
        sample("shared/a/src/d/e.rs", "use crate::C;\nuse super::g;\n"),
    ];
    assert_eq!(
        circles(&sources),
        [
            "shared/a/src/b.rs:1: : b and c see each other",
            "shared/a/src/c.rs:1: : c and b see each other"
        ]
    );
    assert_eq!(face_imports(&sources), ["shared/a/src/d/e.rs:1: crate::C"]);
}

//! Every configuration key is documented where it is defined, and every key in use is defined.

use crate::mask::mask_toml;
use crate::source::{Source, workspace};
use crate::struct_fields::{Field, fields};
use std::collections::BTreeSet;

/// Where the keys of the files below a folder of `config/` are defined; the first match holds.
const DEFINITIONS: [(&str, &[&str]); 6] = [
    ("config/logs/", &["tools/import/src/"]),
    ("config/robots/", &["shared/robot/src/"]),
    ("config/trees/", &["shared/setup/src/schema"]),
    (
        "config/models/",
        &["shared/robot/src/", "tools/learning/src/"],
    ),
    (
        "config/navigation.toml",
        &["tools/missions/src/navigation/"],
    ),
    (
        "config/",
        &[
            "shared/setup/src/schema",
            "shared/diagnosis/src/settings.rs",
            "shared/decision/src/settings.rs",
        ],
    ),
];

fn schema<'a>(sources: &'a [Source], path: &str) -> impl Iterator<Item = (&'a Source, Field)> {
    let (_, rooms) = DEFINITIONS
        .into_iter()
        .find(|(folder, _)| path.starts_with(folder))
        .expect("the last entry of DEFINITIONS holds for all of config/");
    let rust = sources
        .iter()
        .filter(move |source| source.is_rust() && source.is_under(rooms));
    rust.flat_map(|source| fields(source).into_iter().map(move |field| (source, field)))
}

fn undocumented(sources: &[Source]) -> Vec<String> {
    let mut found = BTreeSet::new();
    for (folder, _) in DEFINITIONS {
        for (source, field) in schema(sources, folder).filter(|(_, field)| !field.is_documented) {
            found.insert(format!("{}:{}: {}", source.path, field.line, field.key));
        }
    }
    found.into_iter().collect()
}

fn unknown(sources: &[Source]) -> Vec<String> {
    let is_config =
        |source: &&Source| source.path.starts_with("config/") && source.path.ends_with(".toml");
    let mut found = Vec::new();
    for file in sources.iter().filter(is_config) {
        let known: Vec<Field> = schema(sources, &file.path)
            .map(|(_, field)| field)
            .collect();
        for (line, key) in keys(&file.text, &known) {
            if !known.iter().any(|field| field.key == key) {
                found.push(format!("{}:{line}: {key}", file.path));
            }
        }
    }
    found
}

/// All keys in a TOML text with their lines (from 1), but those that the user chooses.
fn keys(text: &str, known: &[Field]) -> Vec<(usize, String)> {
    let is_free = |key: &str| {
        known
            .iter()
            .any(|field| field.key == key && field.has_free_keys())
    };
    let mut found = Vec::new();
    let mut in_free_table = false;
    for (index, line) in mask_toml(text).lines().enumerate() {
        let mut add = |key: &str| found.push((index + 1, key.trim().to_string()));
        if line.starts_with('[') {
            let mut parent_is_free = false;
            for part in line.trim_matches(|c: char| "[] ".contains(c)).split('.') {
                if !parent_is_free {
                    add(part);
                }
                parent_is_free = !parent_is_free && is_free(part.trim());
            }
            in_free_table = parent_is_free;
            continue;
        }
        for (at, _) in line.match_indices('=') {
            let before = &line[..at];
            let start = before.rfind(['{', ',', '[']).map_or(0, |i| i + 1);
            if start == 0 && in_free_table {
                continue;
            }
            before[start..].split('.').for_each(&mut add);
        }
    }
    found
}

#[test]
fn every_configuration_key_is_documented() {
    assert!(schema(workspace(), "config/rover.toml").count() > 40);
    crate::demand_none(
        "Say above the field what the key means, its unit and its range.",
        &undocumented(workspace()),
    );
}

#[test]
fn every_key_in_config_is_in_the_schema() {
    crate::demand_none(
        "Define the key in the schema, or remove it from the file.",
        &unknown(workspace()),
    );
}

#[test]
fn undocumented_and_unknown_keys_are_refused() {
    let schema = "#[derive(Deserialize)]\npub struct Graph {\n    /// Rate, Hz.\n    pub rate_hz: \
                  f64,\n    pub seed: u64,\n    /// By the action's name.\n    pub actions: \
                  BTreeMap<String, Action>,\n}\n";
    let config = "rate_hz = 1.0 # x = 2\nrate = 2.0\nactions = { kind = \"a = b\" }\n[graph]\n\
                  [actions]\ngo_on = { kind = 1, seed = 2 }\n[actions.stop]\nseed = 1\nsped = 2\n";
    let sources = [
        Source::new("shared/setup/src/schema.rs", schema),
        Source::new("config/rover.toml", config),
    ];
    assert_eq!(
        undocumented(&sources),
        ["shared/setup/src/schema.rs:5: seed"]
    );
    let expected = ["2: rate", "3: kind", "4: graph", "6: kind", "9: sped"];
    assert_eq!(
        unknown(&sources),
        expected.map(|tail| format!("config/rover.toml:{tail}"))
    );
}

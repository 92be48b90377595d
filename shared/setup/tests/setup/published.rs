//! The published page and schema are those of the present settings, and say what these say.

use std::path::PathBuf;

use serde_json::Value;
use vigil_setup::{reference, robot_reference, schema};

/// A file of the repository.
fn published(name: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::fs::read_to_string(root.join(name)).unwrap()
}

#[test]
fn the_published_page_is_up_to_date() {
    assert!(
        published("docs/configuration.md") == reference(),
        "make it anew: cargo run -p vigil -- config --reference > docs/configuration.md"
    );
}

#[test]
fn the_published_page_of_robots_is_up_to_date() {
    assert!(
        published("docs/robot-description.md") == robot_reference(),
        "make it anew: cargo run -p vigil -- config --reference robot > docs/robot-description.md"
    );
}

#[test]
fn the_page_of_robots_has_the_keys_of_the_file_and_of_its_tables() {
    let page = robot_reference();
    for part in [
        "## At the top\n",
        "| `interval_s` | s | 0.02 to 0.3 | 0.1 |",
        "| `kinematics` |  | `ackermann6`, `differential`, `omni3`, `none` | required |",
        "## `[[channel]]`\n",
        "- `voltage`: Electric voltage, V.\n",
        "## `[[wheels]]`\n",
    ] {
        assert!(page.contains(part), "{part}\n{page}");
    }
}

#[test]
fn the_published_schema_is_up_to_date() {
    let published: Value = serde_json::from_str(&published("config/schema.json")).unwrap();
    assert!(
        published == schema(),
        "make it anew: cargo run -p vigil -- config --schema > config/schema.json"
    );
}

#[test]
fn the_page_has_unit_range_default_and_meaning_of_a_key() {
    let page = reference();
    let row = "| `ring_s` | s | 0.5 to 30 | 3 | Kept frames from which an identification starts. |";
    assert!(page.contains(row), "{page}");
    for part in [
        "## `[services.detector]`, `[services.identifier]`, `[services.sensor-sim]`, \
         `[services.supervisor]`\n",
        "## `[[navigation.obstacle]]`\n",
        "## `[supervisor.actions.NAME]`\n",
        "| `core` |  | 0 or more | required |",
        "| `alive_s` | s | 0.3 to 60, or 0 for none | 2 |",
        "| `path` | m | 2 to 256 entries |",
        "| `particles` |  | 32 to 1024 | none |",
        "- `degrade`: As `predict`",
    ] {
        assert!(page.contains(part), "{part}\n{page}");
    }
}

/// Calls `check` with each key of a schema and what it says of it.
fn each_key(schema: &Value, path: &str, check: &mut impl FnMut(&str, &Value)) {
    for (key, value) in schema["properties"].as_object().into_iter().flatten() {
        let path = format!("{path}/{key}");
        check(&path, value);
        each_key(value, &path, check);
    }
    let inner = ["items", "additionalProperties"].map(|key| schema.get(key));
    for inner in inner.into_iter().flatten() {
        each_key(inner, path, check);
    }
    for choice in schema["anyOf"].as_array().into_iter().flatten() {
        each_key(choice, path, check);
    }
}

#[test]
fn every_key_has_a_meaning_and_every_number_a_range() {
    let mut count = 0;
    each_key(&schema(), "", &mut |path, value| {
        count += 1;
        assert!(
            value["description"].is_string(),
            "{path}: say what it means"
        );
        let is_number = value["type"].to_string().contains("number");
        // The robot's description says how far it can steer.
        let is_bounded = value["minimum"].is_number() || path == "/drive/curvature_1_m";
        assert!(!is_number || is_bounded, "{path}: give it a range");
    });
    assert!(count > 100, "{count}");
}

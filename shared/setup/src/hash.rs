//! The configuration's hash: over what it says, however it is written.

use serde::Serialize;
use vigil_blocks::fnv1a;

/// FNV-1a over the canonical JSON text of `value`: keys sorted, no blanks. The order of keys,
/// comments and the names of Rust types do not enter.
pub(crate) fn canonical(hash: u64, value: &impl Serialize) -> Result<u64, serde_json::Error> {
    let mut value = serde_json::to_value(value)?;
    value.sort_all_objects();
    Ok(fnv1a::hash(hash, value.to_string().as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph_file::GraphFile;
    use serde_json::{Value, json};

    fn hash(value: &impl Serialize) -> u64 {
        canonical(fnv1a::BASIS, value).unwrap()
    }

    fn read(text: &str) -> GraphFile {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn comments_and_the_order_of_keys_do_not_matter() {
        let services = "sensor-sim = { core = 0, deadline_percent = 20.0 }\n\
                        detector = { core = 0, deadline_percent = 50 }\n\
                        identifier = { deadline_percent = 75.0, core = 1 }\n\
                        supervisor = { core = 1, deadline_percent = 95.0 }\n";
        let files = "[files]\nrobot = \"r\"\ntree = \"t\"\nmodel = \"m\"\ndecision = \"d\"\n";
        let one = format!(
            "[graph]\nname = \"a\" # a name\nrate_hz = 100.0\n{files}[services]\n{services}"
        );
        let other = format!(
            "# The same.\n{files}[services]\n{services}\n[graph]\nrate_hz = 1e2\nseed = 1\n\
             name = 'a'\n"
        );
        assert_eq!(hash(&read(&one)), hash(&read(&other)));
    }

    #[test]
    fn the_name_of_a_type_does_not_matter() {
        #[derive(Serialize)]
        struct One {
            x: f64,
        }
        #[derive(Serialize)]
        struct Other {
            x: f64,
        }
        assert_eq!(hash(&One { x: 0.5 }), hash(&Other { x: 0.5 }));
        assert_ne!(hash(&One { x: 0.5 }), hash(&One { x: 0.25 }));
    }

    /// JSON pointers to all values below `value`.
    fn leaves(value: &Value, pointer: &str, found: &mut Vec<String>) {
        match value {
            Value::Object(map) => {
                for (key, inner) in map {
                    leaves(inner, &format!("{pointer}/{key}"), found);
                }
            }
            Value::Array(items) => {
                for (i, inner) in items.iter().enumerate() {
                    leaves(inner, &format!("{pointer}/{i}"), found);
                }
            }
            _ => found.push(pointer.to_owned()),
        }
    }

    #[test]
    fn each_value_matters() {
        let file = read(include_str!("../../../config/corridor-people.toml"));
        let whole = serde_json::to_value(&file).unwrap();
        let mut pointers = Vec::new();
        leaves(&whole, "", &mut pointers);
        assert!(pointers.len() > 80, "{}", pointers.len());
        for pointer in pointers {
            let mut changed = whole.clone();
            let value = changed.pointer_mut(&pointer).unwrap();
            *value = match &*value {
                Value::Number(number) => json!(number.as_f64().unwrap() + 0.125),
                Value::Bool(is_set) => json!(!is_set),
                Value::String(text) => json!(format!("{text}x")),
                _ => json!("given"),
            };
            assert_ne!(hash(&changed), hash(&whole), "{pointer}");
        }
    }
}

//! JSON Schemas of what commands print with `--json`: each program has a table of its own.

use std::fs;
use std::path::Path;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde_json::Value;

use crate::ending::CommandError;
use crate::output;

/// A command that prints JSON, and the schema of that.
#[derive(Debug, Clone, Copy)]
pub struct CommandSchema {
    /// The command, the words of its name joined by dashes; it is the name of the file, too.
    pub name: &'static str,
    make: fn() -> Schema,
}

impl CommandSchema {
    /// Of a command that prints a `T`.
    #[must_use]
    pub const fn new<T: JsonSchema>(name: &'static str) -> Self {
        Self {
            name,
            make: schema_of::<T>,
        }
    }

    /// The schema as text.
    ///
    /// # Errors
    /// None that a schema can bring about; the type asks for it.
    pub fn text(&self) -> Result<String, CommandError> {
        let text = serde_json::to_string_pretty(&(self.make)()).map_err(CommandError::failure)?;
        Ok(text + "\n")
    }

    /// The keys, at any depth, that say nothing of their meaning. For tests.
    #[must_use]
    pub fn unexplained_keys(&self) -> Vec<String> {
        let mut found = Vec::new();
        note_unexplained((self.make)().as_value(), self.name, &mut found);
        found
    }
}

/// A key that is always printed is required, even if it may be null.
fn schema_of<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    settings.into_generator().into_root_schema_for::<T>()
}

fn note_unexplained(value: &Value, at: &str, found: &mut Vec<String>) {
    if let Some(properties) = value["properties"].as_object() {
        for (name, property) in properties {
            let is_explained = ["description", "$ref"]
                .iter()
                .any(|key| property.get(key).is_some());
            if !is_explained {
                found.push(format!("{at}.{name}"));
            }
        }
    }
    match value {
        Value::Object(object) => {
            let children = object.iter();
            children
                .for_each(|(key, child)| note_unexplained(child, &format!("{at}.{key}"), found));
        }
        Value::Array(items) => items.iter().for_each(|it| note_unexplained(it, at, found)),
        _ => {}
    }
}

/// Prints the schema of a command of `table`.
///
/// # Errors
/// A command without one, with the `names` that have one; output that cannot be written.
pub fn print(table: &[CommandSchema], command: &str, names: &[&str]) -> Result<(), CommandError> {
    let found = table.iter().find(|schema| schema.name == command);
    let found = found.ok_or_else(|| {
        let names = names.join(", ");
        CommandError::usage(format!("'{command}' has no schema; there are: {names}"))
    })?;
    output::line(found.text()?.trim_end()).map_err(CommandError::failure)
}

/// Prints names of commands, one a line.
///
/// # Errors
/// Output that cannot be written.
pub fn list(names: &[&str]) -> Result<(), CommandError> {
    output::line(&names.join("\n")).map_err(CommandError::failure)
}

/// Writes every schema of `table` as a file into a folder.
///
/// # Errors
/// The folder's name and the system's.
pub fn write(table: &[CommandSchema], folder: &Path) -> Result<(), CommandError> {
    let failed = |error| CommandError::failure(format!("{}: {error}", folder.display()));
    fs::create_dir_all(folder).map_err(failed)?;
    for schema in table {
        let path = folder.join(format!("{}.json", schema.name));
        fs::write(path, schema.text()?).map_err(failed)?;
    }
    Ok(())
}

/// The commands of `table` whose file in a folder is another than their schema. For tests.
#[must_use]
pub fn outdated(table: &[CommandSchema], folder: &Path) -> Vec<&'static str> {
    let is_outdated = |schema: &&CommandSchema| {
        let path = folder.join(format!("{}.json", schema.name));
        fs::read_to_string(path).ok() != schema.text().ok()
    };
    let outdated = table.iter().filter(is_outdated);
    outdated.map(|schema| schema.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A document.
    #[derive(JsonSchema)]
    #[expect(dead_code, reason = "only its schema is looked at")]
    struct Document {
        /// Printed in any case.
        always: Option<u32>,
        inner: Vec<Inner>,
    }

    /// Part of it.
    #[derive(JsonSchema)]
    #[expect(dead_code, reason = "only its schema is looked at")]
    struct Inner {
        silent: u32,
        /// Explained.
        explained: u32,
    }

    const TABLE: [CommandSchema; 1] = [CommandSchema::new::<Document>("command")];

    #[test]
    fn keys_without_a_meaning_are_found_at_any_depth() {
        let mut found = TABLE[0].unexplained_keys();
        found.sort();
        assert_eq!(found, ["command.$defs.Inner.silent", "command.inner"]);
    }

    #[test]
    fn what_may_be_null_is_printed_and_required() {
        let schema: Value = serde_json::from_str(&TABLE[0].text().unwrap()).unwrap();
        assert_eq!(schema["required"], serde_json::json!(["always", "inner"]));
    }

    #[test]
    fn an_outdated_file_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("schemas");
        assert_eq!(outdated(&TABLE, &folder), ["command"]);
        write(&TABLE, &folder).unwrap();
        assert_eq!(outdated(&TABLE, &folder), [""; 0]);
        fs::write(folder.join("command.json"), "{}").unwrap();
        assert_eq!(outdated(&TABLE, &folder), ["command"]);
    }
}

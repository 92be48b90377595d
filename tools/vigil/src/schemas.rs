//! `vigil schema`: what the JSON documents of the commands hold.

use std::path::PathBuf;

use schemars::{Schema, SchemaGenerator};
use vigil_launcher::Summary;
use vigil_terminal::{CommandError, Outcome, output};
use vigil_timeline::TimelineEntry;

use crate::{check, check_publisher, config, faults, list, record, recordings, status};

/// Prints the JSON Schema of what a command prints with --json.
///
/// `events` and `faults --follow` print a document a line. The schemas lie in docs/schemas, too.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The command; without one, list those that have a schema.
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
    /// Write all of them as files to this folder.
    #[arg(long, value_name = "FOLDER", conflicts_with = "command")]
    out: Option<PathBuf>,
}

/// Makes a schema, from the type that a command prints.
type Make = fn() -> Schema;

fn schema_of<T: schemars::JsonSchema>() -> Schema {
    SchemaGenerator::default().into_root_schema_for::<T>()
}

/// The commands that print JSON, each with its schema.
const SCHEMAS: [(&str, Make); 10] = [
    ("run", schema_of::<Summary>),
    ("list", schema_of::<list::Document>),
    ("status", schema_of::<status::Document>),
    ("events", schema_of::<TimelineEntry>),
    ("faults", schema_of::<faults::Document>),
    ("check", schema_of::<check::Document<'_>>),
    (
        "check-publisher",
        schema_of::<check_publisher::Document<'_>>,
    ),
    ("config", schema_of::<config::Effective<'_>>),
    ("record", schema_of::<record::Document>),
    ("recordings", schema_of::<recordings::Document>),
];

/// Prints or writes schemas.
///
/// # Errors
/// A command without one; output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if let Some(folder) = &args.out {
        let failed = |error| CommandError::failure(format!("{}: {error}", folder.display()));
        std::fs::create_dir_all(folder).map_err(failed)?;
        for (name, make) in SCHEMAS {
            let path = folder.join(format!("{name}.json"));
            std::fs::write(path, text(make)?).map_err(failed)?;
        }
        return Ok(Outcome::Done);
    }
    let names = SCHEMAS.map(|(name, _)| name);
    let text = match &args.command {
        None => names.join("\n"),
        Some(command) => {
            let found = SCHEMAS.iter().find(|(name, _)| name == command);
            let (_, make) = found.ok_or_else(|| {
                let names = names.join(", ");
                CommandError::usage(format!("'{command}' has no schema; there are: {names}"))
            })?;
            text(*make)?
        }
    };
    output::line(text.trim_end()).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

fn text(make: Make) -> Result<String, CommandError> {
    let text = serde_json::to_string_pretty(&make()).map_err(CommandError::failure)?;
    Ok(text + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::path::Path;

    #[test]
    fn the_published_schemas_are_up_to_date() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
        for (name, make) in SCHEMAS {
            let path = folder.join(format!("{name}.json"));
            let published = std::fs::read_to_string(path).unwrap_or_default();
            let hint = "write them anew: target/debug/vigil schema --out docs/schemas";
            assert!(published == text(make).unwrap(), "{name}: {hint}");
        }
        assert_eq!(std::fs::read_dir(folder).unwrap().count(), SCHEMAS.len());
    }

    /// The properties of a schema, at any depth, that say nothing of their meaning.
    fn unexplained(value: &Value, at: &str, found: &mut Vec<String>) {
        if let Some(properties) = value["properties"].as_object() {
            for (name, property) in properties {
                let is_referred = property.get("$ref").is_some();
                if property.get("description").is_none() && !is_referred {
                    found.push(format!("{at}.{name}"));
                }
            }
        }
        match value {
            Value::Object(object) => {
                let children = object.iter();
                children.for_each(|(key, child)| unexplained(child, &format!("{at}.{key}"), found));
            }
            Value::Array(items) => items.iter().for_each(|item| unexplained(item, at, found)),
            _ => {}
        }
    }

    #[test]
    fn every_key_says_what_it_means() {
        let mut found = Vec::new();
        for (name, make) in SCHEMAS {
            unexplained(&serde_json::to_value(make()).unwrap(), name, &mut found);
        }
        assert_eq!(found, [""; 0]);
    }
}

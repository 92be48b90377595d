//! `vigil schema`: what the JSON documents of the commands hold.

use std::ffi::OsStr;
use std::path::PathBuf;

use vigil_blackbox::RecordDocument;
use vigil_launcher::Summary;
use vigil_terminal::schema::{self, CommandSchema};
use vigil_terminal::{CommandError, Outcome};
use vigil_timeline::TimelineEntry;

use crate::{check, check_publisher, config, faults, laboratory, list, record, recordings, status};

/// Prints the JSON Schema of what a command prints with --json.
///
/// `events` and `faults --follow` print a document a line. The words of a command's name are joined
/// by dashes: `pomdp-solve`. The schemas lie in docs/schemas, too.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The command; without one, list those that have a schema.
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
    /// Write all of them as files to this folder.
    #[arg(short, long, value_name = "FOLDER", conflicts_with = "command")]
    out: Option<PathBuf>,
}

/// The documents that commands of this program print, each with its schema.
const SCHEMAS: [CommandSchema; 11] = [
    CommandSchema::new::<Summary>("run"),
    CommandSchema::new::<list::Document>("list"),
    CommandSchema::new::<status::Document>("status"),
    CommandSchema::new::<TimelineEntry>("events"),
    CommandSchema::new::<faults::Document>("faults"),
    CommandSchema::new::<check::Document<'_>>("check"),
    CommandSchema::new::<check_publisher::Document<'_>>("check-publisher"),
    CommandSchema::new::<config::Effective<'_>>("config"),
    CommandSchema::new::<record::Document>("record"),
    CommandSchema::new::<RecordDocument>("record-mcap"),
    CommandSchema::new::<recordings::Document>("recordings"),
];

/// Those of this program and of the laboratory.
fn names() -> Vec<&'static str> {
    let own = SCHEMAS.iter().map(|schema| schema.name);
    own.chain(laboratory::SCHEMAS).collect()
}

/// Prints or writes schemas; those of the laboratory it has its program print or write.
///
/// # Errors
/// A command without one; output that cannot be written; a laboratory that is not built.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if let Some(folder) = &args.out {
        schema::write(&SCHEMAS, folder)?;
        let words = ["schema".as_ref(), "--out".as_ref(), folder.as_os_str()];
        return laboratory::start(&words.map(OsStr::to_owned));
    }
    match &args.command {
        Some(command) if laboratory::SCHEMAS.contains(&command.as_str()) => {
            return laboratory::start(&["schema", command].map(Into::into));
        }
        Some(command) => schema::print(&SCHEMAS, command, &names())?,
        None => schema::list(&names())?,
    }
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn folder() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas")
    }

    #[test]
    fn the_published_schemas_are_up_to_date() {
        let hint = "write them anew: target/debug/vigil schema --out docs/schemas";
        assert_eq!(schema::outdated(&SCHEMAS, &folder()), [""; 0], "{hint}");
    }

    #[test]
    fn every_published_schema_is_of_a_command_of_this_program_or_of_the_laboratory() {
        let files = std::fs::read_dir(folder()).unwrap();
        let files = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        let mut files: Vec<String> = files.collect();
        files.sort();
        let mut wanted: Vec<String> = names().iter().map(|name| format!("{name}.json")).collect();
        wanted.sort();
        assert_eq!(files, wanted);
    }

    #[test]
    fn every_key_says_what_it_means() {
        let unexplained = SCHEMAS.iter().flat_map(CommandSchema::unexplained_keys);
        assert_eq!(unexplained.collect::<Vec<_>>(), [""; 0]);
    }
}

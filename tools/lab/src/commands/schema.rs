//! `vigil schema`, for the documents of the laboratory's commands.

use std::path::PathBuf;

use vigil_learning::{channel_learning, learning};
use vigil_terminal::schema::{self, CommandSchema};
use vigil_terminal::{CommandError, Outcome};

use super::{evaluate, frames, import, init, learn, learn_channels, pomdp, replay};

/// Prints the JSON Schema of what a command of the laboratory prints with --json.
///
/// `vigil schema` knows those of every command. The words of a name are joined by dashes.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The command; without one, list those that have a schema.
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
    /// Write all of them as files to this folder.
    #[arg(short, long, value_name = "FOLDER", conflicts_with = "command")]
    out: Option<PathBuf>,
}

/// The documents, each with its schema. What one command prints in several forms has several names.
const SCHEMAS: [CommandSchema; 20] = [
    CommandSchema::new::<init::Document>("init"),
    CommandSchema::new::<import::Document>("import"),
    CommandSchema::new::<import::look::Document>("import-look"),
    CommandSchema::new::<import::suggest::Document>("import-suggest"),
    CommandSchema::new::<frames::Document>("frames"),
    CommandSchema::new::<learn::Document<'_>>("learn"),
    CommandSchema::new::<learn_channels::Document<'_>>("learn-channels"),
    CommandSchema::new::<learn::ShownModel<'_, learning::View>>("learn-show"),
    CommandSchema::new::<learn::ShownModel<'_, channel_learning::View>>("learn-show-channels"),
    CommandSchema::new::<evaluate::Document<'_>>("evaluate"),
    CommandSchema::new::<replay::Document>("replay"),
    CommandSchema::new::<pomdp::compare::Document<'_>>("pomdp-compare"),
    CommandSchema::new::<pomdp::convert::Document>("pomdp-convert"),
    CommandSchema::new::<pomdp::fit::Document>("pomdp-fit"),
    CommandSchema::new::<pomdp::info::Document>("pomdp-info"),
    CommandSchema::new::<pomdp::learn::Document>("pomdp-learn"),
    CommandSchema::new::<pomdp::missions::Document>("pomdp-missions"),
    CommandSchema::new::<pomdp::solve::Document>("pomdp-solve"),
    CommandSchema::new::<pomdp::track::Document>("pomdp-track"),
    CommandSchema::new::<pomdp::value::Document>("pomdp-value"),
];

/// Prints or writes schemas.
///
/// # Errors
/// A command without one; output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let names = SCHEMAS.map(|schema| schema.name);
    match (&args.out, &args.command) {
        (Some(folder), _) => schema::write(&SCHEMAS, folder)?,
        (None, None) => schema::list(&names)?,
        (None, Some(command)) => schema::print(&SCHEMAS, command, &names)?,
    }
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_published_schemas_are_up_to_date() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
        let hint = "write them anew: target/debug/vigil schema --out docs/schemas";
        assert_eq!(schema::outdated(&SCHEMAS, &folder), [""; 0], "{hint}");
    }

    #[test]
    fn every_key_says_what_it_means() {
        let unexplained = SCHEMAS.iter().flat_map(CommandSchema::unexplained_keys);
        assert_eq!(unexplained.collect::<Vec<_>>(), [""; 0]);
    }
}

//! `vigil config`: the keys of a graph file, or the values that one means.

use serde::Serialize;
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{GraphArgs, reference, schema};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Version of the JSON document.
const SCHEMA_VERSION: u32 = 1;

/// Prints the values of a graph file with all defaults and options, or what its keys mean.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    #[command(flatten)]
    form: Form,
    /// Print one JSON document instead of TOML.
    #[arg(long, conflicts_with = "reference")]
    json: bool,
}

/// What to print.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct Form {
    /// Print the values in effect, as TOML; the default.
    #[arg(long)]
    effective: bool,
    /// Print the JSON Schema of graph files.
    #[arg(long)]
    schema: bool,
    /// Print the reference page of all keys, as Markdown.
    #[arg(long)]
    reference: bool,
}

/// The values in effect.
#[derive(Debug, Serialize)]
struct Effective<'a> {
    schema_version: u32,
    path: String,
    config_hash: String,
    config: &'a GraphFile,
}

/// Prints it.
///
/// # Errors
/// What is wrong with the configuration; standard output's.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let printed = if args.form.schema {
        output::json(&schema())
    } else if args.form.reference {
        output::line(reference().trim_end())
    } else {
        let setup = args.graph.load().map_err(CommandError::usage)?;
        if args.json {
            output::json(&Effective {
                schema_version: SCHEMA_VERSION,
                path: setup.path.display().to_string(),
                config_hash: format!("{:016x}", setup.hash),
                config: &setup.file,
            })
        } else {
            let text = toml::to_string(&setup.file).map_err(CommandError::failure)?;
            output::line(text.trim_end())
        }
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

//! `vigil config`: the keys of a graph file, or the values that one means.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{Document, GraphArgs, reference, robot_reference, schema};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Version of the JSON document.
const SCHEMA_VERSION: u32 = 1;

/// Prints the values of a graph file with all defaults and options, or what its keys mean.
///
/// Of each value it says where it comes from: a line of the file, an option, or the default.
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
    /// Print the reference page of all keys, as Markdown; left out: of graph files.
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "graph")]
    reference: Option<File>,
}

/// What is described.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum File {
    /// Graph files.
    Graph,
    /// Descriptions of robots.
    Robot,
}

/// The values in effect.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Effective<'a> {
    /// Version of this document.
    schema_version: u32,
    /// The graph file.
    path: String,
    /// Hash of the configuration and every file that it names.
    config_hash: String,
    /// The values in effect; see `vigil config --schema`.
    config: &'a GraphFile,
    /// Of each key: `default`, `line N` of the file, or the option that gave it.
    origin: BTreeMap<String, String>,
}

/// Prints it.
///
/// # Errors
/// What is wrong with the configuration; standard output's.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let printed = if args.form.schema {
        output::json(&schema())
    } else if let Some(file) = args.form.reference {
        let page = match file {
            File::Graph => reference(),
            File::Robot => robot_reference(),
        };
        output::line(page.trim_end())
    } else {
        let document = args.graph.read().map_err(CommandError::usage)?;
        let setup = document.check().map_err(CommandError::usage)?;
        let text = toml::to_string(&setup.file).map_err(CommandError::failure)?;
        if args.json {
            output::json(&Effective {
                schema_version: SCHEMA_VERSION,
                path: setup.path.display().to_string(),
                config_hash: format!("{:016x}", setup.hash),
                config: &setup.file,
                origin: origins(&text, &document),
            })
        } else {
            output::line(&with_origins(&text, &document))
        }
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// Column at which the origins begin.
const ORIGIN_COLUMN: usize = 44;

/// The lines of a TOML text without arrays over several lines, each with the key that it gives.
fn with_keys(text: &str) -> Vec<(&str, Option<String>)> {
    let (mut table, mut tables) = (String::new(), BTreeMap::<String, usize>::new());
    let mut lines = Vec::new();
    for line in text.lines() {
        let mut key = None;
        if let Some(name) = line.strip_prefix("[[").and_then(|l| l.strip_suffix("]]")) {
            let count = tables.entry(name.to_owned()).or_default();
            table = format!("{name}.{count}.");
            *count += 1;
        } else if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            table = format!("{name}.");
        } else if let Some((name, _)) = line.split_once(" = ") {
            key = Some(format!("{table}{name}"));
        }
        lines.push((line, key));
    }
    lines
}

/// The text, and at each value where it comes from.
fn with_origins(text: &str, document: &Document) -> String {
    let lines = with_keys(text).into_iter().map(|(line, key)| match key {
        Some(key) => format!("{line:<ORIGIN_COLUMN$} # {}", document.origin(&key)),
        None => line.to_owned(),
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn origins(text: &str, document: &Document) -> BTreeMap<String, String> {
    let keys = with_keys(text).into_iter().filter_map(|(_, key)| key);
    let with_origin = |key: String| {
        let origin = document.origin(&key).to_string();
        (key, origin)
    };
    keys.map(with_origin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_says_where_it_comes_from() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let args = GraphArgs {
            config: format!("{root}/config/rover.toml").into(),
            rate: Some(50.0),
            ..GraphArgs::default()
        };
        let document = args.read().unwrap();
        let text = toml::to_string(&document.file).unwrap();
        let shown = with_origins(&text, &document);
        // A comment is no value.
        assert_eq!(toml::from_str::<GraphFile>(&shown).unwrap(), document.file);
        let origins = origins(&text, &document);
        let file = std::fs::read_to_string(&args.config).unwrap();
        let name = file.lines().position(|line| line.starts_with("name = "));
        let line = format!("line {}", name.unwrap() + 1);
        let origin = |key: &str| origins[key].as_str();
        assert_eq!(origin("graph.rate_hz"), "--rate");
        assert_eq!(origin("graph.name"), line);
        assert_eq!(origin("services.detector.spin_us"), "default");
    }

    #[test]
    fn keys_of_repeated_tables_are_counted() {
        let text = "a = 1\n[b]\nc = 2\n[[d]]\ne = 3\n[[d]]\ne = 4";
        let keys = with_keys(text).into_iter().filter_map(|(_, key)| key);
        assert_eq!(keys.collect::<Vec<_>>(), ["a", "b.c", "d.0.e", "d.1.e"]);
    }
}

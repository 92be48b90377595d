//! `vigil recordings`: what the black box of a graph has written.

use std::fs;
use std::iter;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_flight::is_being_written;
use vigil_setup::{NotRunning, RunningArgs, load_graph};
use vigil_terminal::{CommandError, Outcome, output};
use vigil_timeline::unix_time_of_day;

/// Lists the recordings that the black box of a graph has written, the newest last.
///
/// Of a graph that does not run, they are looked for where its graph file says.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Graph file (TOML) of a graph that does not run.
    #[arg(
        long,
        value_name = "FILE",
        env = "VIGIL_CONFIG",
        hide_env_values = true,
        default_value = "config/rover.toml"
    )]
    config: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Name of the graph.
    graph: String,
    /// Where they lie.
    folder: String,
    /// The recordings, the newest last.
    recordings: Vec<ListedRecording>,
}

/// A recording.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct ListedRecording {
    /// Name of the file; it holds graph, time (UTC) and reason.
    name: String,
    /// Its size.
    bytes: u64,
    /// When it was written last, since 1970.
    written_unix_s: f64,
    /// True if it is being written.
    is_being_written: bool,
}

/// Prints them.
///
/// # Errors
/// A graph that runs without a black box; one that does not run, and of which there is no folder.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let (graph, folder) = match args.running.find() {
        Ok(running) => {
            let graph = running.domain.graph().to_owned();
            let folder = fs::read_to_string(running.domain.recordings_file()).map_err(|_| {
                CommandError::failure(format!("graph '{graph}' has no black box, or not yet"))
            })?;
            (graph, PathBuf::from(folder))
        }
        Err(why @ (NotRunning::None | NotRunning::Unknown { .. })) => find(args, &why)?,
        Err(error) => return Err(CommandError::failure(error)),
    };
    let document = Document {
        schema_version: 1,
        recordings: listed(&folder, &graph),
        graph,
        folder: folder.display().to_string(),
    };
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    if !args.json && !document.recordings.is_empty() {
        eprintln!("`vigil report FILE --out page.html` writes a page about one");
    }
    Ok(Outcome::Done)
}

/// Name and folder of a graph that does not run, for this reason.
fn find(args: &Args, why: &NotRunning) -> Result<(String, PathBuf), CommandError> {
    let config = args.config.display();
    let setup = load_graph(&args.config, |_| {})
        .map_err(|error| CommandError::failure(format!("{why}; {config}: {error}")))?;
    let graph = args.running.graph.as_ref();
    let graph = graph.unwrap_or(&setup.file.graph.name).clone();
    let candidates = setup.file.blackbox.folders(&setup.path, &graph);
    let mut there = candidates.iter().filter(|folder| folder.is_dir());
    let has_any = |folder: &&PathBuf| !listed(folder, &graph).is_empty();
    let with_any = there.clone().find(has_any);
    let found = with_any.or_else(|| there.next()).cloned();
    let found = found.ok_or_else(|| {
        let names: Vec<String> = candidates
            .iter()
            .map(|it| it.display().to_string())
            .collect();
        CommandError::failure(format!(
            "{why}; of graph '{graph}' there are no recordings: none of these is a folder: {}",
            names.join(", ")
        ))
    })?;
    Ok((graph, found))
}

fn listed(folder: &Path, graph: &str) -> Vec<ListedRecording> {
    let begin = format!("{graph}-");
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let recordings = entries.filter_map(|entry| {
        let (name, metadata) = (
            entry.file_name().into_string().ok()?,
            entry.metadata().ok()?,
        );
        let is_part = name.ends_with(".mcap.part");
        let is_ours = name.starts_with(&begin) && (is_part || name.ends_with(".mcap"));
        let written = metadata.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        is_ours.then_some(ListedRecording {
            name,
            bytes: metadata.len(),
            written_unix_s: written.as_secs_f64(),
            is_being_written: is_part && is_being_written(&entry.path()),
        })
    });
    let mut recordings: Vec<ListedRecording> = recordings.collect();
    recordings.sort_by(|a, b| a.written_unix_s.total_cmp(&b.written_unix_s));
    recordings
}

fn text(document: &Document) -> String {
    if document.recordings.is_empty() {
        return format!("no recordings in {}", document.folder);
    }
    let head = "written         size  recording; its name holds the time in UTC, and the reason";
    let lines = document.recordings.iter().map(|recording| {
        let mib = recording.bytes as f64 / f64::from(1 << 20);
        let time = unix_time_of_day(recording.written_unix_s);
        let time = time.split('.').next().unwrap_or_default();
        let state = match recording.is_being_written {
            true => "  is being written",
            false => "",
        };
        let path = Path::new(&document.folder).join(&recording.name);
        format!("{time}  {mib:7.1} MiB  {}{state}", path.display())
    });
    let lines = iter::once(head.to_owned()).chain(lines);
    lines.collect::<Vec<String>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_graphs_own_recordings_are_listed_and_the_one_under_way_is_marked() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            "rover-1-alarm.mcap",
            "other-1-alarm.mcap",
            "rover.txt",
            "rover-2-crash.mcap.part",
        ] {
            fs::write(folder.path().join(name), [0; 1 << 20]).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        let begun = fs::File::open(folder.path().join("rover-2-crash.mcap.part")).unwrap();
        assert!(
            !listed(folder.path(), "rover")[1].is_being_written,
            "it was left"
        );
        begun.lock().unwrap();
        let recordings = listed(folder.path(), "rover");
        let names: Vec<_> = recordings.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["rover-1-alarm.mcap", "rover-2-crash.mcap.part"]);
        let document = Document {
            schema_version: 1,
            graph: "rover".to_owned(),
            folder: "f".to_owned(),
            recordings,
        };
        let text = text(&document);
        assert!(text.contains("1.0 MiB  f/rover-1-alarm.mcap\n"), "{text}");
        let marked = "rover-2-crash.mcap.part  is being written";
        assert!(text.ends_with(marked), "{text}");
    }
}

//! A recording of a running graph, written by the program of its black box.

use std::convert::Infallible;
use std::ffi::OsString;
use std::path::Path;

use vigil_flight::part_path;
use vigil_setup::RunningArgs;
use vigil_terminal::CommandError;

use super::Args;
use crate::beside;

/// Options that mean something to frames alone.
const OF_FRAMES: [&str; 9] = [
    "--config",
    "--rate",
    "--seed",
    "--identifier",
    "--source",
    "--socket",
    "--replay",
    "--runs",
    "--speed",
];

/// True for the name of a recording.
pub fn is_meant(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "mcap")
}

/// Becomes the program that records.
///
/// # Errors
/// A graph that does not run, an option about frames, a file that is there, a folder that is not.
pub fn record(args: &Args) -> Result<Infallible, CommandError> {
    if let Some(option) = option_of_frames(std::env::args_os()) {
        let message = format!("{option} goes with frames (CSV) only, not with a recording (.mcap)");
        return Err(CommandError::usage(message));
    }
    let graph = args.graph.graph.clone();
    let running = RunningArgs { graph }
        .find()
        .map_err(CommandError::failure)?;
    let path = args.path();
    demand_room(path, args.force)?;
    let graph = running.domain.graph();
    if !args.json {
        eprintln!("recording graph '{graph}'; end with Ctrl-C");
    }
    let mut words: Vec<OsString> = vec!["--graph".into(), graph.into()];
    words.extend(["--record".into(), path.into()]);
    if let Some(seconds) = args.duration {
        words.extend(["--duration".into(), seconds.to_string().into()]);
    }
    words.extend(args.json.then(|| "--json".into()));
    let program = beside::Program {
        name: "vigil-blackbox",
        build: "-p vigil-blackbox",
    };
    beside::become_program(program, words)
}

/// The first option among these words that means something to frames alone.
fn option_of_frames(words: impl IntoIterator<Item = OsString>) -> Option<&'static str> {
    words.into_iter().find_map(|word| {
        let word = word.to_string_lossy();
        let name = word.split('=').next().unwrap_or_default();
        OF_FRAMES.into_iter().find(|option| *option == name)
    })
}

/// Refuses a file that is there, whole or begun, and a folder that is not.
fn demand_room(path: &Path, is_forced: bool) -> Result<(), CommandError> {
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let message = format!("{} is no folder", folder.display());
        return Err(CommandError::usage(message));
    }
    let part = part_path(path);
    let there = [path, &part].into_iter().find(|file| file.exists());
    match there {
        Some(file) if !is_forced => {
            let message = format!("{} exists; --force replaces it", file.display());
            Err(CommandError::usage(message))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_about_frames_are_found_by_name() {
        let found = |words: &[&str]| option_of_frames(words.iter().map(OsString::from));
        assert_eq!(found(&["record", "a.mcap", "--rate=5"]), Some("--rate"));
        let own = [
            "record",
            "a.mcap",
            "--graph",
            "b",
            "--duration",
            "2",
            "--force",
            "--json",
        ];
        assert_eq!(found(&own), None);
    }

    #[test]
    fn nothing_is_written_over_what_is_there_and_no_folder_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        assert!(is_meant(&path) && !is_meant(Path::new("mcap")));
        assert_eq!(demand_room(&path, false), Ok(()));
        std::fs::write(folder.path().join("a.mcap.part"), "").unwrap();
        let error = demand_room(&path, false).unwrap_err().to_string();
        assert!(
            error.ends_with("a.mcap.part exists; --force replaces it"),
            "{error}"
        );
        assert_eq!(demand_room(&path, true), Ok(()));
        let error = demand_room(&folder.path().join("b/a.mcap"), true);
        assert!(error.unwrap_err().to_string().ends_with("b is no folder"));
    }
}

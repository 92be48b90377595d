//! `vigil import --suggest`: a first description of a log and of its robot.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_import as import;
use vigil_terminal::{CommandError, Outcome, output};

use crate::commands::files::{check_place, write_whole};

/// What `import --suggest` prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the written description of the log.
    log: String,
    /// Path of the written description of the robot.
    robot: String,
    /// Folder of the log, as `import --from` takes it.
    from: String,
    /// What was guessed or left out, a sentence each: to be checked by hand.
    unsure: Vec<String>,
}

/// Writes `<stem>-log.toml` and `<stem>-robot.toml`, and says what is uncertain.
///
/// # Errors
/// A log that cannot be read or understood; files that cannot be written.
pub fn run(path: &Path, stem: &Path, is_json: bool) -> Result<Outcome, CommandError> {
    let name = stem.file_name().unwrap_or_default().to_string_lossy();
    if name.is_empty() {
        return Err(CommandError::usage(
            "--out needs the beginning of the files' names",
        ));
    }
    let file = |end: &str| -> PathBuf { stem.with_file_name(format!("{name}-{end}.toml")) };
    let (log_file, robot_file) = (file("log"), file("robot"));
    for file in [&log_file, &robot_file] {
        check_place("--out", file)?;
        if file.exists() {
            let message = format!("{} exists: nothing was written over it", file.display());
            return Err(CommandError::usage(message));
        }
    }
    let suggestion = import::suggest(path, &name, &format!("{name}-robot.toml"));
    let suggestion = suggestion.map_err(CommandError::usage)?;
    write_whole(&log_file, &suggestion.log)?;
    write_whole(&robot_file, &suggestion.robot)?;
    let document = Document {
        schema_version: 1,
        log: log_file.display().to_string(),
        robot: robot_file.display().to_string(),
        from: suggestion.folder.display().to_string(),
        unsure: suggestion.unsure,
    };
    let printed = match is_json {
        true => output::json(&document),
        false => output::line(&text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

fn text(document: &Document) -> String {
    let mut lines = vec![
        format!("robot: {}", document.robot),
        format!("log:   {}", document.log),
    ];
    lines.extend(document.unsure.iter().map(|line| format!("unsure: {line}")));
    lines.push(format!(
        "correct both, then: vigil import --log {} --from {} --out frames.csv.gz",
        document.log, document.from
    ));
    lines.join("\n")
}

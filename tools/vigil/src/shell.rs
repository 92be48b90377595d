//! `vigil completions` and `vigil man`: what a shell and `man` read, of the commands of this
//! program and of those that it starts.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use clap::Command;
use vigil_terminal::{CommandError, Outcome, output};

use crate::{beside, laboratory, ros2};

/// Prints completions for a shell.
///
/// Of bash: `vigil completions bash > /etc/bash_completion.d/vigil`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_name = "SHELL")]
    shell: clap_complete::Shell,
}

/// Writes a man page for each command.
#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Folder for the pages, such as /usr/local/share/man/man1.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Prints completions for `program`.
///
/// # Errors
/// Output that cannot be written.
pub fn completions(args: &CompletionsArgs, program: Command) -> Result<Outcome, CommandError> {
    let mut program = with_others(program);
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut program, "vigil", &mut text);
    let text = String::from_utf8(text).map_err(CommandError::failure)?;
    output::line(text.trim_end()).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// Writes the pages of `program` and its commands.
///
/// # Errors
/// A folder that cannot be written to.
pub fn man(args: &ManArgs, program: Command) -> Result<Outcome, CommandError> {
    let folder = &args.folder;
    let failed = |error| CommandError::failure(format!("{}: {error}", folder.display()));
    std::fs::create_dir_all(folder).map_err(failed)?;
    let mut program = with_others(program);
    program.build();
    let count = write_pages(&program, folder).map_err(failed)?;
    eprintln!("wrote {count} pages to {}", folder.display());
    Ok(Outcome::Done)
}

/// Writes the page of a command and of those below it; how many these are.
fn write_pages(command: &Command, folder: &Path) -> io::Result<usize> {
    // The name with dashes, which `build` has put together.
    let name = command.get_display_name().unwrap_or("vigil");
    let mut page = File::create(folder.join(format!("{name}.1")))?;
    clap_mangen::Man::new(command.clone()).render(&mut page)?;
    let below = command.get_subcommands();
    let shown = below.filter(|it| !it.is_hide_set() && it.get_name() != "help");
    let pages = shown.map(|it| write_pages(it, folder));
    Ok(1 + pages.sum::<io::Result<usize>>()?)
}

/// The program with the commands of those that it starts. One that is not built is left out, and
/// that is said.
fn with_others(mut program: Command) -> Command {
    match beside::commands(laboratory::PROGRAM) {
        Ok(tree) => {
            let own: Vec<_> = program
                .get_subcommands()
                .map(|it| it.get_name().to_owned())
                .collect();
            let others = tree.commands().into_iter().map(|it| it.command());
            let others = others.filter(|it| !own.iter().any(|name| name == it.get_name()));
            program = program.subcommands(others.collect::<Vec<_>>());
        }
        Err(error) => eprintln!("the laboratory's commands are left out: {error}"),
    }
    match beside::commands(ros2::PROGRAM) {
        Ok(tree) => program.mut_subcommand("ros2", |_| tree.command().name("ros2")),
        Err(error) => {
            eprintln!("the options of ros2 are left out: {error}");
            program
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn every_command_has_a_page_that_names_its_options() {
        let folder = tempfile::tempdir().unwrap();
        let program = crate::Args::command();
        let commands: Vec<String> = program
            .get_subcommands()
            .map(|command| command.get_name().to_owned())
            .collect();
        let args = ManArgs {
            folder: folder.path().to_owned(),
        };
        assert_eq!(man(&args, program), Ok(Outcome::Done));
        for name in &commands {
            let path = folder.path().join(format!("vigil-{name}.1"));
            let page = std::fs::read_to_string(path).unwrap();
            let title = format!("vigil-{name}").replace('-', "\\-");
            assert!(page.contains(&title), "{title}: {page}");
        }
        let run = std::fs::read_to_string(folder.path().join("vigil-run.1")).unwrap();
        assert!(run.contains("\\-\\-start\\-timeout"), "{run}");
        assert!(folder.path().join("vigil.1").exists());
    }
}

//! `vigil completions` and `vigil man`: what a shell and `man` read.

use std::io::Write;
use std::path::PathBuf;

use clap::Command;
use vigil_terminal::{CommandError, Outcome, output};

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
pub fn completions(args: &CompletionsArgs, mut program: Command) -> Result<Outcome, CommandError> {
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
pub fn man(args: &ManArgs, mut program: Command) -> Result<Outcome, CommandError> {
    let folder = &args.folder;
    let failed = |error| CommandError::failure(format!("{}: {error}", folder.display()));
    std::fs::create_dir_all(folder).map_err(failed)?;
    program.build();
    let commands = program
        .get_subcommands()
        .filter(|command| !command.is_hide_set());
    let pages = std::iter::once(&program).chain(commands);
    let mut count = 0;
    for command in pages {
        // The name with dashes, which `build` has put together.
        let name = command.get_display_name().unwrap_or("vigil");
        let path = folder.join(format!("{name}.1"));
        let mut page = Vec::new();
        let man = clap_mangen::Man::new(command.clone());
        man.render(&mut page).map_err(failed)?;
        std::fs::File::create(path)
            .and_then(|mut file| file.write_all(&page))
            .map_err(failed)?;
        count += 1;
    }
    eprintln!("wrote {count} pages to {}", folder.display());
    Ok(Outcome::Done)
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

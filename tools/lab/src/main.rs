//! `vigil-lab`: what is done at the desk. `vigil COMMAND` starts it.

mod commands;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use vigil_terminal::{CommandError, CommandTree, Outcome, exit_code};

use commands::{
    diagnose, evaluate, frames, import, init, learn, mend, pomdp, replay, report, schema,
};

/// Learns models, imports logs, diagnoses and scores recorded runs, solves decision models.
///
/// Exit codes: 0 done, 1 the run found or had a failure, 2 usage or configuration error.
#[derive(Debug, Parser)]
#[command(version, bin_name = "vigil")]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Args),
    Import(import::Args),
    Frames(frames::Args),
    Learn(learn::Args),
    Diagnose(diagnose::Args),
    Evaluate(evaluate::Args),
    Report(report::Args),
    Replay(replay::Args),
    Mend(mend::Args),
    Pomdp(pomdp::Args),
    Schema(schema::Args),
}

fn main() -> ExitCode {
    if let Some(printed) = CommandTree::answer(Args::command()) {
        return exit_code(
            printed
                .map(|()| Outcome::Done)
                .map_err(CommandError::failure),
        );
    }
    exit_code(match Args::parse().command {
        Command::Init(args) => init::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Frames(args) => frames::run(&args),
        Command::Learn(args) => learn::run(&args),
        Command::Diagnose(args) => diagnose::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Mend(args) => mend::run(&args),
        Command::Pomdp(args) => pomdp::run(&args),
        Command::Schema(args) => schema::run(&args),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The arguments of a command and of those below it.
    fn arguments(command: &clap::Command) -> Vec<&clap::Arg> {
        let below = command.get_subcommands().flat_map(arguments);
        command.get_arguments().chain(below).collect()
    }

    /// Of a command and of those below it: its name, and the help of each of its options.
    fn helps(command: &clap::Command) -> Vec<String> {
        let below = command
            .get_subcommands()
            .filter(|it| it.get_name() != "help");
        let own = command.get_arguments().filter(|it| !it.is_hide_set());
        let own = own.map(|arg| {
            let help = arg.get_long_help().or(arg.get_help());
            let help = help.map(ToString::to_string);
            format!(
                "{} {arg} {help:?} {:?}",
                command.get_name(),
                arg.get_default_values()
            )
        });
        own.chain(below.flat_map(helps)).collect()
    }

    #[test]
    fn another_program_can_show_every_command_and_option() {
        let mut program = Args::command();
        program.build();
        let mut shown = CommandTree::new(&program).command();
        shown.build();
        let found = helps(&shown);
        let wanted: Vec<String> = helps(&program)
            .into_iter()
            .filter(|help| !help.contains(" --version ") && !help.contains(" --help "))
            .collect();
        assert!(wanted.len() > 100, "{}", wanted.len());
        for help in &wanted {
            assert!(found.contains(help), "{help} is not among {found:#?}");
        }
    }

    #[test]
    fn one_thing_has_one_name_in_every_command() {
        let program = Args::command();
        let all = arguments(&program);
        let outputs: Vec<_> = all.iter().filter(|it| it.get_id() == "out").collect();
        assert!(outputs.len() > 9);
        for output in outputs {
            assert_eq!(output.get_short(), Some('o'), "{output}");
        }
        let names = all.iter().filter_map(|it| it.get_value_names()).flatten();
        let others: Vec<_> = names
            .filter(|name| ["F", "OUT", "DIR"].contains(&name.as_str()))
            .collect();
        assert!(others.is_empty(), "a file is a FILE: {others:?}");
    }
}

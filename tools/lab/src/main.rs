//! `vigil-lab`: what is done at the desk. `vigil COMMAND` starts it.

mod commands;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use vigil_terminal::{CommandError, CommandTree, Outcome, exit_code};

use commands::{diagnose, evaluate, frames, import, init, learn, pomdp, replay, report, schema};

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

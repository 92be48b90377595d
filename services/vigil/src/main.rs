//! `vigil`: the operator's tool. Never in the data path of a running graph.

mod bindings;
mod commands;
mod findings;
mod output;
mod pipeline;
mod publisher;
mod recovery;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use commands::{
    Outcome, check, check_publisher, diagnose, evaluate, import, inject, learn, pomdp, print_types,
};

/// Fault detection, diagnosis and recovery for mobile robots.
///
/// Exit codes: 0 done, 1 the run found or had a failure, 2 usage or configuration error.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Import(import::Args),
    Learn(learn::Args),
    Diagnose(diagnose::Args),
    Evaluate(evaluate::Args),
    Inject(inject::Args),
    Check(check::Args),
    CheckPublisher(check_publisher::Args),
    Pomdp(pomdp::Args),
    #[command(name = "types")]
    PrintTypes(print_types::Args),
}

fn main() -> ExitCode {
    let result = match Args::parse().command {
        Command::Import(args) => import::run(&args),
        Command::Learn(args) => learn::run(&args),
        Command::Diagnose(args) => diagnose::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Inject(args) => inject::run(&args),
        Command::Check(args) => check::run(&args),
        Command::CheckPublisher(args) => check_publisher::run(&args),
        Command::Pomdp(args) => pomdp::run(&args),
        Command::PrintTypes(args) => print_types::run(&args),
    };
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(error.exit_code())
        }
    }
}

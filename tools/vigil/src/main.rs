//! `vigil`: the operator's tool. Never in the data path of a running graph.

mod beside;
mod bindings;
mod check;
mod check_publisher;
mod clipped;
mod command;
mod config;
mod events;
mod faults;
mod findings;
mod graph;
mod inject;
mod laboratory;
mod list;
mod print_channels;
mod print_types;
mod publisher;
mod record;
mod recordings;
mod ros2;
mod run;
mod schemas;
mod shell;
mod snapshot;
mod status;
mod stop;
mod top;
mod watch;

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::ExitCode;

use clap::{Arg, CommandFactory, Parser, Subcommand};
use vigil_launcher::LauncherArgs;
use vigil_terminal::{CommandError, Outcome, exit_code};

/// Fault detection, diagnosis and recovery for mobile robots.
///
/// A graph is what watches one robot: four services, their launcher and a black box. `vigil run`
/// starts one and stays with it; the other commands look at one that runs, or at what it has left.
///
/// Exit codes: 0 done, 1 the run found or had a failure, 2 usage or configuration error.
#[derive(Debug, Parser)]
#[command(version, after_help = laboratory::help(), disable_help_subcommand = true)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(Box<LauncherArgs>),
    List(list::Args),
    Status(status::Args),
    Top(top::Args),
    Stop(stop::Args),
    Events(events::Args),
    Faults(faults::Args),
    Ack(faults::AckArgs),
    Clear(faults::ClearArgs),
    Inject(inject::Args),
    Snapshot(snapshot::Args),
    Recordings(recordings::Args),
    Ros2(ros2::Args),
    Check(check::Args),
    #[command(mut_args(hide(NOTHING_TO_PUBLISHERS)))]
    CheckPublisher(check_publisher::Args),
    Config(config::Args),
    #[command(mut_args(hide(NOTHING_TO_A_DRAWING)))]
    Graph(graph::Args),
    #[command(mut_args(hide(NOTHING_TO_PUBLISHERS)))]
    Record(record::Args),
    #[command(name = "channels")]
    PrintChannels(print_channels::Args),
    #[command(name = "types")]
    PrintTypes(print_types::Args),
    Schema(schemas::Args),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
    /// A command of the laboratory.
    #[command(external_subcommand)]
    Laboratory(Vec<OsString>),
}

/// Options of a graph that say nothing of the frames that a publisher sends.
const NOTHING_TO_PUBLISHERS: &[&str] = &["seed", "identifier", "replay", "runs", "speed"];
/// Options of a graph that change nothing in a drawing of it.
const NOTHING_TO_A_DRAWING: &[&str] = &["seed", "identifier", "runs", "speed"];

/// Shows a command's options, but for these.
fn hide(ids: &'static [&'static str]) -> impl Fn(Arg) -> Arg {
    move |arg| {
        let is_hidden = ids.contains(&arg.get_id().as_str());
        arg.hide(is_hidden)
    }
}

/// Becomes the command of these words, asked for its help.
fn help(words: &[OsString]) -> Result<Outcome, CommandError> {
    let words = words.iter().cloned().chain(["--help".into()]);
    let program = std::env::current_exe().map_err(CommandError::failure)?;
    let error = std::process::Command::new(program).args(words).exec();
    Err(CommandError::failure(error))
}

fn main() -> ExitCode {
    exit_code(match Args::parse().command {
        // The launcher understands the same words once more.
        Command::Run(_) => run::run(),
        Command::List(args) => list::run(&args),
        Command::Status(args) => status::run(&args),
        Command::Top(args) => top::run(&args),
        Command::Stop(args) => stop::run(&args),
        Command::Events(args) => events::run(&args),
        Command::Graph(args) => graph::run(&args),
        Command::Check(args) => check::run(&args),
        Command::CheckPublisher(args) => check_publisher::run(&args),
        Command::Config(args) => config::run(&args),
        Command::Faults(args) => faults::run(&args),
        Command::Ack(args) => faults::acknowledge(&args),
        Command::Clear(args) => faults::clear(&args),
        Command::Inject(args) => inject::run(&args),
        Command::Snapshot(args) => snapshot::run(&args),
        Command::Recordings(args) => recordings::run(&args),
        Command::Ros2(args) => ros2::run(&args),
        Command::Record(args) => record::run(&args),
        Command::PrintChannels(args) => print_channels::run(&args),
        Command::PrintTypes(args) => print_types::run(&args),
        Command::Schema(args) => schemas::run(&args),
        Command::Completions(args) => shell::completions(&args, Args::command()),
        Command::Man(args) => shell::man(&args, Args::command()),
        // Its own would not know the laboratory's commands.
        Command::Laboratory(words) if words[0] == "help" => help(&words[1..]),
        Command::Laboratory(words) => laboratory::run(&words, &Args::command()),
    })
}

//! Measures: one question a subcommand, its result in `bench/results/`. `scripts/bench` builds
//! what it needs and starts it.

mod questions;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use vigil_bench::results::{self, ResultFile};
use vigil_bench::{archive, chain, latency::flood as sensor_flood, root};
use vigil_terminal::schema;

use questions::*;

/// Answers a question by measuring, and keeps what was found in bench/results/
#[derive(Debug, Parser)]
#[command(
    bin_name = "scripts/bench",
    disable_help_subcommand = true,
    subcommand_help_heading = "Questions",
    subcommand_value_name = "QUESTION"
)]
struct Program {
    #[command(subcommand)]
    question: Question,
}

/// What is measured. The help of each is the first line of its module.
#[derive(Debug, Subcommand)]
enum Question {
    /// Are verdicts and actions the same, bit for bit, as those of `bench/bits.txt`?
    Bits(bits::Args),
    /// What does the black box cost the services: when it runs, is stopped, or is killed?
    Blackbox(blackbox::Args),
    /// What are the decisions worth in corridors? Random missions: Vigil, and the best ladder.
    Corridors(corridors::Args),
    /// Does the diagnosis hold in the field: for hours, over gaps, on other grounds, with other
    /// lags?
    Field(field::Args),
    /// How long from a clone to the first alarm, packages downloaded?
    FirstMinute,
    /// Is another ground under a real robot told, and told as no fault?
    GroundChange,
    /// Records healthy runs of the simulated rover, every channel in them, for
    /// `vigil learn --more`.
    Healthy(healthy::Args),
    /// How many instructions does a step of each service take, and does that keep to the budget?
    Instructions(instructions::Args),
    /// How long from the schedule to the action, under load, and whose misses are they?
    Latency(latency::Args),
    /// What are the decisions worth? Missions with random faults: Vigil, and the best rules.
    Missions(missions::Args),
    /// Do the tests notice when a line of the filters, the decision or the cycle is wrong?
    Mutants(mutants::Args),
    /// Where does zero-copy pay?
    Peers(peers::Args),
    /// Are false alarms as rare as `e-detector` promises, and how much later are its alarms?
    Promise(promise::Args),
    /// Are broken sensors found, named and sized in the logs of real robots?
    RealLogs(real_logs::Args),
    /// Is a recording of ten minutes with five faults computed again bit by bit, and how fast?
    Replay(replay::Args),
    /// How many lines of code does each room have, and what do the services link?
    Size(size::Args),
    /// How near are the solver's bounds after a fixed time, and does every policy earn what it
    /// says?
    Solver(solver::Args),
    /// How long does a step of detector and identifier take on a robot of 24 channels?
    Step(step::Args),
    /// Are taped wheels of a real robot found, and told apart?
    TapedWheels,
    /// How much of a core does `vigil top` take?
    Top(top::Args),
    /// Writes bench/README.md anew from the results, and bench/result.schema.json
    Page,
    #[command(flatten)]
    Role(Role),
}

/// What the program is when a question has started it again beside itself.
#[derive(Debug, Subcommand)]
enum Role {
    #[command(name = chain::STAGE_WORD, hide = true)]
    Stage { role: String },
    #[command(name = sensor_flood::FLOOD_WORD, hide = true)]
    SensorFlood { config: PathBuf },
    #[command(name = instructions::RUN_WORD, hide = true)]
    RunCycles,
}

impl Question {
    fn answer(&self) -> Result<(), Box<dyn Error>> {
        match self {
            Self::Bits(args) => bits::run(args),
            Self::Blackbox(args) => blackbox::run(args),
            Self::Corridors(args) => corridors::run(args),
            Self::Field(args) => field::run(args),
            Self::FirstMinute => first_minute::run(),
            Self::GroundChange => ground_change::run(),
            Self::Healthy(args) => healthy::run(args),
            Self::Instructions(args) => instructions::run(args),
            Self::Latency(args) => latency::run(args),
            Self::Missions(args) => missions::run(args),
            Self::Mutants(args) => mutants::run(args),
            Self::Peers(args) => peers::run(args),
            Self::Promise(args) => promise::run(args),
            Self::RealLogs(args) => real_logs::run(args),
            Self::Replay(args) => replay::run(args),
            Self::Size(args) => size::run(args),
            Self::Solver(args) => solver::run(args),
            Self::Step(args) => step::run(args),
            Self::TapedWheels => taped_wheels::run(),
            Self::Top(args) => top::run(args),
            Self::Page => write_page(),
            Self::Role(role) => role.play(),
        }
    }
}

impl Role {
    fn play(&self) -> Result<(), Box<dyn Error>> {
        match self {
            Self::Stage { role } => chain::be_stage(role),
            Self::SensorFlood { config } => sensor_flood::be_flood(config),
            Self::RunCycles => instructions::run_cycles(),
        }
    }
}

/// Writes the page of results, and the schema of one.
fn write_page() -> Result<(), Box<dyn Error>> {
    let page = results::page(&ResultFile::all(&archive::results())?);
    let bench = root().join("bench");
    std::fs::write(bench.join("README.md"), page)?;
    Ok(schema::write(&[results::SCHEMA], &bench)?)
}

fn main() -> ExitCode {
    let words = Program::command().get_matches();
    let name = words.subcommand_name().unwrap_or_default();
    match Program::from_arg_matches(&words) {
        Ok(program) => vigil_bench::ended(name, program.question.answer()),
        Err(error) => error.exit(),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;

    /// `scripts/bench` knows the questions by their files.
    #[test]
    fn every_question_has_a_file_that_begins_with_its_help() {
        let program = Program::command();
        program.clone().debug_assert();
        let asked: BTreeMap<String, String> = program
            .get_subcommands()
            .filter(|question| !question.is_hide_set() && question.get_name() != "page")
            .map(|question| {
                let help = question.get_about().unwrap().to_string();
                (question.get_name().to_owned(), help)
            })
            .collect();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/questions");
        let first_lines: BTreeMap<String, String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| {
                let path = entry.unwrap().path();
                let text = std::fs::read_to_string(&path).unwrap();
                let line = text.lines().next().unwrap().trim_start_matches("//! ");
                let name = path.file_stem().unwrap().to_str().unwrap();
                (
                    name.replace('_', "-"),
                    line.trim_end_matches('.').to_owned(),
                )
            })
            .collect();
        assert_eq!(asked, first_lines);
    }
}

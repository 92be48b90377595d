//! Measures: one question a subcommand, its result in `bench/results/`. `scripts/bench` builds
//! what it needs and starts it.

mod questions;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use vigil_bench::results::{self, Kept};
use vigil_bench::{archive, chain, latency::flood as sensor_flood};

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
    /// Does the latency report tell the machine's misses from Vigil's own?
    Attribution(attribution::Args),
    /// Are verdicts and actions the same, bit for bit, as those of `bench/bits.txt`?
    Bits(bits::Args),
    /// Does the diagnosis hold on noisier sensors, and does it tell a dead encoder from a stuck
    /// wheel?
    Derived(Json),
    /// How long does detection take at equal false-alarm rate, by size of the fault, beside the
    /// bound?
    Detection,
    /// How long does the exact belief over all 4096 sets of twelve faults take per step?
    FaultSets,
    /// Does the diagnosis hold in the field: for hours, over gaps, on other grounds, with other
    /// lags?
    Field(field::Args),
    /// Does a stuck wheel bend the path as the paper says, and by how much?
    Figure7(Json),
    /// Which filter is worth its time?
    Filters,
    /// Does the graph do its main job? Stuck wheel, quiet drive, recorded runs, held-out
    /// evaluation.
    FirstLight,
    /// What does a flood of frames cost? That of a stranger should cost nothing.
    Flood(flood::Args),
    /// Does a model that was learned on one soil fail honestly on stiffer ones?
    Ground(ground::Args),
    /// Does the guard find every bad frame by its right cause, and let pass what is the filters'?
    Guard(guard::Args),
    /// Records healthy runs of the simulated rover, every channel in them, for
    /// `vigil learn --more`.
    Healthy(healthy::Args),
    /// How many instructions does a step of each service take, and does that keep to the budget?
    Instructions(instructions::Args),
    /// How long from the schedule to the action, under load, and whose misses are they?
    Latency(latency::Args),
    /// How fast is the look-ahead filter on a linear 13-mode model?
    LookAhead,
    /// What is Vigil worth? Missions with random faults: with it, without, and with plainer rules.
    Missions(missions::Args),
    /// Do slow, stopped or dead observers disturb the graph, and what does its instrumentation
    /// cost?
    Observers(observers::Args),
    /// Where does zero-copy pay?
    Peers(peers::Args),
    /// How good and how fast are the bounds and the point-based solver on the public models?
    PomdpBounds(pomdp_bounds::Args),
    /// Do the heuristics earn what another implementation says, and what are they worth, how fast?
    PomdpCompare(pomdp_compare::Args),
    /// Is a model learned from missions as good as the true one, and does learning on the way help?
    PomdpLearning(pomdp_learning::Args),
    /// How fast is a belief update?
    PomdpUpdate(Json),
    /// Does a publisher in Python lose frames, and how late are they?
    Publishers(publishers::Args),
    /// Does one detector serve real robots, each learned from its own log, with one rule for the
    /// alarm?
    Robots,
    /// How fast is a particle filter? A plain one and the lanes at each level, in turn, in one
    /// process.
    Rover13(Json),
    /// Are two stuck wheels named, both and no other, and is a second one told from a dead encoder?
    TwoWheels(two_wheels::Args),
    /// Is what no model contains detected, and called unknown? And what does nominal driving raise?
    Unmodelled(unmodelled::Args),
    /// Writes bench/README.md anew from the results
    Page,
    #[command(flatten)]
    Role(Role),
}

/// What the program is when a question has started it again beside itself.
#[derive(Debug, Subcommand)]
enum Role {
    #[command(name = chain::STAGE_WORD, hide = true)]
    Stage { role: String },
    #[command(name = flood::FLOOD_WORD, hide = true)]
    FrameFlood { address: String },
    #[command(name = sensor_flood::FLOOD_WORD, hide = true)]
    SensorFlood { config: PathBuf },
    #[command(name = observers::OBSERVE_WORD, hide = true)]
    Observer { config: PathBuf, folder: PathBuf },
    #[command(name = instructions::RUN_WORD, hide = true)]
    RunCycles,
}

impl Question {
    fn answer(&self) -> Result<(), Box<dyn Error>> {
        match self {
            Self::Attribution(args) => attribution::run(args),
            Self::Bits(args) => bits::run(args),
            Self::Derived(args) => derived::run(args),
            Self::Detection => detection::run(),
            Self::FaultSets => fault_sets::run(),
            Self::Field(args) => field::run(args),
            Self::Figure7(args) => figure7::run(args),
            Self::Filters => filters::run(),
            Self::FirstLight => first_light::run(),
            Self::Flood(args) => flood::run(args),
            Self::Ground(args) => ground::run(args),
            Self::Guard(args) => guard::run(args),
            Self::Healthy(args) => healthy::run(args),
            Self::Instructions(args) => instructions::run(args),
            Self::Latency(args) => latency::run(args),
            Self::LookAhead => look_ahead::run(),
            Self::Missions(args) => missions::run(args),
            Self::Observers(args) => observers::run(args),
            Self::Peers(args) => peers::run(args),
            Self::PomdpBounds(args) => pomdp_bounds::run(args),
            Self::PomdpCompare(args) => pomdp_compare::run(args),
            Self::PomdpLearning(args) => pomdp_learning::run(args),
            Self::PomdpUpdate(args) => pomdp_update::run(args),
            Self::Publishers(args) => publishers::run(args),
            Self::Robots => robots::run(),
            Self::Rover13(args) => rover13::run(args),
            Self::TwoWheels(args) => two_wheels::run(args),
            Self::Unmodelled(args) => unmodelled::run(args),
            Self::Page => write_page(),
            Self::Role(role) => role.play(),
        }
    }
}

impl Role {
    fn play(&self) -> Result<(), Box<dyn Error>> {
        match self {
            Self::Stage { role } => chain::be_stage(role),
            Self::FrameFlood { address } => flood::be_flood(address),
            Self::SensorFlood { config } => sensor_flood::be_flood(config),
            Self::Observer { config, folder } => observers::observe(config, folder),
            Self::RunCycles => instructions::run_cycles(),
        }
    }
}

/// Writes the page of results.
fn write_page() -> Result<(), Box<dyn Error>> {
    let folder = archive::results();
    let page = results::page(&Kept::all(&folder)?);
    std::fs::write(folder.with_file_name("README.md"), page)?;
    Ok(())
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
#[allow(clippy::unwrap_used)]
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

//! Are broken sensors found, named and sized in the logs of real robots?
//!
//! One fault at a time is put into each channel of runs that were not learned from. It counts as
//! *shown* once the channel has read beyond its tolerance for a second: a tolerance is what a
//! second's mean residual of the same runs keeps to in 99 % of their healthy motion.

use std::error::Error;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::real_logs::{Injection, LOGS, Split, healthy, table, tolerances, trial};
use vigil_evaluation::parallel::in_parallel;
use vigil_recording::frames::Run;
use vigil_robot::channel_model::targets;
use vigil_terminal::output;

/// Which logs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only these robots: kobuki, robotino, husky.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Archive a part, too. The whole always is.
    #[arg(long)]
    archive: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let is_asked = |log: &&str| args.only.is_empty() || args.only.iter().any(|name| name == log);
    let logs: Vec<&str> = LOGS.into_iter().filter(is_asked).collect();
    let (mut lines, mut figures) = (Vec::new(), Vec::new());
    for log in &logs {
        let (said, found) = judged(log)?;
        output::line(&said.join("\n"))?;
        lines.extend(said);
        figures.push((format!("{log}.json"), found));
    }
    if logs.len() == LOGS.len() || args.archive {
        Archive::keep("real-logs", &figures, &lines)?;
    }
    Ok(())
}

/// Every fault of every channel of one robot.
fn judged(log: &str) -> Result<(Vec<String>, Value), Box<dyn Error>> {
    let split = Split::new(log)?;
    let tolerances = tolerances(&split)?;
    let usual: Vec<f64> = split.model.channel.iter().map(|it| it.usual).collect();
    let all = Injection::all(&targets(split.robot()), &tolerances, &usual);
    let runs = split.faulty.iter().map(|&i| &split.judged[i]);
    let jobs: Vec<(&Run, &Injection)> = runs
        .flat_map(|run| all.iter().map(move |injection| (run, injection)))
        .collect();
    let trials = in_parallel(&jobs, |(run, injection)| {
        let found = trial(&split, run, injection, tolerances[injection.channel]);
        found.map_err(|error| error.to_string())
    });
    let trials: Vec<_> = trials.into_iter().collect::<Result<_, String>>()?;
    let healthy = healthy(&split)?;
    let named = split.model.channel.iter().map(|it| it.name.as_str());
    let tolerances: Vec<_> = named.zip(&tolerances).collect();
    let figures = json!({"healthy": healthy, "tolerances": tolerances, "trials": trials});
    Ok((table(log, &healthy, &trials), figures))
}

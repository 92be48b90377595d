//! What does the black box cost the services: when it runs, is stopped, or is killed?
//!
//! Of each state are told: the ratio of latencies to those of the same round without a black box,
//! Vigil's own misses, and what the black box itself takes.

use std::error::Error;

use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::blackbox::{Plan, document, table};

/// Shortest half, s.
const SECONDS_MIN: f64 = 1.0;

/// Measures what the black box costs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Rate of the schedule, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// Time in each state, s.
    #[arg(long, value_name = "S", default_value_t = 6.0)]
    seconds: f64,
    /// Rounds of all states.
    #[arg(long, value_name = "N", default_value_t = 12)]
    rounds: usize,
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let &Args {
        seconds, rounds, ..
    } = args;
    if seconds.is_nan() || seconds < SECONDS_MIN {
        return Err(format!("--seconds {seconds}: allowed is {SECONDS_MIN} or more").into());
    }
    if rounds == 0 {
        return Err("--rounds 0: allowed is 1 or more".into());
    }
    let plan = Plan {
        rate_hz: args.rate,
        seconds,
        rounds,
    };
    let run = vigil_bench::in_folder("blackbox", |folder| plan.run(folder))?;
    let mut archive = Archive::new("blackbox", Outlet::by_flag(args.json))?;
    archive.say(&format!(
        "One graph of the rover at {} Hz, {rounds} rounds of four times {seconds} s: without a \
         black box, with one, with one that is stopped (SIGSTOP), and with one that is killed \
         (SIGKILL) at the beginning and replaced, which rescues what was kept. The order changes \
         from round to round. From the schedule to the action, by the services' own stamps: the \
         median over the rounds, and the geometric mean of the ratios within rounds. Brackets: \
         95 %, by a bootstrap over the rounds. A canary on each core, above the services, says in \
         which cycles the machine held it up for more than 50 us beyond what is usual: \
         percentiles are of the others; all: of all cycles. What holds canaries up, too, as the \
         kernel's own work does, is seen only there, and in the share of cycles in which the \
         machine was late. Own: past the deadline, although the frame was in time, and the \
         machine was late for less than half of that; more than off: the differences within \
         rounds. The first second after an \
         orderly start or end of the black box is left out; what \
         follows a signal counts from its instant.\n",
        args.rate
    ));
    table(&run).iter().for_each(|line| archive.say(line));
    archive.store("blackbox.json", &document(&plan, &run))?;
    archive.close()?;
    Ok(())
}

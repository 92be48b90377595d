//! Options of a run.

use std::path::PathBuf;
use std::time::Duration;

use vigil_setup::GraphArgs;

/// Starts a graph, watches it, and prints what happened.
///
/// What happens goes to standard error as it comes, the summary to standard output at the end.
/// It ends with Ctrl-C, or after --duration. Exit codes: 0 done, 1 the run had a failure, was
/// blind, or saw no cycle, 2 a wrong option or configuration, and nothing was started.
#[derive(Debug, Clone, clap::Parser)]
#[command(name = "vigil run", bin_name = "vigil run", version)]
pub struct LauncherArgs {
    /// Which graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Stop after this many seconds. They count from the first cycle in which every service
    /// answers.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    /// End with 1 if no action has come within this many seconds. Without it a publisher outside
    /// may take its time, and all else `watchdog.startup_s`.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub start_timeout: Option<Duration>,
    /// Start no black box, as `blackbox.enabled = false` does.
    #[arg(long, conflicts_with = "adopt")]
    pub no_blackbox: bool,
    /// Take over a running graph of which the launcher is gone, as --graph names it.
    #[arg(long, conflicts_with_all = [
        "config", "rate", "seed", "identifier", "source", "socket", "replay", "runs", "speed",
        "inject", "stamps", "no_timing",
    ])]
    pub adopt: bool,
    /// Break the simulated rover T seconds after the start: `stuck:RM@5`, `encoder:LF:zero@3`.
    /// `clear:RM@9` and `clear:all@9` mend it. Further kinds are disturbances, such as
    /// `tether:20@5` and `steer-jump:LF:0.2@5`. `vigil inject --list` lists all.
    #[arg(long, value_name = "SPEC@T")]
    pub inject: Vec<String>,
    /// Keep the graph's cores from halting, with a thread of the lowest class on each. A halted
    /// core takes long to wake; an awake one costs power.
    #[arg(long)]
    pub keep_awake: bool,
    /// Write the times of every cycle to `FOLDER/SERVICE.stamps`. A record is four little-endian
    /// 64-bit numbers, ns of CLOCK_MONOTONIC: due, input published, awake, output published.
    #[arg(long, value_name = "FOLDER")]
    pub stamps: Option<PathBuf>,
    /// Cycles whose times are kept; the oldest are dropped.
    #[arg(long, value_name = "N", default_value_t = 100_000, requires = "stamps")]
    pub stamped_cycles: usize,
    /// Record no latencies; the summary then has none. It serves to measure what recording costs.
    #[arg(long)]
    pub no_timing: bool,
    /// Print one JSON document at the end, and nothing else on standard output.
    #[arg(long)]
    pub json: bool,
}

/// A time, s.
fn seconds(text: &str) -> Result<Duration, String> {
    let allowed = "allowed is any number of seconds above 0";
    let seconds: f64 = text.parse().map_err(|_| allowed.to_owned())?;
    let duration = Duration::try_from_secs_f64(seconds).map_err(|_| allowed.to_owned())?;
    match duration.is_zero() {
        true => Err(allowed.to_owned()),
        false => Ok(duration),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn a_duration_is_above_zero_and_an_adopted_graph_cannot_be_changed() {
        let parse = |options: &[&str]| {
            LauncherArgs::try_parse_from([&["vigil run"], options].concat())
                .map_err(|error| error.to_string())
        };
        let halves = parse(&["--duration", "2.5"]).unwrap().duration;
        assert_eq!(halves, Some(Duration::from_millis(2500)));
        for wrong in ["0", "-1", "inf", "NaN", "1e99", "long"] {
            let error = parse(&[&format!("--duration={wrong}")]).unwrap_err();
            assert!(error.contains("any number of seconds above 0"), "{error}");
        }
        assert!(parse(&["--adopt", "--graph", "rover", "--json"]).is_ok());
        assert!(parse(&["--adopt", "--rate", "50"]).is_err());
        assert!(parse(&["--adopt", "--inject", "stuck:RM@5"]).is_err());
    }
}

//! `vigil list`: the graphs that run on this machine.

use std::time::SystemTime;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_cycle::Domain;
use vigil_setup::RunningGraph;
use vigil_terminal::{CommandError, Outcome, output};

/// Lists the graphs that run on this machine, and who looks after them.
///
/// Outcome 1 if a graph runs without its launcher: nobody restarts its services.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// The graphs, by name.
    graphs: Vec<ListedGraph>,
}

/// A graph that runs.
#[derive(Debug, Serialize, JsonSchema)]
struct ListedGraph {
    /// Its name.
    name: String,
    /// Process id of its launcher; null if that is gone.
    launcher: Option<u32>,
    /// Its services, as their launcher has listed them last.
    services: Vec<ListedService>,
    /// Process id of its black box; null if it has none.
    blackbox: Option<u32>,
    /// Since its start, s.
    up_s: Option<f64>,
    /// True of `check-publisher` and `record`, which listen in place of a graph.
    listens: bool,
    /// Where its configuration was read from; null if it listens, or is of another version.
    config: Option<String>,
    /// Rate of its schedule.
    rate_hz: Option<f64>,
}

/// A service of it.
#[derive(Debug, Serialize, JsonSchema)]
struct ListedService {
    /// Its name.
    name: &'static str,
    /// Its process.
    pid: u32,
    /// False if it has ended.
    lives: bool,
}

/// Prints the graphs.
///
/// # Errors
/// Output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let names = Domain::all_running();
    let graphs: Vec<ListedGraph> = names.iter().filter_map(|name| listed(name)).collect();
    let is_orphaned = |graph: &ListedGraph| !graph.listens && graph.launcher.is_none();
    let orphaned = graphs.iter().any(is_orphaned);
    let printed = match args.json {
        true => output::json(&Document {
            schema_version: 1,
            graphs,
        }),
        false => output::line(&text(&graphs)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(match orphaned {
        true => Outcome::Failed,
        false => Outcome::Done,
    })
}

/// What is known of a graph; `None` once it has ended.
fn listed(name: &str) -> Option<ListedGraph> {
    let domain = Domain::running(name)?;
    let processes = domain.processes();
    let services = processes.services.iter().map(|&(service, pid)| {
        let lives = domain.find_process(pid).is_some();
        let name = service.as_str();
        ListedService { name, pid, lives }
    });
    let up = start_time(&domain).map(|start| SystemTime::now().duration_since(start));
    let setup = RunningGraph::read(name).ok().map(|graph| graph.setup);
    Some(ListedGraph {
        name: name.to_owned(),
        launcher: processes.launcher,
        listens: domain.members().is_empty(),
        services: services.collect(),
        blackbox: processes.blackbox,
        up_s: up.and_then(Result::ok).map(|up| up.as_secs_f64().round()),
        config: setup.as_ref().map(|setup| setup.path.display().to_string()),
        rate_hz: setup.map(|setup| setup.file.graph.rate_hz),
    })
}

/// When a running graph was started.
pub fn start_time(domain: &Domain) -> Option<SystemTime> {
    let list = std::fs::metadata(domain.processes_file());
    list.and_then(|list| list.modified()).ok()
}

fn text(graphs: &[ListedGraph]) -> String {
    if graphs.is_empty() {
        return "no graph is running; `vigil run` starts one".to_owned();
    }
    let lines = graphs.iter().map(|graph| {
        let name = &graph.name;
        let up = graph.up_s.map_or("?".to_owned(), duration_text);
        if graph.listens {
            return format!("{name:<16} listens to a publisher; no graph runs");
        }
        let config = graph.config.as_deref().unwrap_or("of another version");
        let rate_hz = graph
            .rate_hz
            .map_or("?".to_owned(), |hz| format!("{hz:.0}"));
        let launcher = match graph.launcher {
            Some(pid) => format!("launcher {pid}"),
            None => format!(
                "NO LAUNCHER: `vigil run --adopt --graph {name}` or `vigil stop --graph {name}`"
            ),
        };
        let gone = graph.services.iter().filter(|service| !service.lives);
        let gone: Vec<&str> = gone.map(|service| service.name).collect();
        let gone = match gone.is_empty() {
            true => String::new(),
            false => format!("; ended: {}", gone.join(", ")),
        };
        format!("{name:<16} up {up:<9} {rate_hz} Hz  {config}  {launcher}{gone}")
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// A time in words: `7 s`, `3 min 2 s`, `5 h 4 min`.
pub fn duration_text(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_in_their_two_largest_units() {
        let texts = [0.0, 59.9, 61.0, 3600.0, 90_061.0].map(duration_text);
        assert_eq!(
            texts,
            ["0 s", "59 s", "1 min 1 s", "1 h 0 min", "25 h 1 min"]
        );
    }

    #[test]
    fn a_graph_without_a_launcher_says_what_to_do_and_a_listener_is_no_graph() {
        let graph = |launcher, config: Option<&str>| ListedGraph {
            name: "rover".to_owned(),
            launcher,
            listens: config.is_none(),
            services: vec![ListedService {
                name: "detector",
                pid: 7,
                lives: false,
            }],
            blackbox: None,
            up_s: Some(62.0),
            config: config.map(str::to_owned),
            rate_hz: Some(100.0),
        };
        let line = |graph| text(&[graph]);
        let kept = line(graph(Some(5), Some("rover.toml")));
        assert!(kept.contains("up 1 min 2 s"), "{kept}");
        assert!(kept.ends_with("launcher 5; ended: detector"), "{kept}");
        let orphan = line(graph(None, Some("rover.toml")));
        assert!(
            orphan.contains("vigil run --adopt --graph rover"),
            "{orphan}"
        );
        assert!(line(graph(None, None)).contains("no graph runs"));
    }
}

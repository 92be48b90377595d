//! `vigil graph`: services, topics and cores of a graph, as a drawing.

use std::fmt::Write;

use vigil_cycle::topic::ServiceName;
use vigil_setup::graph_file::Source;
use vigil_setup::{GraphArgs, Setup};
use vigil_terminal::{CommandError, Outcome, output};

/// Draws a graph: services with their cores, topics, and who writes and reads them.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// What to print: Mermaid goes into Markdown, DOT into Graphviz.
    #[arg(long, value_name = "FORMAT", default_value = "mermaid")]
    format: Format,
}

/// A language of drawings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// Mermaid's flowchart.
    Mermaid,
    /// Graphviz's DOT.
    Dot,
}

/// A topic between two who use it.
struct Edge {
    from: &'static str,
    to: &'static str,
    topic: &'static str,
}

const fn edge(from: &'static str, to: &'static str, topic: &'static str) -> Edge {
    Edge { from, to, topic }
}

/// Who sends what to whom. `robot` stands for whoever sends frames and obeys actions.
const EDGES: [Edge; 14] = [
    edge("robot", "detector", "sensor"),
    edge("robot", "identifier", "sensor"),
    edge("robot", "supervisor", "sensor"),
    edge("detector", "identifier", "detection"),
    edge("detector", "identifier", "detection/particles"),
    edge("detector", "supervisor", "detection"),
    edge("identifier", "supervisor", "diagnosis"),
    edge("supervisor", "robot", "action"),
    edge("supervisor", "vigil", "faults"),
    edge("identifier", "vigil", "diagnosis/particles"),
    edge("services", "launcher", "health/*"),
    edge("services", "blackbox", "every topic"),
    edge("vigil", "robot", "control/sensor-sim"),
    edge("vigil", "supervisor", "control/supervisor"),
];

/// Prints the drawing.
///
/// # Errors
/// A configuration that is refused.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let setup = args.graph.load().map_err(CommandError::usage)?;
    output::line(&drawing(&setup, args.format)).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// The nodes: a name, and what is written on it.
fn nodes(setup: &Setup) -> Vec<(&'static str, String)> {
    let core = |name: ServiceName| {
        let service = setup.service(name);
        format!("{}, core {}", name.as_str(), service.core)
    };
    let robot = match setup.file.sensor.source {
        Source::External => "publisher outside".to_owned(),
        Source::Socket => format!("{}, datagrams", core(ServiceName::SensorSim)),
        source => format!("{}, {source}", core(ServiceName::SensorSim)),
    };
    let mut nodes = vec![("robot", robot)];
    for name in &ServiceName::ALL[1..] {
        nodes.push((name.as_str(), core(*name)));
    }
    nodes.push(("services", "every service".to_owned()));
    nodes.push(("launcher", "launcher".to_owned()));
    nodes.push(("blackbox", "black box".to_owned()));
    nodes.push(("vigil", "vigil, observers".to_owned()));
    nodes
}

fn drawing(setup: &Setup, format: Format) -> String {
    let (name, rate_hz) = (&setup.file.graph.name, setup.file.graph.rate_hz);
    let mut text = match format {
        Format::Mermaid => format!("flowchart LR\n  %% graph {name}, {rate_hz} Hz\n"),
        Format::Dot => {
            format!("digraph \"{name}\" {{\n  rankdir=LR; label=\"{name}, {rate_hz} Hz\";\n")
        }
    };
    for (id, label) in nodes(setup) {
        let line = match format {
            Format::Mermaid => format!("  {id}[\"{label}\"]"),
            Format::Dot => format!("  \"{id}\" [shape=box, label=\"{label}\"];"),
        };
        let _ = writeln!(text, "{line}");
    }
    for Edge { from, to, topic } in &EDGES {
        let line = match format {
            Format::Mermaid => format!("  {from} -->|{topic}| {to}"),
            Format::Dot => format!("  \"{from}\" -> \"{to}\" [label=\"{topic}\"];"),
        };
        let _ = writeln!(text, "{line}");
    }
    if format == Format::Dot {
        text.push('}');
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_setup::load_graph;

    #[test]
    fn both_languages_show_every_service_and_only_what_is_drawn_is_joined() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let path = std::path::PathBuf::from(format!("{root}/config/rover.toml"));
        let setup = load_graph(&path, |_| {}).unwrap();
        for format in [Format::Mermaid, Format::Dot] {
            let text = drawing(&setup, format);
            for name in ServiceName::ALL {
                assert!(
                    text.contains(&format!("{}, core ", name.as_str())),
                    "{text}"
                );
            }
        }
        let nodes = nodes(&setup);
        let is_drawn = |id: &str| nodes.iter().any(|(node, _)| *node == id);
        for edge in &EDGES {
            assert!(is_drawn(edge.from) && is_drawn(edge.to), "{}", edge.topic);
        }
    }
}

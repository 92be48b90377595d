//! `vigil pomdp picture`: a policy's graph, its regions, a belief over time.

mod belief;
mod canvas;
mod graph;
mod regions;

use std::path::{Path, PathBuf};

use vigil_pomdp::policy::{Decider, Dual, Policy, PolicyName};
use vigil_pomdp::policy_graph::{Limits, PolicyGraph};
use vigil_pomdp::{Pomdp, mdp};

use super::{load, save, solved, track};
use vigil_terminal::{CommandError, Outcome};

/// Draws a model's policy or belief.
///
/// --graph draws the policy from the start belief on; it is written as DOT if the name ends in
/// .dot. The drawing leaves out edges below 10 % but for the first into each box; .dot has all.
/// Broken edges lead to the nearest box. --regions draws which action the policy takes at which
/// belief, for models of two or three states. --belief draws the belief over given actions and
/// observations as stacked areas.
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("what").required(true)))]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    file: PathBuf,
    /// Draw the policy as a graph.
    #[arg(long, group = "what")]
    graph: bool,
    /// Draw the regions of the belief in which the policy takes each action.
    #[arg(long, group = "what")]
    regions: bool,
    /// Draw the belief over these actions and observations, names or numbers.
    #[arg(long, group = "what", value_name = "A:O,A:O,...")]
    belief: Option<String>,
    /// The policy: mls, av, qmdp, fib, dm-X or adm-X (K = 0.5), or a file of `vigil pomdp solve`.
    #[arg(long, value_name = "POLICY", default_value = "fib")]
    policy: String,
    /// Greatest number of nodes of a graph, 1 to 60.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 8,
        value_parser = clap::value_parser!(u64).range(1..=60)
    )]
    nodes: u64,
    /// Greatest sum of differences between beliefs that share a node of a graph, 0 to 2.
    #[arg(long, value_name = "X", default_value_t = 0.25)]
    tolerance: f64,
    /// Where to write the drawing (SVG or, for a graph, DOT).
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// A model, policy or option that is refused; a file that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let model = load(&args.file)?;
    let name = args.file.file_name().unwrap_or_default();
    let name = name.to_string_lossy();
    let is_dot = args
        .out
        .extension()
        .is_some_and(|extension| extension == "dot");
    if is_dot && !args.graph {
        let message = format!("--out {}: only a graph can be .dot", args.out.display());
        return Err(CommandError::usage(message));
    }
    let text = if let Some(steps) = &args.belief {
        let steps = track::pairs(&model, steps).map_err(CommandError::usage)?;
        belief::draw(&model, &steps, &name)
    } else {
        let mut decider = decider(&model, &args.policy)?;
        let title = format!("{name}, policy {}", short(&args.policy));
        if args.regions {
            regions::draw(&model, &mut decider, &title)
        } else {
            let limits = limits(args)?;
            let graph = PolicyGraph::new(&model, &mut decider, limits);
            if is_dot {
                Ok(graph::dot(&model, &graph, &graph.edges))
            } else {
                graph::draw(&model, &graph)
            }
        }
    };
    let text = text.map_err(CommandError::usage)?;
    save(&args.out, text)?;
    Ok(Outcome::Done)
}

fn limits(args: &Args) -> Result<Limits, CommandError> {
    if !(0.0..=2.0).contains(&args.tolerance) {
        let message = format!("--tolerance {}: allowed is 0 to 2", args.tolerance);
        return Err(CommandError::usage(message));
    }
    Ok(Limits {
        nodes_max: args.nodes as usize,
        tolerance: args.tolerance,
    })
}

/// The last part of a path.
fn short(word: &str) -> String {
    let name = Path::new(word).file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// A policy by name, or from a file.
fn decider(model: &Pomdp, word: &str) -> Result<Decider, CommandError> {
    let solution = mdp::solve(model).map_err(CommandError::usage)?;
    if let Ok(name) = word.parse::<PolicyName>() {
        let decider = name.build(model, &solution, |information| Dual::new(information, 0.5));
        return decider.map_err(CommandError::usage);
    }
    if !Path::new(word).exists() {
        let known = "mls, av, qmdp, fib, dm-X, adm-X, or a file of `vigil pomdp solve`";
        let message =
            format!("--policy {word}: no such policy and no such file; allowed are {known}");
        return Err(CommandError::usage(message));
    }
    let policy: Box<dyn Policy> = Box::new(solved::load(model, "--policy", Path::new(word))?);
    Ok(Decider::new(policy, model, &solution))
}

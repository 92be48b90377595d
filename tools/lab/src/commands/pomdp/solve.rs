//! `vigil pomdp solve`: how much a model is worth at best, and a policy that earns it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_cycle::clock::process_cpu_s;
use vigil_cycle::signal;
use vigil_pomdp::mdp::SolveError;
use vigil_pomdp::policy_file::{PolicyFile, alpha, appl};
use vigil_pomdp::solver::{Answer, EndReason, Method, Options, Progress, bound, compact};
use vigil_pomdp::{AlphaVectors, Budget, Pomdp};

use super::compare::count;
use super::{load, print, save};
use vigil_terminal::{CommandError, Outcome};

const BYTES_PER_GIB: f64 = (1_u64 << 30) as f64;
/// Progress is printed when this factor of time has passed since the last line.
const PROGRESS_FACTOR: f64 = 1.5;
/// ... the first time after so many seconds.
const PROGRESS_FIRST_S: f64 = 0.25;

/// Bounds the best value of a decision model at its start belief, and finds a policy.
///
/// Upper bounds are mdp (the state is known), qmdp (known after one step), fib (fast informed
/// bound) and tib (tighter informed bound). blind (one action for ever) is a lower bound. sarsop
/// gives both bounds and a policy. Ctrl-C ends a search early and keeps its result so far.
///
/// A discount of 1 is taken for goal problems: some states are goals, which no action leaves and in
/// which nothing is earned; from every state there is a way to one; and never to get there costs
/// without bound.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model (.pomdp or .pomdpx).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Method: mdp, blind, qmdp, fib, tib or sarsop.
    #[arg(long, default_value = "sarsop")]
    method: Method,
    /// Processor time after which to end, s.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 60.0,
        allow_negative_numbers = true
    )]
    timeout: f64,
    /// Gap between the bounds at which sarsop ends, in units of the reward.
    #[arg(
        long,
        value_name = "E",
        default_value_t = 1e-3,
        allow_negative_numbers = true
    )]
    precision: f64,
    /// Memory at which sarsop ends, GiB.
    #[arg(
        long,
        value_name = "GIB",
        default_value_t = 3.0,
        allow_negative_numbers = true
    )]
    memory: f64,
    /// Where to write the policy. The name decides the format: `.policy` is APPL's, `.alpha` is
    /// pomdp-solve's, any other is Vigil's own, which `supervisor.policy_file` takes.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Vectors of the policy that is written, at most: those that lose least, as a live decision
    /// takes as long as it has vectors. What they lose is sampled, and said.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = count(1))]
    vectors_max: u64,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json. Bounds are of the best value at the start belief.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model.
    file: String,
    /// Hash of the model.
    model_hash: String,
    /// Method: `mdp`, `blind`, `qmdp`, `fib`, `tib` or `sarsop`.
    method: String,
    /// Discount of a step.
    discount: f64,
    /// What the file holds: `reward` or `cost`. Bounds are rewards in any case, costs negative.
    values: &'static str,
    /// Lower bound; null if the method gives none.
    lower: Option<f64>,
    /// Upper bound; null if the method gives none.
    upper: Option<f64>,
    /// Upper minus lower bound; null without both.
    gap: Option<f64>,
    /// Gap over the larger of the bounds' magnitudes; null without both.
    gap_relative: Option<f64>,
    /// Processor time, s.
    cpu_s: f64,
    /// What ended it: `precision`, `memory`, `timeout` or `interrupted`.
    ended: &'static str,
    /// Rounds of the search of `sarsop`; 0 of other methods.
    rounds: usize,
    /// Beliefs that the search reached.
    beliefs: usize,
    /// Points of the upper bound of `sarsop`.
    points: usize,
    /// Vectors of the lower bound; 0 without one.
    vectors: usize,
    /// Path of the policy written; null without --out.
    policy: Option<String>,
    /// Its vectors; null without --out.
    policy_vectors: Option<usize>,
    /// What it earns at least; what its fewer vectors lose is sampled. Null without --out.
    policy_lower: Option<f64>,
}

/// Solves, and prints what was found.
///
/// # Errors
/// A model or an option that is refused; values without bound; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    check(args)?;
    let model = load(&args.file)?;
    for warning in model.warnings() {
        let file = args.file.display();
        eprintln!("{file}: warning: {}: {}", warning.at, warning.message);
    }
    signal::install();
    let mut stop = || signal::stop_requested() || process_cpu_s() >= args.timeout;
    let mut budget = Budget::new(&mut stop);
    let options = Options {
        precision: args.precision,
        memory_bytes_max: (args.memory * BYTES_PER_GIB) as usize,
    };
    let mut next_s = PROGRESS_FIRST_S;
    let watch = &mut |progress: &Progress| {
        let now_s = process_cpu_s();
        if now_s >= next_s {
            next_s = now_s * PROGRESS_FACTOR;
            eprintln!("{}", progress_line(now_s, progress));
        }
    };
    let answer = bound(args.method, &model, &options, &mut budget, watch)
        .map_err(|e| CommandError::failure(format!("{}: {e}", args.file.display())))?;
    let policy = match &args.out {
        Some(_) => Some(policy(args, &model, &answer)?),
        None => None,
    };
    let cpu_s = process_cpu_s();
    if let Some((out, policy)) = args.out.as_ref().zip(policy.as_ref()) {
        save(
            out,
            policy_bytes(args, &model, &answer, policy, cpu_s, out)?,
        )?;
    }
    let document = document(args, &model, &answer, policy.as_ref(), cpu_s);
    print(args.json, &document, || summary(&document))?;
    Ok(Outcome::Done)
}

/// A policy, and what it earns at least.
struct Exported {
    lower: f64,
    vectors: AlphaVectors,
}

/// The policy of an answer, with no more vectors than are asked for, unless Ctrl-C has ended the
/// search: choosing them takes some seconds beyond the time that was given.
fn policy(args: &Args, model: &Pomdp, answer: &Answer) -> Result<Exported, CommandError> {
    let (Some(vectors), Some(lower)) = (&answer.vectors, answer.lower) else {
        let message = "--out: ended before there was a policy; give it more time by --timeout";
        return Err(CommandError::failure(message));
    };
    let mut stop = signal::stop_requested;
    let small = compact(
        model,
        vectors,
        args.vectors_max as usize,
        &mut Budget::new(&mut stop),
    );
    match small {
        Ok(small) => Ok(Exported {
            lower: lower - small.loss_max(),
            vectors: small.vectors,
        }),
        // Whoever ends the search wants what there is.
        Err(SolveError::Stopped) => Ok(Exported {
            lower,
            vectors: vectors.clone(),
        }),
        Err(error) => Err(CommandError::failure(format!("--vectors-max: {error}"))),
    }
}

fn check(args: &Args) -> Result<(), CommandError> {
    let numbers = [
        ("--timeout", args.timeout),
        ("--precision", args.precision),
        ("--memory", args.memory),
    ];
    for (name, value) in numbers {
        if !(value.is_finite() && value >= 0.0) {
            let message = format!("{name} {value}: allowed is a number from 0");
            return Err(CommandError::usage(message));
        }
    }
    if args.out.is_some() && !matches!(args.method, Method::Sarsop | Method::Blind) {
        let message = format!(
            "--out: {} gives no policy; allowed with sarsop and blind",
            args.method
        );
        return Err(CommandError::usage(message));
    }
    Ok(())
}

fn policy_bytes(
    args: &Args,
    model: &Pomdp,
    answer: &Answer,
    policy: &Exported,
    cpu_s: f64,
    out: &Path,
) -> Result<Vec<u8>, CommandError> {
    let vectors = &policy.vectors;
    let extension = out.extension().and_then(|extension| extension.to_str());
    match extension {
        Some("policy") => Ok(appl::write(vectors, &args.file.display().to_string()).into_bytes()),
        Some("alpha") => Ok(alpha::write(vectors).into_bytes()),
        _ => {
            let file = PolicyFile {
                model_hash: model.hash(),
                discount: model.discount(),
                method: args.method.to_string(),
                lower: policy.lower,
                upper: answer.upper,
                cpu_s,
                vectors: vectors.clone(),
            };
            file.write(model).map_err(CommandError::failure)
        }
    }
}

fn document(
    args: &Args,
    model: &Pomdp,
    answer: &Answer,
    policy: Option<&Exported>,
    cpu_s: f64,
) -> Document {
    let gap = answer
        .lower
        .zip(answer.upper)
        .map(|(lower, upper)| upper - lower);
    let scale = [answer.lower, answer.upper].into_iter().flatten();
    let scale = scale.fold(0.0_f64, |m, v| m.max(v.abs()));
    let vectors = answer.vectors.as_ref();
    Document {
        schema_version: 1,
        file: args.file.display().to_string(),
        model_hash: format!("{:016x}", model.hash()),
        method: args.method.to_string(),
        discount: model.discount(),
        values: if model.is_cost() { "cost" } else { "reward" },
        lower: answer.lower,
        upper: answer.upper,
        gap,
        gap_relative: gap.map(|gap| gap / scale.max(f64::MIN_POSITIVE)),
        cpu_s,
        ended: match answer.ended {
            EndReason::Precision => "precision",
            EndReason::Memory => "memory",
            EndReason::Stopped if signal::stop_requested() => "interrupted",
            EndReason::Stopped => "timeout",
        },
        rounds: answer.progress.rounds,
        beliefs: answer.progress.beliefs,
        points: answer.progress.points,
        vectors: vectors.map_or(0, AlphaVectors::len),
        policy: args.out.as_ref().map(|out| out.display().to_string()),
        policy_vectors: policy.map(|policy| policy.vectors.len()),
        policy_lower: policy.map(|policy| policy.lower),
    }
}

fn progress_line(now_s: f64, progress: &Progress) -> String {
    let bracket = progress.bracket;
    format!(
        "{now_s:>8.2} s  {:.8} <= V* <= {:.8}  gap {:.3e}  {} vectors, {} points, {} beliefs",
        bracket.lower,
        bracket.upper,
        bracket.gap(),
        progress.vectors,
        progress.points,
        progress.beliefs
    )
}

fn summary(document: &Document) -> String {
    let shown = |bound: Option<f64>, none: &str| {
        bound.map_or_else(|| none.to_owned(), |value| format!("{value:.10}"))
    };
    let mut text = format!(
        "{}: {} <= V* <= {} at the start belief",
        document.file,
        shown(document.lower, "?"),
        shown(document.upper, "?")
    );
    if let Some((gap, relative)) = document.gap.zip(document.gap_relative) {
        let _ = write!(text, ", gap {gap:.3e} ({:.3e} of the value)", relative);
    }
    if document.values == "cost" {
        text.push_str("\nthe file holds costs: bounds are rewards, that is costs with a minus");
    }
    let _ = write!(
        text,
        "\n{} in {:.3} s of processor time, ended by {}",
        document.method, document.cpu_s, document.ended
    );
    if document.vectors > 0 {
        let _ = write!(text, "; {} vectors", document.vectors);
    }
    let few = document.policy_vectors.zip(document.policy_lower);
    if let Some((policy, (vectors, lower))) = document.policy.as_ref().zip(few) {
        let _ = write!(
            text,
            "\n{policy}: {vectors} vectors, earns {lower:.10} at least"
        );
    }
    text
}

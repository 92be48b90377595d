//! How good and how fast are the bounds and the point-based solver on the public models?
//!
//! Reads the public models from `$VIGIL_DATA/pomdp`, and those of `config/`.

// The values that the tests hold the bounds to.
#[path = "../../../shared/decision/tests/decision/public/bounds.rs"]
mod reference;

use std::error::Error;
use std::path::{Path, PathBuf};

use reference::BOUNDS;
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::machine;
use vigil_cycle::clock::process_cpu_s;
use vigil_decision::solver::{Answer, Method, Options, Progress, bound};
use vigil_decision::{Budget, Pomdp};

use super::from_zero;

/// File, gap that the search shall reach, and the processor time that it has, s.
type Row = (&'static str, f64, f64);

const ROWS: [Row; 18] = [
    ("1d", 1e-5, 0.1),
    ("1d.noisy", 1e-5, 0.1),
    ("4x3.95", 1e-3, 0.5),
    ("cheese.95", 1e-5, 0.1),
    ("mini-hall2", 1e-5, 0.1),
    ("network", 0.19, 20.0),
    ("paint95-zmdp", 1e-5, 0.1),
    ("shuttle95-zmdp", 1e-3, 0.1),
    ("tiger.95", 1e-6, 0.1),
    ("tiger.aaai", 1e-6, 0.1),
    ("tiger-grid", 0.30, 20.0),
    ("hallway", 0.20, 20.0),
    ("web-ad", 8e-5, 10.0),
    // The gap from 484 to 645.98.
    ("machine", 161.98, 20.0),
    // The gaps from blind to FIB.
    ("bridge-repair", 1680150.0, 5.0),
    ("cheng.D3-5", 4103.4, 5.0),
    // 1 % of their values.
    ("navigation", 0.157, 20.0),
    ("rover", 0.491, 5.0),
];

/// Models of `config/`; for them there is no other implementation's word.
const SHIPPED: [&str; 2] = ["navigation", "rover"];

const METHODS: [Method; 5] = [
    Method::Blind,
    Method::Tib,
    Method::Fib,
    Method::QMdp,
    Method::Mdp,
];

/// For how long the searches go on.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Share of their time that the searches have, %: less for a quick look.
    #[arg(long, value_name = "N", default_value_t = 100.0, value_parser = from_zero)]
    share: f64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build measures nothing: use scripts/bench".into());
    }
    let data = std::env::var_os("VIGIL_DATA").ok_or("VIGIL_DATA is not set: no public models")?;
    let share = 0.01 * args.share;
    let mut lines = vec![
        "Bounds of the optimal value at the start belief; times are processor time. `off`: the"
            .into(),
        "largest relative distance from an independent implementation. The search ends at its"
            .into(),
        "time; `at bar`: when its gap first was what is demanded.\n".into(),
        "| file | blind | TIB | FIB | Q-MDP | MDP | off | FIB, ms | TIB, ms |".to_owned(),
        "|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    let mut searches = vec![
        "\n| file | lower | upper | gap | bar | at bar, s | ended, s | allowed, s |".to_owned(),
        "|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    let mut rows = Vec::new();
    for row in ROWS {
        let is_shipped = SHIPPED.contains(&row.0);
        let folder = if is_shipped {
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../config")
        } else {
            PathBuf::from(&data).join("pomdp")
        };
        let path = folder.join(format!("{}.pomdp", row.0));
        let model = Pomdp::parse(&String::from_utf8_lossy(&std::fs::read(path)?))?;
        let known = BOUNDS.into_iter().find(|(name, _)| *name == row.0);
        let known = known.or(is_shipped.then_some((row.0, [f64::NAN; 5])));
        let (_, wanted) = known.ok_or("no reference")?;
        let (line, bounds) = bounds(&model, row.0, wanted)?;
        let (found, search) = search(&model, &row, share)?;
        eprintln!("{line}\n{found}");
        lines.push(line);
        searches.push(found);
        rows.push(json!({"file": row.0, "bounds": bounds, "search": search}));
    }
    let document = json!({ "machine": machine::facts(), "share": share, "rows": rows });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("pomdp-bounds")?;
    archive.store("pomdp-bounds.json", &document)?;
    for line in lines.iter().chain(&searches) {
        archive.say(line);
    }
    archive.close()?;
    Ok(())
}

/// What a method answers, without a limit of time, and what that took, s: the least of three.
fn timed(method: Method, model: &Pomdp) -> Result<(Answer, f64), Box<dyn Error>> {
    let mut best: Option<(Answer, f64)> = None;
    for _ in 0..3 {
        let began = process_cpu_s();
        let mut never = || false;
        let answer = bound(
            method,
            model,
            &Options::default(),
            &mut Budget::new(&mut never),
            &mut |_| (),
        )?;
        let took_s = process_cpu_s() - began;
        if best.as_ref().is_none_or(|(_, least)| took_s < *least) {
            best = Some((answer, took_s));
        }
    }
    best.ok_or_else(|| "nothing was measured".into())
}

/// The bounds of a model beside those `wanted` (NaN: none is known).
fn bounds(model: &Pomdp, name: &str, wanted: [f64; 5]) -> Result<(String, Value), Box<dyn Error>> {
    let (mut line, mut off, mut raw) = (format!("| {name} |"), 0.0_f64, Vec::new());
    let mut times = [0.0; 5];
    for ((method, wanted), time) in METHODS.into_iter().zip(wanted).zip(&mut times) {
        let (answer, took_s) = timed(method, model)?;
        let value = answer.lower.or(answer.upper).ok_or("no bound")?;
        if wanted.is_finite() {
            off = off.max((value - wanted).abs() / if wanted == 0.0 { 1.0 } else { wanted.abs() });
        }
        *time = took_s;
        line.push_str(&format!(" {value:.9} |"));
        raw.push(
            json!({"method": method.to_string(), "value": value, "reference": wanted,
            "cpu_s": took_s}),
        );
    }
    let (tib_ms, fib_ms) = (1e3 * times[1], 1e3 * times[2]);
    line.push_str(&format!(" {off:.1e} | {fib_ms:.2} | {tib_ms:.2} |"));
    Ok((line, json!(raw)))
}

fn search(model: &Pomdp, row: &Row, share: f64) -> Result<(String, Value), Box<dyn Error>> {
    let (name, bar, allowed_s) = *row;
    let limit_s = allowed_s * share;
    let began = process_cpu_s();
    let mut stop = || process_cpu_s() - began >= limit_s;
    let (mut at_bar_s, mut course) = (None, Vec::new());
    let watch = &mut |progress: &Progress| {
        let now_s = process_cpu_s() - began;
        if progress.bracket.gap() <= bar {
            at_bar_s.get_or_insert(now_s);
        }
        let last_s = course.last().map_or(0.0, |(at_s, _, _)| *at_s);
        if now_s > 1.2 * last_s {
            course.push((now_s, progress.bracket.lower, progress.bracket.upper));
        }
    };
    let options = Options {
        precision: 0.0,
        ..Options::default()
    };
    let answer = bound(
        Method::Sarsop,
        model,
        &options,
        &mut Budget::new(&mut stop),
        watch,
    )?;
    let ended_s = process_cpu_s() - began;
    let (lower, upper) = answer.lower.zip(answer.upper).ok_or("no bracket")?;
    let reached = at_bar_s.map_or_else(|| "not reached".to_owned(), |s| format!("{s:.4}"));
    let vectors = answer.vectors.map_or(0, |vectors| vectors.len());
    let line = format!(
        "| {name} | {lower:.8} | {upper:.8} | {:.3e} | {bar} | {reached} | {ended_s:.3} | \
         {limit_s} |",
        upper - lower
    );
    let raw = json!({"lower": lower, "upper": upper, "gap": upper - lower, "bar": bar,
        "at_bar_s": at_bar_s, "ended_s": ended_s, "allowed_s": limit_s, "vectors": vectors,
        "beliefs": answer.progress.beliefs, "points": answer.progress.points,
        "course_s_lower_upper": course});
    Ok((line, raw))
}

//! How good and how fast are the bounds and the point-based solver on the public models?
//!
//! Reads the models from `$VIGIL_DATA/pomdp`. `--json` prints the document instead of archiving
//! it; `--share N` gives the searches N percent of their time (for a quick look).

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::machine;
use vigil_bench::options::Options as Given;
use vigil_cycle::clock::process_cpu_s;
use vigil_decision::solver::{Answer, Method, Options, Progress, bound};
use vigil_decision::{Budget, Pomdp};

/// File; reference bounds blind, TIB, FIB, Q-MDP, MDP (independent implementation; NaN: none);
/// gap that the search shall reach, and the processor time that it has, s.
type Row = (&'static str, [f64; 5], f64, f64);

const NONE: f64 = f64::NAN;

#[rustfmt::skip]
const ROWS: [Row; 16] = [
    ("1d", [0.8139536485, 1.27586204, 1.470588076, 1.645160907, 1.77419314], 1e-5, 0.1),
    ("1d.noisy", [1.028431231, 1.30499736, 1.458569769, 1.574792237, 1.716450418], 1e-5, 0.1),
    ("4x3.95", [-0.5890765766, 1.98746019, 2.111884788, 2.333007176, 2.481436388], 1e-3, 0.5),
    ("cheese.95", [0.2366468955, 3.48620683, 3.521566602, 3.789942296, 3.936065404], 1e-5, 0.1),
    ("mini-hall2", [0.09010999547, 3.07595672, 3.451907274, 3.667862455, 3.860907153], 1e-5, 0.1),
    ("network", [-125.4383991, 274.357052, 335.2214651, 430.423085, 452.0047455], 0.19, 20.0),
    ("paint95-zmdp", [20.0, 20.0, 20.0, 25.23188406, 25.50724638], 1e-5, 0.1),
    ("shuttle95-zmdp", [0.0, 32.8897247, 32.88972469, 32.88972469, 32.88972469], 1e-3, 0.1),
    ("tiger.95", [-20.0, 49.6056091, 87.17948718, 189.0, 200.0], 1e-6, 0.1),
    ("tiger.aaai", [-4.0, 6.70270272, 14.85714286, 29.0, 40.0], 1e-6, 0.1),
    ("tiger-grid", [0.0, 2.57615218, 2.732547522, 2.981835992, 2.981835992], 0.30, 20.0),
    ("hallway", [0.04723632953, 1.18764333, 1.289371242, 1.4589848, 1.535773008], 0.20, 20.0),
    ("web-ad", [0.7777013087, 0.810465486, 0.8175079105, 0.8305732484, 0.8305732484], 8e-5, 10.0),
    // The gap from 484 to 645.98.
    ("machine", [37.46659856, NONE, 645.9791929, 661.8560507, 661.8560507], 161.98, 20.0),
    // The gaps from blind to FIB.
    ("bridge-repair", [-25860843.4, NONE, -24180693.17, -22484339.7, -22484314.05], 1680150.0, 5.0),
    ("cheng.D3-5", [867555.5421, NONE, 871658.9854, 905818.2026, 905820.1449], 4103.4, 5.0),
];

const METHODS: [Method; 5] = [
    Method::Blind,
    Method::Tib,
    Method::Fib,
    Method::QMdp,
    Method::Mdp,
];

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("pomdp-bounds: {error}");
            ExitCode::from(1)
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build measures nothing: use scripts/bench".into());
    }
    let given = Given::parse(&[("--share", 100.0)])?;
    let data = std::env::var_os("VIGIL_DATA").ok_or("VIGIL_DATA is not set: no public models")?;
    let share = 0.01 * given.number("--share");
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
        let path = PathBuf::from(&data)
            .join("pomdp")
            .join(format!("{}.pomdp", row.0));
        let model = Pomdp::parse(&String::from_utf8_lossy(&std::fs::read(path)?))?;
        let (line, bounds) = bounds(&model, &row)?;
        let (found, search) = search(&model, &row, share)?;
        eprintln!("{line}\n{found}");
        lines.push(line);
        searches.push(found);
        rows.push(json!({"file": row.0, "bounds": bounds, "search": search}));
    }
    let document = json!({ "machine": machine::facts(), "share": share, "rows": rows });
    if given.is_json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("pomdp-bounds")?;
    archive.store("pomdp-bounds.json", &document)?;
    for line in lines.iter().chain(&searches) {
        archive.say(line);
    }
    println!("archived in {}", archive.close()?.display());
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

fn bounds(model: &Pomdp, row: &Row) -> Result<(String, Value), Box<dyn Error>> {
    let (mut line, mut off, mut raw) = (format!("| {} |", row.0), 0.0_f64, Vec::new());
    let mut times = [0.0; 5];
    for ((method, wanted), time) in METHODS.into_iter().zip(row.1).zip(&mut times) {
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
    let (name, _, bar, allowed_s) = *row;
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

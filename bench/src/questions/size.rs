//! How many lines of code does each room have, and what do the services link?
//!
//! Counts without blank lines and comments; see `tests/size`.

use std::collections::BTreeMap;
use std::error::Error;

use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};
use vigil_size::{Lines, Size, linked_crates, measure, workspace};
use vigil_terminal::output;

/// Bars in lines of code: rooms that ship, what runs on the robot, measuring.
const SHIPPED_MAX: usize = 45_000;
const LINKED_MAX: usize = 26_000;
const BENCH_MAX: usize = 6_000;

/// What is done with the counts.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print the result as one JSON document, archive nothing.
    #[arg(long, conflicts_with = "archive")]
    json: bool,
    /// Keep the result in bench/results
    #[arg(long)]
    archive: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let size = measure(&workspace()?, &linked_crates()?);
    let text = tables(&size).join("\n");
    if !(args.archive || args.json) {
        return Ok(output::line(&text)?);
    }
    let mut archive = Archive::new("size", Outlet::by_flag(args.json))?;
    archive.say(&text);
    archive.store("size.json", &figures(&size))?;
    archive.close()?;
    Ok(())
}

fn shipped(size: &Size) -> Lines {
    let rooms = size
        .rooms
        .iter()
        .filter(|(room, _)| ["shared", "services", "tools"].contains(room));
    rooms.fold(Lines::default(), |sum, (_, lines)| sum.plus(*lines))
}

fn linked(size: &Size) -> usize {
    size.linked.iter().map(|(_, code)| code).sum()
}

fn bench(size: &Size) -> usize {
    size.rooms
        .iter()
        .find(|(room, _)| *room == "bench")
        .map_or(0, |(_, lines)| lines.code)
}

fn tests(size: &Size) -> usize {
    size.rooms.iter().map(|(_, lines)| lines.tests).sum()
}

/// Share of comments in the lines of code and comments that ship.
fn comment_share(size: &Size) -> f64 {
    let Lines { code, comments, .. } = shipped(size);
    comments as f64 / (code + comments) as f64
}

fn tables(size: &Size) -> Vec<String> {
    let bar = |what: &str, lines: usize, most: usize| {
        let word = if lines <= most { "met" } else { "missed" };
        format!("| {what} | {lines} | {most}: {word} |")
    };
    let mut text = vec![
        "| lines of code | | bar |".to_owned(),
        "|---|---|---|".to_owned(),
    ];
    let rooms = size.rooms.iter().filter(|(_, lines)| lines.code > 0);
    text.extend(rooms.map(|(room, lines)| format!("| {room} | {} | |", lines.code)));
    text.push(bar(
        "shared, services, tools",
        shipped(size).code,
        SHIPPED_MAX,
    ));
    text.push(bar(
        "of it linked by services and launcher",
        linked(size),
        LINKED_MAX,
    ));
    text.push(bar("bench", bench(size), BENCH_MAX));
    text.push(format!("| tests and examples | {} | |", tests(size)));
    text.extend(["", "| lines of text | number | median | p90 | max |"].map(str::to_owned));
    text.push("|---|---|---|---|---|".to_owned());
    for (what, of) in [
        ("functions that ship", size.functions),
        ("files", size.files),
    ] {
        let row = format!(
            "| {what} | {} | {} | {} | {} |",
            of.count, of.median, of.p90, of.max
        );
        text.push(row);
    }
    let share = 100.0 * comment_share(size);
    text.push(String::new());
    text.push(format!(
        "Comments: {share:.1} % of the lines of shared, services and tools."
    ));
    text.extend(["", "| crate | code | linked | tests |", "|---|---|---|---|"].map(str::to_owned));
    for (folder, lines) in &size.crates {
        let name = folder.trim_end_matches('/');
        let linked = size.linked.iter().find(|(linked, _)| linked == name);
        let linked = linked.map_or(String::new(), |(_, code)| code.to_string());
        text.push(format!(
            "| {name} | {} | {linked} | {} |",
            lines.code, lines.tests
        ));
    }
    text
}

fn figures(size: &Size) -> Value {
    json!({
        "shipped": shipped(size).code,
        "linked": linked(size),
        "bench": bench(size),
        "tests_and_examples": tests(size),
        "comment_share": comment_share(size),
        "functions": size.functions,
        "files": size.files,
        "rooms": size.rooms.iter().copied().collect::<BTreeMap<_, _>>(),
    })
}

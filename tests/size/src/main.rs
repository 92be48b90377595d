//! Prints the size of the workspace; see `scripts/bench size --help`.

use std::process::{Command, ExitCode};
use std::{fs, io};

use serde_json::{Value, json};
use vigil_size::{Distribution, Lines, Size, linked_crates, measure, root, workspace};

const HELP: &str = "Counts lines of code, without blank lines and comments

Usage: scripts/bench size [--json] [--archive]

Options:
  --json     Print one JSON document instead of tables
  --archive  Write the result to bench/results as well
  -h, --help Print help
";

/// Bars in lines of code: rooms that ship, what runs on the robot, measuring.
const SHIPPED_MAX: usize = 45_000;
const LINKED_MAX: usize = 26_000;
const BENCH_MAX: usize = 6_000;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| words.iter().any(|one| one == word);
    if has("-h") || has("--help") {
        print!("{HELP}");
        return ExitCode::SUCCESS;
    }
    if let Some(word) = words
        .iter()
        .find(|word| !["--json", "--archive"].contains(&word.as_str()))
    {
        eprintln!("size: unknown option {word}\n\n{HELP}");
        return ExitCode::from(2);
    }
    match run(has("--json"), has("--archive")) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("size: {error}");
            ExitCode::from(1)
        }
    }
}

fn run(is_json: bool, is_archived: bool) -> io::Result<()> {
    let size = measure(&workspace()?, &linked_crates()?);
    let lines = tables(&size);
    if is_json {
        println!("{:#}", figures(&size));
    } else {
        println!("{}", lines.join("\n"));
    }
    if is_archived {
        archive(&size, &lines)?;
    }
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
    let lengths = |of: Distribution| {
        let Distribution {
            count,
            median,
            p90,
            max,
        } = of;
        json!({ "n": count, "median": median, "p90": p90, "max": max })
    };
    let rooms = size.rooms.iter().map(|(room, lines)| {
        let Lines {
            code,
            comments,
            tests,
        } = *lines;
        (
            (*room).to_owned(),
            json!({ "code": code, "comments": comments, "tests": tests }),
        )
    });
    json!({
        "schema_version": 1,
        "shipped": shipped(size).code,
        "linked": linked(size),
        "bench": bench(size),
        "tests_and_examples": tests(size),
        "comment_share": comment_share(size),
        "functions": lengths(size.functions),
        "files": lengths(size.files),
        "rooms": rooms.collect::<serde_json::Map<String, Value>>(),
    })
}

/// Writes a result in the form of the others.
fn archive(size: &Size, lines: &[String]) -> io::Result<()> {
    let first_line = |command: &mut Command| -> io::Result<String> {
        let output = command.output()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        Ok(text.lines().next().unwrap_or_default().to_owned())
    };
    let git = |words: &[&str]| first_line(Command::new("git").current_dir(root()).args(words));
    let date = first_line(Command::new("date").args(["-u", "+%Y-%m-%d"]))?;
    let host = first_line(&mut Command::new("hostname"))?;
    let changed = !git(&["status", "--porcelain", "--", ":!bench/results"])?.is_empty();
    let result = json!({
        "schema_version": 1,
        "question": "size",
        "command": "scripts/bench size --archive",
        "commit": git(&["rev-parse", "HEAD"])?,
        "date": date,
        "machine": { "uncommitted_changes": changed },
        "summary": lines,
        "remarks": [],
        "figures": { "size.json": figures(size) },
        "raw": [],
    });
    let folder = format!("bench/results/{date}-{host}");
    fs::create_dir_all(root().join(&folder))?;
    let path = format!("{folder}/size.json");
    fs::write(root().join(&path), format!("{result:#}\n"))?;
    eprintln!("result: {path}");
    Ok(())
}

//! Are taped wheels of a real robot found, and told apart?
//!
//! There is one recording a class: what else was special of that day is taken for the fault, too.
//! Blocks of 20 s with gaps of 2 s; a third of each recording is judged by what the others show.

use std::error::Error;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::taped_wheels::{figures, looks};
use vigil_terminal::output;

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    let looks = looks()?;
    let found = figures(&looks);
    let mut lines = vec![
        "| figure | value | 95 % (blocks drawn anew) |".to_owned(),
        "|---|---|---|".to_owned(),
    ];
    for (name, figure) in &found {
        let [low, high] = figure.bounds;
        lines.push(format!(
            "| {name} | {:.3} | {low:.3} to {high:.3} |",
            figure.value
        ));
    }
    output::line(&lines.join("\n"))?;
    let files: [(String, Value); 2] = [
        ("figures.json".to_owned(), json!(found)),
        ("looks.json".to_owned(), json!(looks)),
    ];
    Archive::keep("taped-wheels", &files, &lines)?;
    Ok(())
}

//! Is another ground under a real robot told, and told as no fault?
//!
//! 46 runs of a Robotino cross a border, 576 stay on one ground; each heading is judged by what the
//! others show. The label is when the first wheel crosses the border.

use std::error::Error;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::ground_change::{counts, found};
use vigil_evaluation::scoring::bounds::binomial;
use vigil_terminal::output;

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    let found = found()?;
    let counts = counts(&found);
    let mut lines = vec![
        "| runs | count | 95 % of their share (exact binomial) |".to_owned(),
        "|---|---|---|".to_owned(),
    ];
    for (name, count, of) in &counts {
        let bounds = binomial(*count, *of).ok_or("no runs")?;
        let (lower, upper) = (bounds.lower, bounds.upper);
        lines.push(format!(
            "| {name} | {count} of {of} | {lower:.3} to {upper:.3} |"
        ));
    }
    output::line(&lines.join("\n"))?;
    let files: [(String, Value); 2] = [
        ("counts.json".to_owned(), json!(counts)),
        ("runs.json".to_owned(), json!(found)),
    ];
    Archive::keep("ground-change", &files, &lines)?;
    Ok(())
}

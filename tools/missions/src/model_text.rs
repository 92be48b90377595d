//! Lines and numbers of a `.pomdp` text.

use std::fmt::Write as _;

/// The largest number of decimals of a probability; its rows are exact to better than 1e-11.
const DIGITS: usize = 11;

/// A number to twelve significant digits, in plain notation.
pub fn number(value: f64) -> String {
    let rounded = format!("{value:.DIGITS$e}").parse::<f64>().unwrap_or(value);
    // No "-0".
    format!("{}", rounded + 0.0)
}

/// Adds a line.
pub fn line(text: &mut String, content: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{content}");
}

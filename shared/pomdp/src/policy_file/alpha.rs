//! The text format of `pomdp-solve`: for each vector a line with the index of its action, a line
//! with its values, an empty line. It names neither model nor discount.

use std::fmt::Write as _;

use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::model::Pomdp;

/// Why a text is not such a policy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlphaTextError {
    /// A word that is not a number.
    #[error("line {line}: '{found}', allowed is {allowed}")]
    Word {
        /// Line, from 1.
        line: usize,
        /// The word.
        found: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// The text ends after an action.
    #[error("line {0}: an action, but no line of values follows")]
    Short(usize),
    /// Vectors that do not fit the model.
    #[error(transparent)]
    Vectors(#[from] VectorError),
}

/// The text of these vectors.
#[must_use]
pub fn write(vectors: &AlphaVectors) -> String {
    let mut text = String::new();
    for (action, values) in vectors.rows() {
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{action}\n{}\n", values.join(" "));
    }
    text
}

/// Reads vectors of `model`; empty lines and comments from `#` on are passed over.
///
/// # Errors
/// [`AlphaTextError`], with the line where it has one.
pub fn read(text: &str, model: &Pomdp) -> Result<AlphaVectors, AlphaTextError> {
    let lines = text.lines().enumerate().map(|(at, line)| {
        let content = line.split('#').next().unwrap_or_default();
        (at + 1, content.trim())
    });
    let mut lines = lines.filter(|(_, content)| !content.is_empty());
    let mut vectors = Vec::new();
    while let Some((line, word)) = lines.next() {
        let action: usize = number(line, word, "the index of an action")?;
        let (line, values) = lines.next().ok_or(AlphaTextError::Short(line))?;
        let values: Result<Vec<f64>, _> = values
            .split_whitespace()
            .map(|word| number(line, word, "a number"))
            .collect();
        vectors.push((action, values?));
    }
    let (states, actions) = (model.states().len(), model.actions().len());
    Ok(AlphaVectors::new(states, actions, vectors)?)
}

fn number<T: std::str::FromStr>(
    line: usize,
    word: &str,
    allowed: &'static str,
) -> Result<T, AlphaTextError> {
    word.parse().map_err(|_| AlphaTextError::Word {
        line,
        found: word.chars().take(40).collect(),
        allowed,
    })
}

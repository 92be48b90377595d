//! The XML format of APPL (`.policy`): one `Vector` element for each vector, with the index of its
//! action. APPL writes six digits; we write all. It names neither model nor discount.

use std::fmt::Write as _;

use roxmltree::{Document, Node};

use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::model::Pomdp;

/// Why a text is not such a policy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ApplError {
    /// Not XML.
    #[error("not XML: {0}")]
    Xml(String),
    /// An element that is missing or has another name.
    #[error("line {line}: element '{found}', allowed is '{allowed}'")]
    Element {
        /// Line, from 1.
        line: u32,
        /// Its name.
        found: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// A number that is none, or not the one that is allowed.
    #[error("line {line}: {what} '{found}', allowed is {allowed}")]
    Number {
        /// Line, from 1.
        line: u32,
        /// What it should tell.
        what: &'static str,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// Vectors that do not fit the model.
    #[error(transparent)]
    Vectors(#[from] VectorError),
}

/// The text of these vectors; `model_name` is for the reader's eye.
#[must_use]
pub fn write(vectors: &AlphaVectors, model_name: &str) -> String {
    let mut name = String::new();
    for c in model_name.chars() {
        match c {
            '&' => name.push_str("&amp;"),
            '<' => name.push_str("&lt;"),
            '"' => name.push_str("&quot;"),
            c if c.is_control() => name.push(' '),
            c => name.push(c),
        }
    }
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Policy version=\"0.1\" type=\"value\" \
         model=\"{name}\">\n<AlphaVector vectorLength=\"{}\" numObsValue=\"1\" \
         numVectors=\"{}\">\n",
        vectors.states(),
        vectors.len()
    );
    for (action, values) in vectors.rows() {
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "<Vector action=\"{action}\" obsValue=\"0\">{} </Vector>",
            values.join(" ")
        );
    }
    text.push_str("</AlphaVector>\n</Policy>\n");
    text
}

/// Reads vectors of `model`. Mixed observability (`numObsValue` above 1) is refused.
///
/// # Errors
/// [`ApplError`], with the line where it has one.
pub fn read(text: &str, model: &Pomdp) -> Result<AlphaVectors, ApplError> {
    let document = Document::parse(text).map_err(|error| ApplError::Xml(error.to_string()))?;
    let policy = named(document.root_element(), "Policy")?;
    let Some(list) = policy.children().find(Node::is_element) else {
        return Err(element(policy, "Policy without AlphaVector"));
    };
    let list = named(list, "AlphaVector")?;
    let length: usize = attribute(list, "vectorLength")?;
    let states = model.states().len();
    if length != states {
        let found = length.to_string();
        let allowed = format!("{states}, the number of states");
        return Err(wrong(list, "vectorLength", &found, allowed));
    }
    let observed: usize = attribute(list, "numObsValue")?;
    if observed != 1 {
        let found = observed.to_string();
        return Err(wrong(list, "numObsValue", &found, "1".to_owned()));
    }
    let count: usize = attribute(list, "numVectors")?;
    let mut vectors = Vec::new();
    for node in list.children().filter(Node::is_element) {
        let node = named(node, "Vector")?;
        let words = node.text().unwrap_or_default().split_whitespace();
        let values: Result<Vec<f64>, ApplError> =
            words.map(|word| number(node, "value", word)).collect();
        vectors.push((attribute(node, "action")?, values?));
    }
    if vectors.len() != count {
        let found = count.to_string();
        let allowed = format!("{}, the number of Vector elements", vectors.len());
        return Err(wrong(list, "numVectors", &found, allowed));
    }
    Ok(AlphaVectors::new(states, model.actions().len(), vectors)?)
}

fn line(node: Node<'_, '_>) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

fn element(node: Node<'_, '_>, allowed: &'static str) -> ApplError {
    ApplError::Element {
        line: line(node),
        found: node.tag_name().name().to_owned(),
        allowed,
    }
}

fn named<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Result<Node<'a, 'i>, ApplError> {
    if node.has_tag_name(name) {
        Ok(node)
    } else {
        Err(element(node, name))
    }
}

fn attribute<T: std::str::FromStr>(node: Node<'_, '_>, name: &'static str) -> Result<T, ApplError> {
    number(node, name, node.attribute(name).unwrap_or_default())
}

fn number<T: std::str::FromStr>(
    node: Node<'_, '_>,
    what: &'static str,
    word: &str,
) -> Result<T, ApplError> {
    let word = word.trim();
    word.parse()
        .map_err(|_| wrong(node, what, word, "a number".to_owned()))
}

fn wrong(node: Node<'_, '_>, what: &'static str, found: &str, allowed: String) -> ApplError {
    ApplError::Number {
        line: line(node),
        what,
        found: found.chars().take(40).collect(),
        allowed,
    }
}

//! Reader of `.pomdpx`, the XML format of the solver APPL.
//!
//! Factored models are multiplied out: a state is one value of every state variable, its name their
//! names joined by `_`, the last variable running fastest; likewise actions and observations. A
//! fully observed state variable is a part of every observation, before those of the file. Several
//! reward variables add up. Limits are those of the `.pomdp` reader.

mod factors;
mod product;
mod scope;
mod table;
mod xml;

use crate::model::{Parts, Pomdp, Warning};
use crate::parse_error::{ParseError, Position};
use crate::reader::limits::{ENTRIES_MAX, ROWS_MAX, TEXT_BYTES_MAX, check};

use factors::Factors;
use product::Product;
use scope::Scope;
use xml::Element;

/// Most elements and pieces of text of a document: its tree stays below a gigabyte.
const NODES_MAX: u32 = 1 << 22;

impl Pomdp {
    /// Reads APPL's `.pomdpx` format: tables (`TBL`) over discrete variables. Names that
    /// Cassandra's format does not allow are changed, with a warning.
    ///
    /// # Errors
    /// [`ParseError`] with line and column, what was found and what is allowed.
    pub fn parse_pomdpx(text: &str) -> Result<Self, ParseError> {
        let at = Position { line: 1, column: 1 };
        check(Some(text.len()), TEXT_BYTES_MAX, at, "bytes of text")?;
        let options = roxmltree::ParsingOptions {
            nodes_limit: NODES_MAX,
            ..Default::default()
        };
        let document = roxmltree::Document::parse_with_options(text, options).map_err(|error| {
            let at = Position {
                line: error.pos().row as usize,
                column: error.pos().col as usize,
            };
            ParseError::new(at, format!("not XML: {error}"))
        })?;
        let root = Element::new(document.root_element());
        if root.name() != "pomdpx" {
            return Err(root.wrong(format!("<{}>, wanted is <pomdpx>", root.name())));
        }
        model(root)
    }
}

fn model(root: Element<'_>) -> Result<Pomdp, ParseError> {
    let discount = discount(root.child("Discount")?)?;
    let variable = root.child("Variable")?;
    let scope = Scope::read(variable)?;
    let at = variable.at();
    let (n, a, k) = (scope.states(), scope.actions(), scope.observations());
    check(a.checked_mul(n), ROWS_MAX, at, "pairs of state and action")?;
    check((a * n).checked_mul(k), ENTRIES_MAX, at, "O entries")?;
    let mut factors = Factors::read(root, &scope)?;
    let mut warnings = Vec::new();
    let mut named = |names: Vec<String>| legal(names, at, &mut warnings);
    let states = named(scope.state_names()?)?;
    let actions = named(scope.action_names()?)?;
    let observations = named(scope.observation_names()?)?;
    let mut product = Product::new(&scope, &mut factors);
    let start = product.start()?;
    let transitions = product.transitions()?;
    let observation = product.observation()?;
    let rewards = product.rewards()?;
    let place = |name| root.optional(name).map_or(at, |element| element.at());
    Pomdp::from_parts(Parts {
        discount,
        is_cost: false,
        states,
        actions,
        observations,
        start,
        start_at: place("InitialStateBelief"),
        transitions,
        observation,
        rewards,
        row_at: [
            vec![place("StateTransitionFunction"); a * n],
            vec![place("ObsFunction"); a * n],
        ],
        warnings,
    })
}

fn discount(element: Element<'_>) -> Result<f64, ParseError> {
    let text = element.text();
    let value = text.trim().parse::<f64>().ok();
    let value = value.filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| {
        let found = xml::short(text.trim());
        element.wrong(format!("discount is '{found}', allowed is 0 to 1"))
    })
}

/// Names as Cassandra's format allows them.
fn legal(
    names: Vec<String>,
    at: Position,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<String>, ParseError> {
    let mut changed: Option<(usize, String)> = None;
    let mut seen = std::collections::HashSet::with_capacity(names.len());
    let mut all = Vec::with_capacity(names.len());
    for name in names {
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let mut now = name.replace(|c| !allowed(c), "_");
        if !now.starts_with(|c: char| c.is_ascii_alphabetic()) {
            now.insert(0, 'v');
        }
        if crate::reader::is_reserved(&now) {
            now.push('_');
        }
        if now != name {
            let first = || (0, format!("'{}' is called '{now}'", xml::short(&name)));
            changed.get_or_insert_with(first).0 += 1;
        }
        if !seen.insert(now.clone()) {
            let message = format!("two values are called '{now}', allowed is one");
            return Err(ParseError::new(at, message));
        }
        all.push(now);
    }
    if let Some((count, first)) = changed {
        let message = format!("{count} names are not allowed in .pomdp files: {first}");
        warnings.push(Warning { at, message });
    }
    Ok(all)
}

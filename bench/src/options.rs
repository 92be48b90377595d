//! Options of measuring programs: numbers, and `--json`.

use std::collections::BTreeMap;

/// What was given on the command line, defaults for the rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    numbers: BTreeMap<&'static str, f64>,
    /// Print the document, archive nothing.
    pub is_json: bool,
}

impl Options {
    /// Options of this process; `known` holds each with its default.
    ///
    /// # Errors
    /// What is not known or not a number of at least 0, with what is allowed.
    pub fn parse(known: &[(&'static str, f64)]) -> Result<Self, String> {
        Self::of(std::env::args().skip(1), known)
    }

    fn of(
        given: impl IntoIterator<Item = String>,
        known: &[(&'static str, f64)],
    ) -> Result<Self, String> {
        let mut options = Self {
            numbers: known.iter().copied().collect(),
            is_json: false,
        };
        let mut given = given.into_iter();
        while let Some(word) = given.next() {
            if word == "--json" {
                options.is_json = true;
                continue;
            }
            let Some((name, _)) = known.iter().find(|(name, _)| *name == word) else {
                let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
                let names = names.join(" N, ");
                return Err(format!(
                    "'{word}' is not an option: allowed are --json, {names} N"
                ));
            };
            let value = given.next().unwrap_or_default();
            let number = value
                .parse()
                .ok()
                .filter(|n: &f64| n.is_finite() && *n >= 0.0);
            let wrong = || format!("{name} '{value}': allowed is a number from 0");
            options.numbers.insert(name, number.ok_or_else(wrong)?);
        }
        Ok(options)
    }

    /// The value of a known option; NaN of another.
    #[must_use]
    pub fn number(&self, name: &str) -> f64 {
        self.numbers.get(name).copied().unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_and_wrong_ones_refused() {
        let known = [("--seeds", 2.0), ("--hours", 24.0)];
        let of = |words: &[&str]| {
            let found = Options::of(words.iter().map(|&word| word.to_owned()), &known);
            found.map(|o| (o.number("--seeds"), o.number("--hours"), o.is_json))
        };
        assert_eq!(of(&[]), Ok((2.0, 24.0, false)));
        assert_eq!(of(&["--hours", "1.5", "--json"]), Ok((2.0, 1.5, true)));
        assert_eq!(
            of(&["--hours", "-1"]),
            Err("--hours '-1': allowed is a number from 0".to_owned())
        );
        let refused = "'--x' is not an option: allowed are --json, --seeds N, --hours N";
        assert_eq!(of(&["--x"]), Err(refused.to_owned()));
    }
}

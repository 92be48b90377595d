//! What a figure should be.

use std::fmt;
use std::str::FromStr;

use serde::Deserialize;
use vigil_evaluation::scoring::field::Figure;

/// Which side of the number is good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Comparison {
    /// At most so much.
    AtMost,
    /// At least so much.
    AtLeast,
}

/// A bar, as text: `[SENSORS: ]FIGURE <= NUMBER`, or `>=`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Bar {
    /// Set of sensors for which it holds; every one if none is named.
    pub sensors: Option<String>,
    /// Name of the figure.
    pub figure: String,
    /// Which side is good.
    pub comparison: Comparison,
    /// The number.
    pub number: f64,
}

impl Bar {
    /// True if it holds for a set of sensors.
    #[must_use]
    pub fn is_for(&self, sensors: &str) -> bool {
        self.sensors.as_deref().is_none_or(|of| of == sensors)
    }

    /// Whether the figure's value meets it; what never happened does not. `None` without a case.
    #[must_use]
    pub fn is_met(&self, figures: &[Figure]) -> Option<bool> {
        let figure = figures.iter().find(|figure| figure.name == self.figure)?;
        Some(figure.value.is_some_and(|value| match self.comparison {
            Comparison::AtMost => value <= self.number,
            Comparison::AtLeast => value >= self.number,
        }))
    }
}

impl FromStr for Bar {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("bar '{text}': expected [SENSORS: ]FIGURE <= NUMBER, or >=");
        let (sensors, rest) = match text.split_once(": ") {
            Some((sensors, rest)) => (Some(sensors.trim().to_owned()), rest),
            None => (None, text),
        };
        let words: Vec<&str> = rest.split_whitespace().collect();
        let [figure, comparison, number] = words[..] else {
            return Err(wrong());
        };
        let comparison = match comparison {
            "<=" => Comparison::AtMost,
            ">=" => Comparison::AtLeast,
            _ => return Err(wrong()),
        };
        Ok(Self {
            sensors,
            figure: figure.to_owned(),
            comparison,
            number: number.parse().map_err(|_| wrong())?,
        })
    }
}

impl TryFrom<String> for Bar {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl fmt::Display for Bar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = match self.comparison {
            Comparison::AtMost => "<=",
            Comparison::AtLeast => ">=",
        };
        write!(f, "{} {sign} {}", self.figure, self.number)
    }
}

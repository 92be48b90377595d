//! Learned numbers that ended on a bound set by hand: what stands there was not measured.

use schemars::JsonSchema;
use serde::Serialize;

/// A number this close to a bound, relative to it, stands on it: factors on both round.
const ROUNDING: f64 = 1e-9;
/// Places that a line names one by one.
const NAMED_MAX: usize = 3;

/// How a number came to differ from what the log says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BoundCause {
    /// The log says less.
    Least,
    /// The log says more.
    Most,
    /// The log says nothing, or is not asked.
    Given,
}

/// A number of a model that the log alone did not decide.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Bound {
    /// Its key in the model file.
    pub key: String,
    /// What number it is, whichever the wheel, channel or mode.
    pub number: &'static str,
    /// Its value in the model file.
    pub value: f64,
    /// The bound.
    pub bound: f64,
    /// On which side of the bound the log is.
    pub held: BoundCause,
    /// Why it is there.
    pub why: &'static str,
}

/// Bounds of a learned number, each with the reason why it is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// What number it is.
    pub number: &'static str,
    /// Least value.
    pub least: (f64, &'static str),
    /// Largest value.
    pub most: (f64, &'static str),
}

impl Limits {
    /// Without a largest value.
    #[must_use]
    pub const fn least(number: &'static str, least: f64, why: &'static str) -> Self {
        Self {
            number,
            least: (least, why),
            most: (f64::INFINITY, ""),
        }
    }

    /// Without a least value.
    #[must_use]
    pub const fn most(number: &'static str, most: f64, why: &'static str) -> Self {
        Self {
            number,
            least: (f64::NEG_INFINITY, ""),
            most: (most, why),
        }
    }

    /// The value within the bounds.
    #[must_use]
    pub fn hold(&self, value: f64) -> f64 {
        value.max(self.least.0).min(self.most.0)
    }
}

/// The numbers of one model that stand on a bound.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Bounds {
    pub(crate) found: Vec<Bound>,
    /// Every number looked at, of which `found` are some.
    #[serde(skip)]
    looked_at: Vec<&'static str>,
}

impl Bounds {
    /// Notes a number if it stands on one of its bounds.
    pub fn look(&mut self, limits: &Limits, key: String, value: f64) {
        let ((least, why_least), (most, why_most)) = (limits.least, limits.most);
        let near =
            |bound: f64| bound.is_finite() && (value - bound).abs() <= ROUNDING * bound.abs();
        self.looked_at.push(limits.number);
        let (bound, held, why) = if value <= least || near(least) {
            (least, BoundCause::Least, why_least)
        } else if value >= most || near(most) {
            (most, BoundCause::Most, why_most)
        } else {
            return;
        };
        let number = limits.number;
        self.found.push(Bound {
            key,
            number,
            value,
            bound,
            held,
            why,
        });
    }

    /// Notes a number that the log did not decide, if `is_given`.
    pub fn given(
        &mut self,
        is_given: bool,
        (number, key): (&'static str, String),
        value: f64,
        why: &'static str,
    ) {
        self.looked_at.push(number);
        if is_given {
            self.found.push(Bound {
                key,
                number,
                value,
                bound: value,
                held: BoundCause::Given,
                why,
            });
        }
    }

    /// A line for each kind of number and bound.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let mut groups: Vec<Vec<&Bound>> = Vec::new();
        for bound in &self.found {
            let same =
                |of: &Bound| (of.number, of.held, of.why) == (bound.number, bound.held, bound.why);
            match groups.iter_mut().find(|group| same(group[0])) {
                Some(group) => group.push(bound),
                None => groups.push(vec![bound]),
            }
        }
        groups.iter().map(|group| self.line(group)).collect()
    }

    fn line(&self, group: &[&Bound]) -> String {
        let first = group[0];
        let all = self.looked_at.iter().filter(|&&of| of == first.number);
        let places = match group.len() > NAMED_MAX {
            true => format!("{} of {} {}", group.len(), all.count(), first.number),
            false => group
                .iter()
                .map(|of| of.key.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        };
        let low = group
            .iter()
            .map(|of| of.value)
            .fold(f64::INFINITY, f64::min);
        let high = group
            .iter()
            .map(|of| of.value)
            .fold(f64::NEG_INFINITY, f64::max);
        let values = match high - low <= ROUNDING * high.abs() {
            true => number(low),
            false => format!("{} to {}", number(low), number(high)),
        };
        let (on, held) = match first.held {
            BoundCause::Least => ("on its bound", "least: "),
            BoundCause::Most => ("on its bound", "most: "),
            BoundCause::Given => ("not learned", ""),
        };
        format!("{on}: {places} = {values} ({held}{})", first.why)
    }
}

/// A number with the digits that tell.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let decimals = (3.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SD: Limits = Limits {
        number: "motion.offset_sd",
        least: (1e-3, "no robot repeats itself better"),
        most: (1.0, "as far as it drives"),
    };

    #[test]
    fn a_clamp_that_binds_is_told_and_one_that_does_not_is_not() {
        let mut bounds = Bounds::default();
        for (i, learned) in [1e-5, 0.02, 7.0].into_iter().enumerate() {
            bounds.look(&SD, format!("offset_sd[{i}]"), SD.hold(learned));
        }
        let told: Vec<_> = bounds
            .found
            .iter()
            .map(|b| (b.key.as_str(), b.value, b.held))
            .collect();
        let expected = [
            ("offset_sd[0]", 1e-3, BoundCause::Least),
            ("offset_sd[2]", 1.0, BoundCause::Most),
        ];
        assert_eq!(told, expected);
        assert_eq!(
            bounds.lines()[0],
            "on its bound: offset_sd[0] = 0.001 (least: no robot repeats itself better)"
        );
    }

    #[test]
    fn many_places_on_one_bound_are_one_line() {
        let mut bounds = Bounds::default();
        for i in 0..6 {
            let learned = if i == 4 { 0.5 } else { 0.0 };
            bounds.look(&SD, format!("offset_sd[{i}]"), SD.hold(learned));
        }
        bounds.given(true, ("lag_s", "command.lag_s".into()), 0.1, "assumed");
        bounds.given(
            false,
            ("noise", "noise.wheel_rate_rad_s".into()),
            0.05,
            "not measured",
        );
        let expected = [
            "on its bound: 5 of 6 motion.offset_sd = 0.001 (least: no robot repeats itself better)",
            "not learned: command.lag_s = 0.1 (assumed)",
        ];
        assert_eq!(bounds.lines(), expected);
    }
}

//! Values against the ranges of the schema.

use std::marker::PhantomData;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value as Schema;
use toml::Value;

use crate::schema::{allowed, schema_of};

/// A setting is out of its range.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct OutOfRange {
    /// The key.
    pub key: String,
    /// What was found, and what is allowed.
    pub message: String,
}

/// The ranges of settings that no graph file holds, such as those of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranges<T> {
    schema: Schema,
    settings: PhantomData<fn(&T)>,
}

impl<T: JsonSchema + Serialize> Default for Ranges<T> {
    fn default() -> Self {
        Self {
            schema: schema_of::<T>(),
            settings: PhantomData,
        }
    }
}

impl<T: JsonSchema + Serialize> Ranges<T> {
    /// Checks settings.
    ///
    /// # Errors
    /// The first value out of its range.
    pub fn check(&self, settings: &T) -> Result<(), OutOfRange> {
        let mut first = None;
        check_all(&self.schema, settings, &mut |key, message| {
            let key = key.to_owned();
            first.get_or_insert(OutOfRange { key, message });
        });
        first.map_or(Ok(()), Err)
    }
}

/// Checks settings; `report` gets the key and a message for each problem.
pub(crate) fn check_all(
    schema: &Schema,
    settings: &impl Serialize,
    report: &mut impl FnMut(&str, String),
) {
    match Value::try_from(settings) {
        Ok(value) => check(schema, &value, "", report),
        Err(error) => report("", error.to_string()),
    }
}

/// Checks a value and all below it; `report` gets the key and a message for each problem.
fn check(schema: &Schema, value: &Value, key: &str, report: &mut impl FnMut(&str, String)) {
    // What may be left out is a schema or null.
    for choice in schema["anyOf"].as_array().into_iter().flatten() {
        check(choice, value, key, report);
    }
    match value {
        Value::Table(table) => {
            for (name, inner) in table {
                let declared = schema["properties"].get(name);
                let schema = declared.unwrap_or(&schema["additionalProperties"]);
                let key = if key.is_empty() {
                    name.clone()
                } else {
                    format!("{key}.{name}")
                };
                check(schema, inner, &key, report);
            }
        }
        Value::Array(items) => {
            count(schema, items.len(), key, report);
            for (i, item) in items.iter().enumerate() {
                check(&schema["items"], item, &format!("{key}.{i}"), report);
            }
        }
        Value::Integer(value) => number(schema, *value as f64, key, report),
        Value::Float(value) => number(schema, *value, key, report),
        _ => {}
    }
}

fn count(schema: &Schema, count: usize, key: &str, report: &mut impl FnMut(&str, String)) {
    let count = count as u64;
    let is_less = schema["minItems"].as_u64().is_some_and(|low| count < low);
    let is_more = schema["maxItems"].as_u64().is_some_and(|high| count > high);
    if is_less || is_more {
        let allowed = allowed(schema).unwrap_or_default();
        report(key, format!("{count} entries: allowed are {allowed}"));
    }
}

fn number(schema: &Schema, value: f64, key: &str, report: &mut impl FnMut(&str, String)) {
    let is_off = schema["x-off"].as_f64() == Some(value);
    // No comparison with NaN holds.
    let is_low = schema["minimum"].as_f64().is_some_and(|low| value < low)
        || schema["exclusiveMinimum"]
            .as_f64()
            .is_some_and(|low| value <= low);
    let is_high = schema["maximum"].as_f64().is_some_and(|high| value > high);
    if !value.is_finite() || !is_off && (is_low || is_high) {
        let allowed = allowed(schema).unwrap_or_else(|| "any finite number".to_owned());
        report(
            key,
            format!("{value} is out of range: allowed is {allowed}"),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// The problems of `value` under `schema`.
    fn problems(schema: &Schema, value: &str) -> Vec<String> {
        let value: toml::Table = toml::from_str(value).unwrap();
        let mut found = Vec::new();
        check(schema, &Value::Table(value), "", &mut |key, message| {
            found.push(format!("{key}: {message}"));
        });
        found
    }

    #[test]
    fn bounds_belong_to_the_range_and_what_is_beyond_does_not() {
        let x = json!({"minimum": 0.5, "maximum": 2, "x-off": 0});
        let schema = json!({"properties": {"x": x, "y": {"minimum": 1}, "z": {}}});
        for fine in ["x = 0.5", "x = 2", "x = 0", "y = 1e300", "z = -1e300"] {
            assert_eq!(problems(&schema, fine), [""; 0], "{fine}");
        }
        let x = "is out of range: allowed is 0.5 to 2, or 0 for none";
        for value in ["0.4", "2.1", "-1", "NaN", "inf"] {
            let text = format!("x = {}", value.to_lowercase());
            assert_eq!(problems(&schema, &text), [format!("x: {value} {x}")]);
        }
        let y = "y: 0 is out of range: allowed is 1 or more";
        assert_eq!(problems(&schema, "y = 0"), [y]);
        let above = json!({"exclusiveMinimum": 0, "maximum": 1});
        let schema_above = json!({"properties": {"x": above}});
        assert_eq!(problems(&schema_above, "x = 1e-9"), [""; 0]);
        for value in ["0", "-1", "1.5"] {
            let expected = format!("x: {value} is out of range: allowed is above 0 to 1");
            assert_eq!(problems(&schema_above, &format!("x = {value}")), [expected]);
        }
        let z = "z: NaN is out of range: allowed is any finite number";
        assert_eq!(problems(&schema, "z = nan"), [z]);
    }

    #[test]
    fn lists_maps_and_sections_that_may_be_left_out_are_walked() {
        let number = json!({"maximum": 1});
        let list = json!({"minItems": 2, "items": {"items": number}});
        let optional = json!({"anyOf": [{"properties": {"x": number}}, {"type": "null"}]});
        let map = json!({"additionalProperties": {"properties": {"x": number}}});
        let schema = json!({"properties": {"list": list, "section": optional, "map": map}});
        let found = problems(
            &schema,
            "list = [[0, 2]]\nmap = { a = { x = 3 } }\nsection = { x = 4 }",
        );
        let out = "is out of range: allowed is at most 1";
        let expected = [
            "list: 1 entries: allowed are 2 or more".to_owned(),
            format!("list.0.1: 2 {out}"),
            format!("map.a.x: 3 {out}"),
            format!("section.x: 4 {out}"),
        ];
        assert_eq!(found, expected);
    }
}

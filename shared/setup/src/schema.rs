//! The JSON Schema of a graph file, from the settings of the rooms.
//!
//! Beside what JSON Schema knows, a value may carry `x-unit`, where the key does not end in its
//! unit, and `x-off`: the value outside of the range that switches the function off.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

use crate::graph_file::GraphFile;

/// The schema: every key with its meaning, range and default. Keys are sorted; no part refers to
/// another.
#[must_use]
pub fn schema() -> Value {
    schema_of::<GraphFile>()
}

/// The schema of one room's settings.
pub(crate) fn schema_of<T: JsonSchema>() -> Value {
    let inline = |settings: &mut SchemaSettings| settings.inline_subschemas = true;
    let generator = SchemaSettings::draft2020_12().with(inline).into_generator();
    let mut schema = generator.into_root_schema_for::<T>().to_value();
    schema.sort_all_objects();
    schema
}

/// What the schema of a number or a list allows, in words; `None` if it allows everything.
pub(crate) fn allowed(schema: &Value) -> Option<String> {
    let number = |key: &str| schema[key].as_f64();
    let low = number("minimum").or(number("minItems"));
    let high = number("maximum").or(number("maxItems"));
    let above = number("exclusiveMinimum");
    let range = match (above, low, high) {
        (Some(above), _, Some(high)) => format!("above {above} to {high}"),
        (Some(above), _, None) => format!("above {above}"),
        (None, Some(low), Some(high)) if low == high => format!("{low}"),
        (None, Some(low), Some(high)) => format!("{low} to {high}"),
        (None, Some(low), None) => format!("{low} or more"),
        (None, None, Some(high)) => format!("at most {high}"),
        (None, None, None) => return None,
    };
    Some(match number("x-off") {
        Some(off) => format!("{range}, or {off} for none"),
        None => range,
    })
}

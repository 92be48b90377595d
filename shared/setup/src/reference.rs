//! Reference pages of files, from their schemas.

use std::fmt::Write;

use schemars::JsonSchema;
use serde_json::{Map, Value};
use vigil_robot::Description;

use crate::graph_file::GraphFile;
use crate::schema::{allowed, schema_of};

/// What stands above the tables of a graph file.
const GRAPH: &str = "# Configuration

Every key of a graph file (`config/*.toml`). `vigil config --reference` prints this page from the
settings that the rooms declare, `vigil config --schema` the same as a JSON Schema. The values of
one file with all defaults: `vigil config --config F --effective`.

Paths are relative to the graph file. An unknown key or a value out of range is an error with file
and line. A key without default is required.
";

/// What stands above the tables of a robot's description.
const ROBOT: &str = "# Robot description

Every key of a robot's description (`config/robots/*.toml`). `vigil config --reference robot`
prints this page from what the program reads. An unknown key or a value out of range is an error
with file and line. A key without default is required, a table that may be left out says so.

A robot with a model of channels, which is any but the six-wheel rover, needs only the keys at the
top, `[[command]]` and what it has of `[measured]`, `[[wheels]]` and `[[channel]]`.
";

/// Units by the end of a key; the longest end decides.
const UNITS: [(&str, &str); 20] = [
    ("_n_m_s", "N m s"),
    ("_n_m", "N m"),
    ("_rad_m", "rad/m"),
    ("_m_m", "m/m"),
    ("_1_h", "1/h"),
    ("_1_m", "1/m"),
    ("_1_s", "1/s"),
    ("_rad_s", "rad/s"),
    ("_m_s", "m/s"),
    ("_percent", "%"),
    ("_scale", "factor"),
    ("_rad", "rad"),
    ("_hz", "Hz"),
    ("_ms", "ms"),
    ("_us", "us"),
    ("_ns", "ns"),
    ("_a", "A"),
    ("_h", "h"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Tables of the file with the same keys, such as those of the services.
struct Section<'a> {
    headings: Vec<String>,
    meaning: String,
    table: &'a Value,
}

/// The page of a graph file, in Markdown.
#[must_use]
pub fn reference() -> String {
    reference_of::<GraphFile>(GRAPH)
}

/// That of a robot's description.
#[must_use]
pub fn robot_reference() -> String {
    reference_of::<Description>(ROBOT)
}

/// That of any file; `head` stands above the tables.
#[must_use]
pub fn reference_of<T: JsonSchema>(head: &str) -> String {
    let schema = schema_of::<T>();
    let mut found = vec![Section {
        headings: Vec::new(),
        meaning: text(&schema["description"]),
        table: &schema,
    }];
    collect("", &schema, &mut found);
    let mut page = head.to_owned();
    for section in &found {
        write_section(section, &mut page);
    }
    page
}

/// Finds all tables below `table`, each before those that it holds.
fn collect<'a>(path: &str, table: &'a Value, found: &mut Vec<Section<'a>>) {
    for (key, value) in properties(table) {
        let Some(inner) = Inner::find(value) else {
            continue;
        };
        let path = match path {
            "" => key.clone(),
            path => format!("{path}.{key}"),
        };
        let (path, heading) = match inner.form {
            Form::Table => (path.clone(), format!("[{path}]")),
            Form::List => (path.clone(), format!("[[{path}]]")),
            Form::Map => (format!("{path}.NAME"), format!("[{path}.NAME]")),
        };
        let keys = &inner.table["properties"];
        match found.last_mut() {
            Some(last) if last.table["properties"] == *keys => {
                last.headings.push(heading);
                last.meaning = text(&table["description"]);
            }
            _ => {
                found.push(Section {
                    headings: vec![heading],
                    meaning: text(&value["description"]),
                    table: inner.table,
                });
                collect(&path, inner.table, found);
            }
        }
    }
}

/// How a key holds tables.
enum Form {
    Table,
    List,
    Map,
}

/// Tables below a key.
struct Inner<'a> {
    form: Form,
    table: &'a Value,
}

impl<'a> Inner<'a> {
    fn find(value: &'a Value) -> Option<Self> {
        // A section that may be left out is a table or null.
        let choices = value["anyOf"].as_array().into_iter().flatten();
        let tables = choices.chain([value]).map(|table| (Form::Table, table));
        let below = [
            (Form::List, &value["items"]),
            (Form::Map, &value["additionalProperties"]),
        ];
        let mut all = tables.chain(below);
        all.find(|(_, table)| table["properties"].is_object())
            .map(|(form, table)| Self { form, table })
    }
}

fn properties(table: &Value) -> impl Iterator<Item = (&String, &Value)> {
    table["properties"]
        .as_object()
        .into_iter()
        .flat_map(Map::iter)
}

fn write_section(section: &Section<'_>, page: &mut String) {
    let is_value = |(_, value): &(&String, &Value)| Inner::find(value).is_none();
    let values: Vec<_> = properties(section.table).filter(is_value).collect();
    // What only holds other tables has a heading in each of these.
    if values.is_empty() {
        return;
    }
    let headings: Vec<_> = section.headings.iter().map(|h| format!("`{h}`")).collect();
    let title = match headings.is_empty() {
        true => "At the top".to_owned(),
        false => headings.join(", "),
    };
    let _ = write!(page, "\n## {title}\n\n{}\n", section.meaning);
    page.push_str("\n| key | unit | range | default | meaning |\n|---|---|---|---|---|\n");
    for (key, value) in &values {
        let unit = unit(key, value);
        let (range, meaning) = (range(value), text(&value["description"]));
        let default = default(key, value, section.table);
        let _ = writeln!(
            page,
            "| `{key}` | {unit} | {range} | {default} | {meaning} |"
        );
    }
    for (key, value) in values {
        let choices: Vec<_> = choices(value).collect();
        if choices
            .iter()
            .any(|choice| choice["description"].is_string())
        {
            let _ = write!(page, "\nValues of `{key}`:\n\n");
            for choice in choices {
                let (name, meaning) = (plain(&choice["const"]), text(&choice["description"]));
                let _ = writeln!(page, "- {name}: {meaning}");
            }
        }
    }
}

/// The values that a key with names allows, each a schema of its own.
fn choices(value: &Value) -> impl Iterator<Item = &Value> {
    let optional = value["anyOf"].as_array().into_iter().flatten();
    let lists = optional.chain([value]).map(|choice| &choice["oneOf"]);
    lists.filter_map(Value::as_array).flatten()
}

fn unit(key: &str, value: &Value) -> String {
    if let Some(unit) = value["x-unit"].as_str() {
        return unit.to_owned();
    }
    let found = UNITS.iter().find(|(end, _)| key.ends_with(end));
    found.map_or(String::new(), |(_, unit)| (*unit).to_owned())
}

fn range(value: &Value) -> String {
    let names: Vec<String> = choices(value)
        .map(|choice| plain(&choice["const"]))
        .collect();
    if !names.is_empty() {
        return names.join(", ");
    }
    if value["type"] == "boolean" {
        return "`true`, `false`".to_owned();
    }
    let allowed = allowed(value).unwrap_or_default();
    match ["minItems", "maxItems"]
        .iter()
        .any(|key| value[*key].is_u64())
    {
        true => format!("{allowed} entries"),
        false => allowed,
    }
}

fn default(key: &str, value: &Value, table: &Value) -> String {
    let required = table["required"].as_array();
    if required.is_some_and(|keys| keys.iter().any(|name| name == key)) {
        return "required".to_owned();
    }
    plain(&value["default"])
}

/// A value as a graph file holds it.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => format!("`{text}`"),
        Value::Number(number) => number
            .as_f64()
            .map_or_else(|| number.to_string(), |number| number.to_string()),
        other => format!("`{other}`"),
    }
}

/// A description in one line.
fn text(value: &Value) -> String {
    let words = value.as_str().unwrap_or_default().split_whitespace();
    words.collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

//! Reads the fields of structs that are read from files.

use crate::source::Source;

/// One field of a struct that derives `Deserialize`.
#[derive(Debug, PartialEq, Eq)]
pub struct Field {
    /// 1-based line.
    pub line: usize,
    /// Key in the file: the field's name, or what serde renames it to.
    pub key: String,
    /// Its type, as written.
    pub kind: String,
    /// True if a doc comment stands above it.
    pub is_documented: bool,
}

impl Field {
    /// True if the user chooses the keys below this one.
    pub fn has_free_keys(&self) -> bool {
        self.kind.contains("BTreeMap<") || self.kind.contains("HashMap<")
    }
}

/// Fields of all structs in `source` that derive `Deserialize`, as `rustfmt` lays them out.
pub fn fields(source: &Source) -> Vec<Field> {
    let mut found = Vec::new();
    let mut inside = false;
    // What stands between the last item or field and this line.
    let (mut docs, mut attributes) = (0, String::new());
    for (index, (line, code)) in source.text.lines().zip(source.code.lines()).enumerate() {
        let mut is_end = code.starts_with('}');
        inside &= !is_end;
        if line.trim_start().starts_with("///") {
            docs += line.trim().len() - "///".len();
        } else if line.trim_start().starts_with("#[") {
            attributes.push_str(line);
        } else if !inside && is_struct(code) {
            inside = attributes.contains("Deserialize") && !source.is_test(index + 1);
            is_end = true;
        } else if inside && let Some((name, kind)) = field(code) {
            found.push(Field {
                line: index + 1,
                key: renamed(&attributes).unwrap_or(name).to_string(),
                kind: kind.to_string(),
                is_documented: docs > 0,
            });
            is_end = true;
        } else if code.trim_end().ends_with(['}', ';']) {
            is_end = true;
        }
        if is_end {
            docs = 0;
            attributes.clear();
        }
    }
    found
}

fn is_struct(code: &str) -> bool {
    code.split_whitespace().any(|word| word == "struct") && code.ends_with('{')
}

/// Name and type in `pub name: Type,`; the line is masked.
fn field(code: &str) -> Option<(&str, &str)> {
    let (declared, kind) = code.split_once(": ")?;
    let name = declared.split_whitespace().last()?;
    Some((name, kind.trim_end_matches(',')))
}

fn renamed(above: &str) -> Option<&str> {
    let (_, tail) = above.split_once("rename = \"")?;
    tail.split('"').next()
}

#[test]
fn fields_of_configuration_structs_are_read() {
    let text = "/// A.\n#[derive(Debug, Deserialize)]\npub struct A {\n    /// Rate, Hz.\n    \
                #[serde(default = \"one\")]\n    pub rate_hz: f64,\n    // Not documented.\n    \
                #[serde(rename = \"sensor-sim\")]\n    pub(crate) x: u8,\n    y: BTreeMap<String, \
                A>,\n}\n\n#[derive(Debug)]\nstruct B {\n    z: u8,\n}\n";
    let found = fields(&Source::new("shared/setup/src/schema.rs", text));
    let summary: Vec<_> = found
        .iter()
        .map(|f| (f.line, f.key.as_str(), f.is_documented))
        .collect();
    assert_eq!(
        summary,
        [
            (6, "rate_hz", true),
            (9, "sensor-sim", false),
            (10, "y", false)
        ]
    );
    assert!(found[2].has_free_keys() && !found[0].has_free_keys());
}

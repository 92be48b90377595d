//! The fields of a message type, read from a definition in the `.msg` language of ROS, as
//! recordings carry it: the type itself, then those it uses, each under `===` and `MSG: <type>`.

use std::collections::BTreeMap;

/// Definitions for recordings that carry none: what the messages of ROS 2 look like on the wire.
const STANDARD: &str = include_str!("standard.msg");
/// Types within types, deepest: ROS has messages of 6.
const DEPTH_MAX: usize = 16;
/// Types in one schema, and fields in it: many times those of the largest message of ROS. They
/// bound what a hostile definition costs.
const STRUCTS_MAX: usize = 256;
const FIELDS_MAX: usize = 4096;

/// What one value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// One byte, 0 or 1.
    Bool,
    /// Integer of this many bytes with a sign.
    Signed(usize),
    /// Integer of this many bytes without one.
    Unsigned(usize),
    /// Floating point of this many bytes, 4 or 8.
    Float(usize),
    /// A string.
    Text,
    /// Another type, by its index in the schema.
    Struct(usize),
}

impl Kind {
    /// Bytes of a number; none for what has no fixed size.
    pub const fn size(self) -> Option<usize> {
        match self {
            Self::Bool => Some(1),
            Self::Signed(size) | Self::Unsigned(size) | Self::Float(size) => Some(size),
            Self::Text | Self::Struct(_) => None,
        }
    }

    fn primitive(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "byte" | "char" | "uint8" => Self::Unsigned(1),
            "uint16" => Self::Unsigned(2),
            "uint32" => Self::Unsigned(4),
            "uint64" => Self::Unsigned(8),
            "int8" => Self::Signed(1),
            "int16" => Self::Signed(2),
            "int32" => Self::Signed(4),
            "int64" => Self::Signed(8),
            "float32" => Self::Float(4),
            "float64" => Self::Float(8),
            _ if name == "string" || name.starts_with("string<=") => Self::Text,
            _ => return None,
        })
    }
}

/// How many values a field has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Count {
    /// One.
    One,
    /// An array of so many.
    Fixed(usize),
    /// A sequence: its length comes before it.
    Many,
}

/// One field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    /// Name.
    pub name: String,
    /// What its values are.
    pub kind: Kind,
    /// How many.
    pub count: Count,
}

/// One type: its fields in the order of the wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Struct {
    /// Package and name: `nav_msgs/Odometry`.
    pub name: String,
    /// Fields.
    pub fields: Vec<Field>,
}

/// A message type with all the types that it uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Schema {
    structs: Vec<Struct>,
    root: usize,
}

impl Schema {
    /// Reads the definition of `kind` (`nav_msgs/msg/Odometry`); an empty `text` stands for the
    /// standard one.
    ///
    /// # Errors
    /// What cannot be read, or is not defined.
    pub fn parse(kind: &str, text: &str) -> Result<Self, String> {
        let name = short(kind);
        let mut definitions = sections(STANDARD, None);
        let is_known = definitions.contains_key(&name);
        if text.trim().is_empty() {
            if !is_known {
                let message = "the recording does not define this type, and it is no standard one";
                return Err(message.to_owned());
            }
        } else {
            definitions.extend(sections(text, Some(&name)));
        }
        let mut builder = Builder {
            definitions,
            done: BTreeMap::new(),
            structs: Vec::new(),
            fields: 0,
        };
        let root = builder.add(&name, 0)?;
        let structs = builder.structs;
        Ok(Self { structs, root })
    }

    /// The message itself.
    pub(super) const fn root(&self) -> usize {
        self.root
    }

    /// A type by its index; an empty one for an index that is none.
    pub(super) fn get(&self, index: usize) -> &[Field] {
        self.structs.get(index).map_or(&[], |s| s.fields.as_slice())
    }

    /// Name of a type.
    pub(super) fn name(&self, index: usize) -> &str {
        self.structs.get(index).map_or("", |s| s.name.as_str())
    }
}

/// `nav_msgs/msg/Odometry` as `nav_msgs/Odometry`.
fn short(kind: &str) -> String {
    match kind.trim().split('/').collect::<Vec<_>>()[..] {
        [package, _, name] => format!("{package}/{name}"),
        _ => kind.trim().to_owned(),
    }
}

/// Bodies of the types that a text defines; `first` names the one before any `MSG:` line.
fn sections(text: &str, first: Option<&str>) -> BTreeMap<String, Vec<String>> {
    let mut out: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut current = first.map(str::to_owned);
    if let Some(name) = &current {
        out.insert(name.clone(), Vec::new());
    }
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or("").trim();
        if let Some(name) = line.strip_prefix("MSG:") {
            let name = short(name);
            out.insert(name.clone(), Vec::new());
            current = Some(name);
        } else if let Some(body) = current.as_ref().and_then(|name| out.get_mut(name))
            && !line.is_empty()
            && !line.starts_with("===")
        {
            body.push(line.to_owned());
        }
    }
    out
}

struct Builder {
    definitions: BTreeMap<String, Vec<String>>,
    /// Types that are read, by name; none while one is being read.
    done: BTreeMap<String, Option<usize>>,
    structs: Vec<Struct>,
    fields: usize,
}

impl Builder {
    fn add(&mut self, name: &str, depth: usize) -> Result<usize, String> {
        match self.done.get(name) {
            Some(Some(index)) => return Ok(*index),
            Some(None) => return Err(format!("{name} contains itself")),
            None => {}
        }
        if depth > DEPTH_MAX || self.structs.len() >= STRUCTS_MAX {
            return Err(format!(
                "too many types within types: allowed are {DEPTH_MAX} levels, {STRUCTS_MAX} in all"
            ));
        }
        let body = self.definitions.get(name).cloned();
        let body = body.ok_or_else(|| format!("{name} is used and not defined"))?;
        self.done.insert(name.to_owned(), None);
        let mut fields = Vec::new();
        for line in &body {
            if let Some(line) = field(line).map_err(|e| format!("{name}: {e}"))? {
                fields.push(self.field(name, &line, depth)?);
            }
            self.fields += 1;
            if self.fields > FIELDS_MAX {
                return Err(format!("more than {FIELDS_MAX} fields"));
            }
        }
        self.structs.push(Struct {
            name: name.to_owned(),
            fields,
        });
        let index = self.structs.len() - 1;
        self.done.insert(name.to_owned(), Some(index));
        Ok(index)
    }

    fn field(&mut self, owner: &str, line: &Line<'_>, depth: usize) -> Result<Field, String> {
        let Line { kind, name } = line;
        let (base, count) = count(kind).map_err(|e| format!("{owner}: {name}: {e}"))?;
        let kind = match Kind::primitive(base) {
            Some(kind) => kind,
            None => Kind::Struct(self.add(&self.full(owner, base), depth + 1)?),
        };
        Ok(Field {
            name: (*name).to_owned(),
            kind,
            count,
        })
    }

    /// Name of a type with its package; without one it is that of its user.
    fn full(&self, owner: &str, name: &str) -> String {
        match name {
            "Header" => return "std_msgs/Header".to_owned(),
            "time" => return "builtin_interfaces/Time".to_owned(),
            "duration" => return "builtin_interfaces/Duration".to_owned(),
            _ if name.contains('/') => return short(name),
            _ => {}
        }
        let package = owner.split('/').next().unwrap_or("");
        format!("{package}/{name}")
    }
}

/// A field as it is written.
struct Line<'a> {
    kind: &'a str,
    name: &'a str,
}

/// The field of a line; none for a constant.
fn field(line: &str) -> Result<Option<Line<'_>>, String> {
    let (kind, rest) = line
        .split_once(char::is_whitespace)
        .ok_or_else(|| format!("'{line}' is no field"))?;
    let rest = rest.trim_start();
    let end = rest
        .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
        .unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    if name.is_empty() {
        return Err(format!("'{line}' is no field"));
    }
    let is_constant = after.trim_start().starts_with('=');
    Ok((!is_constant).then_some(Line { kind, name }))
}

/// Type of the elements, and how many they are.
fn count(kind: &str) -> Result<(&str, Count), String> {
    let Some((base, size)) = kind.strip_suffix(']').and_then(|k| k.rsplit_once('[')) else {
        return Ok((kind, Count::One));
    };
    if size.is_empty() || size.starts_with("<=") {
        return Ok((base, Count::Many));
    }
    match size.parse() {
        Ok(size) if size > 0 => Ok((base, Count::Fixed(size))),
        _ => Err(format!("'{kind}' has no size: allowed are [], [N], [<=N]")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_with_all_that_the_language_has_is_read() {
        let text = "# a comment\n\nuint8 OK=0\nstring NAME = \"a # b\"\nint32 n 5 # default\n\
                    float64[3] fixed\nfloat32[<=4] bounded\nstring<=8[] names\nHeader header\n\
                    Other other\nfar_msgs/msg/Far[] far\n\
                    ================================\nMSG: my_msgs/Other\nbool yes true\n\
                    ================================\nMSG: far_msgs/Far\nint8 i\n";
        let schema = Schema::parse("my_msgs/msg/Mine", text).unwrap();
        let fields = schema.get(schema.root());
        let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
        let wanted = ["n", "fixed", "bounded", "names", "header", "other", "far"];
        assert_eq!(names, wanted);
        assert_eq!(fields[0].kind, Kind::Signed(4));
        assert_eq!(
            (fields[1].kind, fields[1].count),
            (Kind::Float(8), Count::Fixed(3))
        );
        assert_eq!(
            (fields[2].kind, fields[2].count),
            (Kind::Float(4), Count::Many)
        );
        assert_eq!((fields[3].kind, fields[3].count), (Kind::Text, Count::Many));
        let Kind::Struct(header) = fields[4].kind else {
            unreachable!("a header is a type")
        };
        assert_eq!(schema.name(header), "std_msgs/Header");
    }

    #[test]
    fn what_cannot_be_read_is_refused() {
        for (text, wanted) in [
            ("float64", "no field"),
            ("float64[0] x", "has no size"),
            ("float64[-1] x", "has no size"),
            ("wstring x", "not defined"),
            ("Mine x", "contains itself"),
            (
                "Other x\n===\nMSG: my_msgs/Other\nMine y",
                "contains itself",
            ),
        ] {
            let error = Schema::parse("my_msgs/msg/Mine", text).unwrap_err();
            assert!(error.contains(wanted), "{text}: {error}");
        }
        assert!(Schema::parse("my_msgs/msg/Mine", "").is_err());
    }

    #[test]
    fn every_standard_type_can_be_read() {
        for name in sections(STANDARD, None).keys() {
            Schema::parse(name, "").unwrap();
        }
    }
}

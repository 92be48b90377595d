//! Names of the numbers that a message holds, as a user writes them.

use super::cdr::Cdr;
use super::path::derived;
use super::read::is_names;
use super::schema::{Count, Kind, Schema};

/// Names listed, at most, and elements of one list, named or not: enough for every joint of a
/// robot, and few enough for a terminal. Longer lists without names are scans and images.
const NAMES_MAX: usize = 400;
const ELEMENTS_MAX: usize = 64;
const UNNAMED_MAX: usize = 16;

/// Every number of a message, as far as it can be read. Covariances are left out.
pub(super) fn names(schema: &Schema, data: &[u8]) -> Vec<String> {
    let mut out = Vec::new();
    if let Ok(mut cdr) = Cdr::new(data) {
        // What was found before a message ends too soon is still there.
        let _ = message(schema, &mut cdr, schema.root(), "", &mut out);
    }
    out
}

fn message(
    schema: &Schema,
    cdr: &mut Cdr<'_>,
    kind: usize,
    before: &str,
    out: &mut Vec<String>,
) -> Result<(), String> {
    let fields = schema.get(kind);
    if fields.is_empty() {
        return cdr.skip(1, 1);
    }
    if schema.name(kind).starts_with("builtin_interfaces/") {
        add(out, before.trim_end_matches('.').to_owned());
        return cdr.skip(2, 4);
    }
    for angle in ["roll", "pitch", "yaw", "curvature"] {
        if derived(schema, kind, angle).is_some() {
            add(out, format!("{before}{angle}"));
        }
    }
    let mut names: Vec<&str> = Vec::new();
    for field in fields {
        let path = format!("{before}{}", field.name);
        let count = match field.count {
            Count::One => {
                element(schema, cdr, field.kind, path, out)?;
                continue;
            }
            Count::Fixed(count) => count,
            Count::Many => cdr.length()?,
        };
        cdr.fits(count)?;
        if is_names(field) {
            names.clear();
            for _ in 0..count {
                let name = cdr.text()?;
                if names.len() < ELEMENTS_MAX {
                    names.push(name);
                }
            }
            continue;
        }
        let is_few = count <= UNNAMED_MAX || !names.is_empty();
        let is_listed = is_few && !field.name.contains("covariance");
        for index in 0..count {
            let mut ignored = Vec::new();
            let to = match is_listed && index < ELEMENTS_MAX && out.len() < NAMES_MAX {
                true => &mut *out,
                false => &mut ignored,
            };
            if let (Some(size), true) = (field.kind.size(), index >= ELEMENTS_MAX) {
                cdr.skip(count - index, size)?;
                break;
            }
            let key = match field.kind {
                Kind::Struct(child) => label(schema, *cdr, child),
                _ => names.get(index).copied(),
            };
            let key = key.filter(|key| !key.is_empty() && !key.contains(']'));
            let key = key.map_or_else(|| index.to_string(), str::to_owned);
            element(schema, cdr, field.kind, format!("{path}[{key}]"), to)?;
        }
    }
    Ok(())
}

fn element(
    schema: &Schema,
    cdr: &mut Cdr<'_>,
    kind: Kind,
    path: String,
    out: &mut Vec<String>,
) -> Result<(), String> {
    match kind {
        Kind::Struct(child) => return message(schema, cdr, child, &format!("{path}."), out),
        Kind::Text => {
            if cdr.text()?.trim().parse::<f64>().is_ok() {
                add(out, path);
            }
        }
        _ => {
            cdr.number(kind)?;
            add(out, path);
        }
    }
    Ok(())
}

fn add(out: &mut Vec<String>, name: String) {
    if out.len() < NAMES_MAX {
        out.push(name);
    }
}

/// The first string of a message that stands before anything of varying length: by it an element of
/// a list is named. A transform is named by its child, since its header is its parent's.
fn label<'a>(schema: &Schema, mut cdr: Cdr<'a>, kind: usize) -> Option<&'a str> {
    for field in schema.get(kind) {
        match (field.kind, field.count) {
            (Kind::Text, Count::One) => return cdr.text().ok(),
            (Kind::Struct(child), Count::One) => {
                message(schema, &mut cdr, child, "", &mut Vec::new()).ok()?;
            }
            (kind, Count::One) => cdr.skip(1, kind.size()?).ok()?,
            (kind, Count::Fixed(count)) => cdr.skip(count, kind.size()?).ok()?,
            (_, Count::Many) => return None,
        }
    }
    None
}

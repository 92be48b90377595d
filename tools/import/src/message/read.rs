//! Numbers of a message by their paths, in one pass over it. Nothing is allocated that grows with
//! the lengths that a message claims.

use super::cdr::Cdr;
use super::path::Hop;
use super::schema::{Count, Field, Kind, Schema};

/// A path that is still to be followed, and where its number goes.
type Want<'a> = (usize, &'a [Hop]);

/// Writes the number at each path to its place in `out`; what the message does not have stays.
///
/// # Errors
/// A message that does not fit its type.
pub(super) fn read(
    schema: &Schema,
    data: &[u8],
    paths: &[&[Hop]],
    out: &mut [Option<f64>],
) -> Result<(), String> {
    let wants: Vec<Want<'_>> = paths.iter().copied().enumerate().collect();
    let mut cdr = Cdr::new(data)?;
    Pass { schema, out }.message(&mut cdr, schema.root(), &wants)
}

struct Pass<'a> {
    schema: &'a Schema,
    out: &'a mut [Option<f64>],
}

impl Pass<'_> {
    fn put(&mut self, place: usize, value: Option<f64>) {
        if let Some(out) = self.out.get_mut(place) {
            *out = out.or(value);
        }
    }

    /// Reads all fields of a type.
    fn message(
        &mut self,
        cdr: &mut Cdr<'_>,
        kind: usize,
        wants: &[Want<'_>],
    ) -> Result<(), String> {
        let schema = self.schema;
        let fields = schema.get(kind);
        if fields.is_empty() {
            // A type without fields takes one byte (rosidl).
            return cdr.skip(1, 1);
        }
        let mut names = None;
        for (place, field) in fields.iter().enumerate() {
            let of_field = wants.iter().filter_map(|(to, hops)| match hops {
                [Hop::Field(at), rest @ ..] if *at == place => Some((*to, rest)),
                _ => None,
            });
            let of_field: Vec<Want<'_>> = of_field.collect();
            if is_names(field) {
                names = Some(*cdr);
            }
            match field.count {
                Count::One => self.element(cdr, field.kind, &of_field)?,
                Count::Fixed(count) => self.elements(cdr, (field.kind, count), names, &of_field)?,
                Count::Many => {
                    let count = cdr.length()?;
                    self.elements(cdr, (field.kind, count), names, &of_field)?;
                }
            }
        }
        Ok(())
    }

    /// Reads one value, or the fields of one message.
    fn element(&mut self, cdr: &mut Cdr<'_>, kind: Kind, wants: &[Want<'_>]) -> Result<(), String> {
        let value = match kind {
            Kind::Struct(child) => return self.message(cdr, child, wants),
            // A string that is a number is read as one: diagnostics are like this.
            Kind::Text => cdr.text()?.trim().parse().ok(),
            _ => Some(cdr.number(kind)?),
        };
        for (to, hops) in wants {
            self.put(*to, value.filter(|_| hops.is_empty()));
        }
        Ok(())
    }

    /// Reads the elements of a list. `names`: where the list of strings beside it begins.
    fn elements(
        &mut self,
        cdr: &mut Cdr<'_>,
        (kind, count): (Kind, usize),
        names: Option<Cdr<'_>>,
        wants: &[Want<'_>],
    ) -> Result<(), String> {
        cdr.fits(count)?;
        if let (Some(size), true) = (kind.size(), wants.is_empty()) {
            return cdr.skip(count, size);
        }
        let by_name = |key: &str| place_of(names?, key);
        let mut at_index: Vec<(usize, Want<'_>)> = Vec::new();
        for (to, hops) in wants {
            match hops {
                [Hop::Index(index), rest @ ..] => at_index.push((*index, (*to, rest))),
                [Hop::Key(key), rest @ ..] if kind.size().is_some() => {
                    at_index.extend(by_name(key).map(|index| (index, (*to, rest))));
                }
                _ => {}
            }
        }
        let mut own: Vec<Want<'_>> = Vec::new();
        for index in 0..count {
            own.clear();
            own.extend(
                at_index
                    .iter()
                    .filter(|(at, _)| *at == index)
                    .map(|(_, w)| *w),
            );
            if let Kind::Struct(child) = kind {
                for (to, hops) in wants {
                    if let [Hop::Key(key), rest @ ..] = hops
                        && has_text(self.schema, *cdr, child, key)?
                    {
                        own.push((*to, rest));
                    }
                }
            }
            self.element(cdr, kind, &own)?;
        }
        Ok(())
    }
}

/// True for a list of names, as joints have.
pub(super) fn is_names(field: &Field) -> bool {
    field.kind == Kind::Text && field.count == Count::Many
}

/// Place of a name in a list of strings.
fn place_of(mut names: Cdr<'_>, key: &str) -> Option<usize> {
    let count = names.length().ok()?;
    (0..count).find_map(|place| match names.text() {
        Ok(name) => (name == key).then_some(Some(place)),
        Err(_) => Some(None),
    })?
}

/// True if a message has a string of this value among its own fields.
fn has_text(schema: &Schema, mut cdr: Cdr<'_>, kind: usize, key: &str) -> Result<bool, String> {
    let mut pass = Pass {
        schema,
        out: &mut [],
    };
    for field in schema.get(kind) {
        match (field.kind, field.count) {
            (Kind::Text, Count::One) if cdr.text()? == key => return Ok(true),
            (Kind::Text, Count::One) => {}
            (kind, Count::One) => pass.element(&mut cdr, kind, &[])?,
            (kind, Count::Fixed(count)) => pass.elements(&mut cdr, (kind, count), None, &[])?,
            (kind, Count::Many) => {
                let count = cdr.length()?;
                pass.elements(&mut cdr, (kind, count), None, &[])?;
            }
        }
    }
    Ok(false)
}

//! Messages of ROS 2: any type whose definition is known, read by paths of fields.

mod cdr;
mod list;
mod path;
mod read;
mod schema;

use path::{Column, Hop};
pub(crate) use schema::Schema;

/// Columns of a type, found once and then read from every message.
pub(crate) struct Reader {
    schema: Schema,
    columns: Vec<Option<Column>>,
    values: Vec<Option<f64>>,
}

impl Reader {
    /// Finds columns in a type. One that is not there has no value in any message; the message
    /// says why.
    pub fn new(schema: Schema, columns: &[String]) -> (Self, Vec<Option<String>>) {
        let mut why = Vec::with_capacity(columns.len());
        let found = columns.iter().map(|column| {
            let found = path::resolve(&schema, column);
            why.push(found.as_ref().err().cloned());
            found.ok()
        });
        let columns = found.collect();
        let reader = Self {
            schema,
            columns,
            values: Vec::new(),
        };
        (reader, why)
    }

    /// The columns' values in a message, in their order; none for what it does not have.
    ///
    /// # Errors
    /// A message that does not fit its type.
    pub fn read(&mut self, data: &[u8]) -> Result<Vec<Option<f64>>, String> {
        let columns = self.columns.iter().flatten();
        let leaves: Vec<&[Hop]> = columns
            .flat_map(|column| column.leaves.iter().map(Vec::as_slice))
            .collect();
        self.values.clear();
        self.values.resize(leaves.len(), None);
        read::read(&self.schema, data, &leaves, &mut self.values)?;
        let mut values = self.values.as_slice();
        let value = |column: &Option<Column>| {
            let column = column.as_ref()?;
            let (own, rest) = values.split_at_checked(column.leaves.len())?;
            values = rest;
            let own = own.iter().copied().collect::<Option<Vec<f64>>>()?;
            column.combine.value(&own)
        };
        Ok(self.columns.iter().map(value).collect())
    }

    /// Names of all numbers in a message.
    pub fn names(&self, data: &[u8]) -> Vec<String> {
        list::names(&self.schema, data)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A type with all that makes reading hard, and columns into each part of it.
    const HARD: &str = "string[] name\nfloat64[] position\nPart[] parts\nPart[2] pair\n\
                        bool[] flags\nNothing nothing\nint16 last\n===\nMSG: my/Part\n\
                        std_msgs/Header header\nstring label\nuint8[3] bytes\n\
                        float32[<=4] few\n===\nMSG: my/Nothing\n";
    const COLUMNS: [&str; 6] = [
        "position[a]",
        "parts[b].few[1]",
        "parts[0].header.stamp",
        "pair[1].bytes[2]",
        "flags[1]",
        "last",
    ];

    fn reader(kind: &str, definition: &str, columns: &[&str]) -> Reader {
        let schema = Schema::parse(kind, definition).unwrap();
        let columns: Vec<String> = columns.iter().map(|&column| column.to_owned()).collect();
        let (reader, why) = Reader::new(schema, &columns);
        assert!(why.iter().all(Option::is_none), "{why:?}");
        reader
    }

    /// A message of the hard type, little-endian, by hand.
    fn hard_message() -> Vec<u8> {
        let mut body: Vec<u8> = Vec::new();
        let pad = |body: &mut Vec<u8>, to: usize| {
            body.resize(body.len().next_multiple_of(to), 0);
        };
        let text = |body: &mut Vec<u8>, text: &str| {
            body.resize(body.len().next_multiple_of(4), 0);
            body.extend((text.len() as u32 + 1).to_le_bytes());
            body.extend(text.bytes().chain([0]));
        };
        body.extend(2_u32.to_le_bytes());
        text(&mut body, "z");
        text(&mut body, "a");
        pad(&mut body, 4);
        body.extend(2_u32.to_le_bytes());
        pad(&mut body, 8);
        body.extend([7.0_f64, 8.5].iter().flat_map(|v| v.to_le_bytes()));
        body.extend(1_u32.to_le_bytes());
        for (i, label) in ["b", "c", "d"].iter().enumerate() {
            pad(&mut body, 4);
            body.extend((10 + i as u32).to_le_bytes());
            body.extend(5_u32.to_le_bytes());
            text(&mut body, "frame");
            text(&mut body, label);
            body.extend([1, 2, 3 + i as u8]);
            pad(&mut body, 4);
            body.extend(2_u32.to_le_bytes());
            body.extend([0.5_f32, 1.5].iter().flat_map(|v| v.to_le_bytes()));
        }
        body.extend(2_u32.to_le_bytes());
        // Two flags, a type without fields, and a number at the next even place.
        body.extend([0, 1, 0]);
        pad(&mut body, 2);
        body.extend((-3_i16).to_le_bytes());
        [&[0, 1, 0, 0], body.as_slice()].concat()
    }

    #[test]
    fn every_part_of_a_type_is_read_from_its_definition() {
        let mut reader = reader("my/msg/Hard", HARD, &COLUMNS);
        let found = reader.read(&hard_message()).unwrap();
        let wanted = [8.5, 1.5, 10e9 + 5.0, 5.0, 1.0, -3.0];
        assert_eq!(found, wanted.map(Some));
        let names = reader.names(&hard_message());
        for name in [
            "position[z]",
            "parts[b].few[0]",
            "pair[d].header.stamp",
            "last",
        ] {
            assert!(names.iter().any(|n| n == name), "{name}: {names:?}");
        }
        // Cut anywhere it is refused; with other names the columns are not there.
        let whole = hard_message();
        for end in 0..whole.len() {
            assert!(reader.read(&whole[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn strings_of_numbers_and_elements_by_name_are_found() {
        let mut reader = reader("diagnostic_msgs/msg/KeyValue", "", &["value"]);
        let message = |value: &str| {
            let mut data = vec![0, 1, 0, 0, 2, 0, 0, 0, b'k', 0, 0, 0];
            data.extend((value.len() as u32 + 1).to_le_bytes());
            data.extend(value.bytes().chain([0]));
            data
        };
        assert_eq!(reader.read(&message("12.6")).unwrap(), [Some(12.6)]);
        assert_eq!(reader.read(&message("full")).unwrap(), [None]);
    }

    proptest! {
        /// Any bytes, and any change of a good message, give values or a refusal.
        #[test]
        fn no_bytes_break_the_reader(
            bytes in prop::collection::vec(any::<u8>(), 0..300),
            at in 0_usize..200,
            value in any::<u8>(),
        ) {
            let mut reader = reader("my/msg/Hard", HARD, &COLUMNS);
            let _ = reader.read(&bytes);
            let _ = reader.names(&bytes);
            let mut framed = vec![0, 1, 0, 0];
            framed.extend(&bytes);
            let _ = reader.read(&framed);
            let _ = reader.names(&framed);
            let mut message = hard_message();
            if let Some(byte) = message.get_mut(at) {
                *byte = value;
            }
            let _ = reader.read(&message);
            let _ = reader.names(&message);
        }

        /// Any text of lines that look like definitions is read or refused, and so is any path.
        #[test]
        fn no_definition_and_no_path_break_the_reader(
            text in "((float64|string|Part|my/Part|bool)(\\[\\]|\\[[0-9]{1,9}\\]|) [a-z]{1,2}\n|\
                     MSG: my/Part\n|===\n|[ -~]{0,12}\n){0,12}",
            path in "[a-z.\\[\\]0-9]{0,12}",
            bytes in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            if let Ok(schema) = Schema::parse("my/msg/Hard", &text) {
                let (mut reader, _) = Reader::new(schema, &[path]);
                let mut framed = vec![0, 1, 0, 0];
                framed.extend(&bytes);
                let _ = reader.read(&framed);
                let _ = reader.names(&framed);
            }
        }
    }
}

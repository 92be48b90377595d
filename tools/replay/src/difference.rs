//! Where two blocks are not the same.

use vigil_blocks::layout::{Field, Layout};
use vigil_blocks::{Block, BlockId, Carryover, FaultRecord, FaultSet};

/// Fields that belong to the ports, not to the step.
const OF_THE_PORTS: [&str; 3] = ["header", "cause", "valid_until_ns"];

/// What blocks are made of, beside numbers.
const PARTS: [(&str, &[Field]); 3] = [
    (Carryover::NAME, Carryover::FIELDS),
    (FaultRecord::NAME, FaultRecord::FIELDS),
    (FaultSet::NAME, FaultSet::FIELDS),
];

/// The first place in which something recorded and something computed differ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The recorded block; after which block of the journal, for a state.
    pub block: BlockId,
    /// Name of the field, with the element's index for an array; of a state, from which byte
    /// on.
    pub field: String,
    /// What was recorded.
    pub recorded: String,
    /// What was computed.
    pub computed: String,
}

/// The first field that is not the same, bit by bit.
pub(crate) fn of_blocks<T: Block + Layout>(recorded: &T, computed: &T) -> Option<Difference> {
    let block = recorded.header().id();
    let (recorded, computed) = (bytemuck::bytes_of(recorded), bytemuck::bytes_of(computed));
    let fields = T::FIELDS.iter();
    let mut compared = fields.filter(|field| !OF_THE_PORTS.contains(&field.name));
    let place = compared.find_map(|field| in_field(field, recorded, computed))?;
    Some(Difference {
        block,
        field: place.field,
        recorded: place.recorded,
        computed: place.computed,
    })
}

/// Where two states, which were handed out after this block of the journal, are not the same
/// first, and the eight bytes there.
pub(crate) fn of_states(block: BlockId, recorded: &[u8], computed: &[u8]) -> Difference {
    let same = recorded.iter().zip(computed).take_while(|(a, b)| a == b);
    let at = same.count();
    let words = |bytes: &[u8]| {
        let rest = bytes.get(at..).unwrap_or_default().iter().take(8);
        let hex: String = rest.map(|byte| format!("{byte:02x}")).collect();
        format!("{hex} ({} bytes)", bytes.len())
    };
    Difference {
        block,
        field: format!("state, from byte {at} on"),
        recorded: words(recorded),
        computed: words(computed),
    }
}

/// A number that is not the same.
struct Place {
    field: String,
    recorded: String,
    computed: String,
}

/// The first number of a field that is not the same, in the bytes that the field lies in.
fn in_field(field: &Field, recorded: &[u8], computed: &[u8]) -> Option<Place> {
    let range = field.offset..field.offset + field.size;
    let (recorded, computed) = (recorded.get(range.clone())?, computed.get(range)?);
    let (is_array, element) = match field.type_text.strip_prefix('[') {
        Some(array) => (true, array.split(';').next().unwrap_or_default()),
        None => (false, field.type_text),
    };
    let part = PARTS.iter().find(|(name, _)| *name == element);
    let fields = part.map_or(&[][..], |(_, fields)| fields);
    let size = match element {
        "f64" | "u64" => 8,
        "u32" => 4,
        "u16" => 2,
        "u8" => 1,
        _ => fields.last().map_or(8, |last| last.offset + last.size),
    };
    let pairs = recorded.chunks(size).zip(computed.chunks(size));
    let (index, (recorded, computed)) = pairs.enumerate().find(|(_, (a, b))| a != b)?;
    let name = match is_array {
        true => format!("{}[{index}]", field.name),
        false => field.name.to_owned(),
    };
    let inner = fields
        .iter()
        .find_map(|field| in_field(field, recorded, computed));
    Some(match inner {
        Some(inner) => Place {
            field: format!("{name}.{}", inner.field),
            ..inner
        },
        None => Place {
            field: name,
            recorded: number(element, recorded),
            computed: number(element, computed),
        },
    })
}

/// A number in words; bytes of anything else.
fn number(of: &str, bytes: &[u8]) -> String {
    let mut wide = [0; 8];
    wide.iter_mut()
        .zip(bytes)
        .for_each(|(to, byte)| *to = *byte);
    let whole = u64::from_le_bytes(wide);
    match of {
        "f64" => format!("{:?} ({whole:016x})", f64::from_bits(whole)),
        "u64" | "u32" | "u16" | "u8" => whole.to_string(),
        _ => format!("bytes {whole:016x}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::{DetectionBelief, Faults};

    #[test]
    fn the_first_field_that_differs_is_named() {
        let recorded = DetectionBelief::default();
        let mut computed = recorded;
        computed.header.seq = 7;
        assert_eq!(of_blocks(&recorded, &computed), None);
        computed.alarm_count = 3;
        computed.channel_log_odds[2] = -0.0;
        let found = of_blocks(&recorded, &computed).unwrap();
        assert_eq!(found.field, "channel_log_odds[2]");
        let bits = (found.recorded.as_str(), found.computed.as_str());
        assert_eq!(bits, ("0.0 (0000000000000000)", "-0.0 (8000000000000000)"));
        computed.channel_log_odds[2] = 0.0;
        let found = of_blocks(&recorded, &computed).unwrap();
        let values = (found.recorded.as_str(), found.computed.as_str());
        let said = (found.field.as_str(), values.0, values.1);
        assert_eq!(said, ("alarm_count", "0", "3"));
    }

    #[test]
    fn a_field_of_a_part_is_named_with_its_place() {
        let recorded = Faults::default();
        let mut computed = recorded;
        computed.records[3].channel[2] = 1.0;
        let found = of_blocks(&recorded, &computed).unwrap();
        assert_eq!(found.field, "records[3].channel[2]");
        computed.records[3].p = 0.5;
        let found = of_blocks(&recorded, &computed).unwrap();
        assert_eq!(found.field, "records[3].p");
    }
}

//! State is saved and loaded to the last bit; whatever else is read is refused, by name.
#![cfg(test)]

use std::collections::VecDeque;

use nalgebra::{Complex, Matrix2x3};
use proptest::prelude::{any, proptest};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_checkpoint::{
    Checkpoint, CheckpointError, CheckpointReader, CheckpointValue, CheckpointWriter,
};

/// A value of its own.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
enum Kind {
    Nothing,
    Number(f64),
    Pair { first: u32, second: Option<u16> },
}

/// A step's state, with parts that follow from its configuration.
#[derive(Debug, Clone, PartialEq, Checkpoint)]
struct State {
    #[checkpoint(fixed)]
    limit: usize,
    matrix: Matrix2x3<f64>,
    number: Complex<f64>,
    kinds: Vec<Kind>,
    pairs: VecDeque<(u64, bool)>,
    rng: Pcg64Mcg,
    #[checkpoint(each)]
    parts: Vec<Part>,
    way: Way,
    boxed: Box<[i32; 3]>,
}

#[derive(Debug, Clone, PartialEq, Checkpoint)]
struct Part {
    #[checkpoint(fixed)]
    name: String,
    count: u64,
}

/// Which one follows from the configuration.
#[derive(Debug, Clone, PartialEq, Checkpoint)]
enum Way {
    Short(f64),
    Long { steps: Vec<f64> },
}

fn state() -> State {
    let part = |name: &str, count| Part {
        name: name.to_owned(),
        count,
    };
    State {
        limit: 7,
        matrix: Matrix2x3::new(1.0, -0.0, f64::MIN_POSITIVE, f64::INFINITY, 0.1, 3.0),
        number: Complex::new(0.5, -2.0),
        kinds: vec![
            Kind::Nothing,
            Kind::Number(-0.25),
            Kind::Pair {
                first: 9,
                second: Some(4),
            },
        ],
        pairs: VecDeque::from([(5, true), (6, false)]),
        rng: Pcg64Mcg::seed_from_u64(3),
        parts: vec![part("a", 1), part("b", 2)],
        way: Way::Long {
            steps: vec![1.0, 2.0],
        },
        boxed: Box::new([-1, 0, 1]),
    }
}

/// Another state of the same configuration.
fn other() -> State {
    let mut other = state();
    other.matrix.fill(0.0);
    other.kinds.clear();
    other.pairs.clear();
    other.rng = Pcg64Mcg::seed_from_u64(8);
    other.parts.iter_mut().for_each(|part| part.count = 0);
    other.way = Way::Long { steps: Vec::new() };
    *other.boxed = [0; 3];
    other
}

fn saved(state: &impl Checkpoint) -> Vec<u8> {
    let mut buffer = vec![0; 1 << 12];
    let mut writer = CheckpointWriter::new(&mut buffer);
    state.save(&mut writer);
    let bytes = writer.finish().unwrap();
    buffer.truncate(bytes);
    buffer
}

fn load(state: &mut impl Checkpoint, bytes: &[u8]) -> Result<(), CheckpointError> {
    let mut reader = CheckpointReader::new(bytes);
    state.load(&mut reader);
    reader.finish()
}

#[test]
fn a_loaded_state_goes_on_as_the_saved_one() {
    let (mut before, mut after) = (state(), other());
    before.rng.random::<u64>();
    load(&mut after, &saved(&before)).unwrap();
    assert_eq!(after, before);
    assert_eq!(saved(&after), saved(&before));
    assert_eq!(after.rng.random::<u64>(), before.rng.random::<u64>());
}

#[test]
fn not_a_number_keeps_its_bits() {
    let quiet = f64::from_bits(0x7ff8_0000_0000_1234);
    let mut loaded = [0.0; 2];
    load(&mut loaded, &saved(&[quiet, -0.0])).unwrap();
    assert_eq!(loaded.map(f64::to_bits), [quiet, -0.0].map(f64::to_bits));
}

#[test]
fn a_state_of_another_version_or_configuration_is_refused_by_name() {
    let misfit = |type_name| Err(CheckpointError::Misfit { type_name });
    let mut short = state();
    short.way = Way::Short(1.0);
    assert_eq!(load(&mut short, &saved(&state())), misfit("Way"));
    let mut fewer = state();
    fewer.parts.pop();
    let refused = load(&mut fewer, &saved(&state()));
    assert_eq!(refused, misfit("a collection of fixed length"));
    let mut bytes = saved(&state());
    bytes[0] ^= 1;
    assert_eq!(load(&mut state(), &bytes), misfit("State"));
}

#[test]
fn a_state_that_is_cut_or_too_long_is_refused() {
    let mut bytes = saved(&state());
    bytes.push(0);
    assert_eq!(
        load(&mut other(), &bytes),
        Err(CheckpointError::Left { bytes: 1 })
    );
    for length in 0..bytes.len() - 1 {
        assert!(load(&mut other(), &bytes[..length]).is_err(), "{length}");
    }
}

#[test]
fn a_buffer_that_is_too_small_is_left_within_its_bounds() {
    let whole = saved(&state());
    let mut buffer = vec![0; whole.len() - 1];
    let mut writer = CheckpointWriter::new(&mut buffer);
    state().save(&mut writer);
    let (bytes, capacity) = (whole.len(), whole.len() - 1);
    assert_eq!(
        writer.finish(),
        Err(CheckpointError::Full { bytes, capacity })
    );
}

proptest! {
    #[test]
    fn any_bytes_are_read_without_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = load(&mut other(), &bytes);
    }

    #[test]
    fn a_damaged_state_is_read_without_a_panic(at in 0_usize..300, byte in any::<u8>()) {
        let mut bytes = saved(&state());
        let at = at % bytes.len();
        bytes[at] = byte;
        let _ = load(&mut other(), &bytes);
    }
}

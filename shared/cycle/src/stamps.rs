//! The instants of every cycle of a service, kept in memory and written when it stops.
//!
//! What a histogram cannot say: which cycle was late, when, and where its time went. Files hold
//! records of four 64-bit little-endian numbers, [`CycleStamps`] in the order of its fields.

use std::io;
use std::path::Path;

/// Instants of one cycle, `CLOCK_MONOTONIC` ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CycleStamps {
    /// When the cycle was due.
    pub t_schedule_ns: u64,
    /// When its input was published; the schedule for a source.
    pub t_input_ns: u64,
    /// When the service was awake.
    pub t_wake_ns: u64,
    /// When its block was published.
    pub t_publish_ns: u64,
}

/// Bytes of one record in a file.
const RECORD: usize = 32;

/// The stamps of the last cycles, in a buffer made once.
#[derive(Debug, Clone)]
pub struct Stamps {
    records: Vec<CycleStamps>,
    next: usize,
    count: u64,
}

impl Stamps {
    /// Room for `capacity` cycles, at least 1; every page is touched now and not in a cycle.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        let touched = CycleStamps {
            t_schedule_ns: u64::MAX,
            ..CycleStamps::default()
        };
        Self {
            records: vec![touched; capacity.max(1)],
            next: 0,
            count: 0,
        }
    }

    /// Keeps the stamps of a cycle; the oldest gives way. Allocates nothing.
    pub fn push(&mut self, stamps: CycleStamps) {
        assert!(
            self.count % self.records.len() as u64 == self.next as u64,
            "the ring's place follows from the cycles kept"
        );
        self.records[self.next] = stamps;
        self.next = (self.next + 1) % self.records.len();
        self.count += 1;
    }

    /// The kept stamps, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &CycleStamps> {
        let is_full = self.count >= self.records.len() as u64;
        let (newer, older) = self.records.split_at(self.next);
        let older = if is_full { older } else { &[] };
        older.iter().chain(newer)
    }

    /// Writes the kept stamps to a file.
    ///
    /// # Errors
    /// The file system's.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(self.records.len() * RECORD);
        for stamps in self.iter() {
            for ns in [
                stamps.t_schedule_ns,
                stamps.t_input_ns,
                stamps.t_wake_ns,
                stamps.t_publish_ns,
            ] {
                bytes.extend_from_slice(&ns.to_le_bytes());
            }
        }
        std::fs::write(path, bytes)
    }
}

/// Reads the stamps that a service has written.
///
/// # Errors
/// The file system's; [`io::ErrorKind::InvalidData`] if the file ends within a record.
pub fn read(path: &Path) -> io::Result<Vec<CycleStamps>> {
    let bytes = std::fs::read(path)?;
    if !bytes.len().is_multiple_of(RECORD) {
        let what = format!("{} bytes are no whole number of records", bytes.len());
        return Err(io::Error::new(io::ErrorKind::InvalidData, what));
    }
    let number = |record: &[u8], field: usize| {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&record[8 * field..8 * field + 8]);
        u64::from_le_bytes(bytes)
    };
    let stamps = |record: &[u8]| CycleStamps {
        t_schedule_ns: number(record, 0),
        t_input_ns: number(record, 1),
        t_wake_ns: number(record, 2),
        t_publish_ns: number(record, 3),
    };
    Ok(bytes.chunks_exact(RECORD).map(stamps).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(k: u64) -> CycleStamps {
        CycleStamps {
            t_schedule_ns: k,
            t_input_ns: k + 1,
            t_wake_ns: k + 2,
            t_publish_ns: u64::MAX - k,
        }
    }

    #[test]
    fn the_last_cycles_are_kept_in_order_and_survive_a_file() {
        let path = std::env::temp_dir().join(format!("stamps-{}", std::process::id()));
        for pushed in [0, 1, 4, 5, 6, 13] {
            let mut stamps = Stamps::new(5);
            (0..pushed).for_each(|k| stamps.push(at(k)));
            stamps.write(&path).unwrap();
            let expected: Vec<_> = (pushed.saturating_sub(5)..pushed).map(at).collect();
            assert_eq!(read(&path).unwrap(), expected, "{pushed} pushed");
        }
        std::fs::write(&path, [0; 33]).unwrap();
        assert!(read(&path).is_err());
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    #[should_panic(expected = "the ring's place follows from the cycles kept")]
    fn a_ring_that_has_lost_its_place_is_found() {
        let mut stamps = Stamps::new(5);
        stamps.next = 3;
        stamps.push(at(0));
    }
}

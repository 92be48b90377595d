//! Blocks as datagrams, for publishers without shared memory, on this machine or another: sensor
//! frames to the graph, verdicts back.
//!
//! All numbers little-endian.
//!
//! | offset | bytes | holds |
//! |---|---|---|
//! | 0 | 4 | the letters `VGIL` |
//! | 4 | 2 | version of this format, 2 |
//! | 6 | 2 | what follows: 1, a [`SensorFrame`]; 2, a [`Verdict`] |
//! | 8 | 4 | bytes that follow after the checksum: 576 or 288 |
//! | 12 | 4 | CRC-32C (Castagnoli) over bytes 0 to 11 and all that follow |
//! | 16 | 576 or 288 | the block, laid out as in shared memory |
//!
//! In the frame's header the sender fills in schema, epoch (any number but 0, another one at each
//! start), sequence number and capture time (its own clock: only differences count). A
//! `t_schedule_ns` of 0 means that the sender does not have this machine's clock: it is
//! found from the capture time and the quickest arrival so far.

use bytemuck::AnyBitPattern;
use crc::{CRC_32_ISCSI, Crc};

use crate::rejection::Rejection;
use crate::sensor::SensorFrame;
use crate::verdict::Verdict;

#[cfg(target_endian = "big")]
compile_error!("blocks and datagrams are little-endian");

/// Bytes before the block.
const HEAD: usize = 16;
/// Bytes of the head that the checksum covers.
const COVERED: usize = 12;
/// Bytes of the datagram of a [`SensorFrame`].
pub const DATAGRAM_SIZE: usize = HEAD + size_of::<SensorFrame>();
/// Bytes of the datagram of a [`Verdict`].
pub const VERDICT_DATAGRAM_SIZE: usize = HEAD + size_of::<Verdict>();

const MARK: [u8; 4] = *b"VGIL";
const VERSION: u16 = 2;
const SENSOR_FRAME: u16 = 1;
const VERDICT: u16 = 2;

// A sliced table: 600 bytes take a microsecond or less.
const CRC: Crc<u32, crc::Table<16>> = Crc::<u32, crc::Table<16>>::new(&CRC_32_ISCSI);

/// The datagram of a frame.
#[must_use]
pub fn encode(frame: &SensorFrame) -> [u8; DATAGRAM_SIZE] {
    wrapped(SENSOR_FRAME, bytemuck::bytes_of(frame))
}

/// The datagram of a verdict.
#[must_use]
pub fn encode_verdict(verdict: &Verdict) -> [u8; VERDICT_DATAGRAM_SIZE] {
    wrapped(VERDICT, bytemuck::bytes_of(verdict))
}

/// The frame of a datagram; its content is not judged.
///
/// # Errors
/// [`Rejection::Malformed`] for wrong length, mark, version or kind, [`Rejection::Corrupt`] for a
/// wrong checksum.
pub fn decode(bytes: &[u8]) -> Result<SensorFrame, Rejection> {
    unwrapped(SENSOR_FRAME, bytes)
}

/// The verdict of a datagram.
///
/// # Errors
/// As [`decode`].
pub fn decode_verdict(bytes: &[u8]) -> Result<Verdict, Rejection> {
    unwrapped(VERDICT, bytes)
}

fn wrapped<const N: usize>(kind: u16, block: &[u8]) -> [u8; N] {
    let mut bytes = [0; N];
    bytes[HEAD..].copy_from_slice(block);
    bytes[..COVERED].copy_from_slice(&head(kind, block.len()));
    let sum = checksum(&bytes);
    bytes[COVERED..HEAD].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn unwrapped<T: AnyBitPattern>(kind: u16, bytes: &[u8]) -> Result<T, Rejection> {
    let size = size_of::<T>();
    if bytes.len() != HEAD + size || bytes[..COVERED] != head(kind, size) {
        return Err(Rejection::Malformed);
    }
    if bytes[COVERED..HEAD] != checksum(bytes).to_le_bytes() {
        return Err(Rejection::Corrupt);
    }
    Ok(bytemuck::pod_read_unaligned(&bytes[HEAD..]))
}

fn head(kind: u16, size: usize) -> [u8; COVERED] {
    let mut head = [0; COVERED];
    head[..4].copy_from_slice(&MARK);
    head[4..6].copy_from_slice(&VERSION.to_le_bytes());
    head[6..8].copy_from_slice(&kind.to_le_bytes());
    head[8..].copy_from_slice(&(size as u32).to_le_bytes());
    head
}

fn checksum(bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&bytes[..COVERED]);
    digest.update(&bytes[HEAD..]);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Block;

    fn frame() -> SensorFrame {
        let mut frame = SensorFrame::default();
        frame.header.schema = SensorFrame::SCHEMA;
        (frame.header.epoch, frame.header.seq) = (7, 11);
        frame.set_channel(2, -2.0);
        frame
    }

    #[test]
    fn the_checksum_is_castagnolis() {
        // The check value of the catalogue of parametrised CRC algorithms.
        assert_eq!(CRC.checksum(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn a_frame_survives_and_lies_where_the_table_says() {
        let bytes = encode(&frame());
        assert_eq!(decode(&bytes).unwrap(), frame());
        assert_eq!(bytes[..12], *b"VGIL\x02\0\x01\0\x40\x02\0\0");
        assert_eq!(bytes[16 + 8..16 + 16], 7_u64.to_le_bytes());
    }

    #[test]
    fn a_verdict_survives_and_is_no_frame() {
        let verdict = Verdict {
            mode_name: crate::fixed_name("LF_STUCK"),
            p_fault: 0.75,
            ..Verdict::default()
        };
        let bytes = encode_verdict(&verdict);
        assert_eq!(decode_verdict(&bytes), Ok(verdict));
        assert_eq!(decode(&bytes), Err(Rejection::Malformed));
        assert_eq!(decode_verdict(&encode(&frame())), Err(Rejection::Malformed));
    }

    #[test]
    fn every_flipped_bit_is_found() {
        let good = encode(&frame());
        for bit in 0..8 * DATAGRAM_SIZE {
            let mut bytes = good;
            bytes[bit / 8] ^= 1 << (bit % 8);
            let expected = if bit / 8 < COVERED {
                Rejection::Malformed
            } else {
                Rejection::Corrupt
            };
            assert_eq!(decode(&bytes), Err(expected), "bit {bit}");
        }
    }

    #[test]
    fn every_wrong_length_is_found() {
        let good = encode(&frame());
        let mut long = good.to_vec();
        long.push(0);
        assert_eq!(decode(&long), Err(Rejection::Malformed));
        for length in 0..DATAGRAM_SIZE {
            assert_eq!(decode(&good[..length]), Err(Rejection::Malformed));
        }
    }
}

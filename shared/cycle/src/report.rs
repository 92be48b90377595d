//! What a service leaves behind when it stops: its histograms, for the launcher's summary.
//!
//! The only user of bincode. Layout: magic, format version, CRC-32 of the payload, payload in
//! bincode's legacy encoding (little endian, fixed-width integers). Cold path only.

use std::io;
use std::path::Path;

use hdrhistogram::Histogram;
use hdrhistogram::serialization::{Deserializer, Serializer, V2Serializer};
use serde::{Deserialize, Serialize};

use crate::latency::{Latency, Percentiles};
use crate::placement;
use crate::recorder::Timing;

const MAGIC: [u8; 4] = *b"VGRP";
const VERSION: u32 = 2;
/// Largest payload that is decoded, bytes: far more than a run has. A damaged length must not
/// exhaust the memory.
const PAYLOAD_MAX: usize = 4 << 20;

/// Histograms and counters of one run of a service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Name of the service.
    pub service: String,
    /// From the publication of the input to the wake-up.
    pub wake_up: StoredHistogram,
    /// From the wake-up to the publication of the output.
    pub step: StoredHistogram,
    /// From the schedule to the publication of the output.
    pub from_schedule: StoredHistogram,
    /// Minor and major page faults in the steady state, after the first 200 cycles; `None` if it
    /// did not come to that.
    pub page_faults: Option<[u64; 2]>,
    /// Timer slack of the thread that cycles, ns; 0 where a real-time class has none.
    pub timer_slack_ns: Option<u64>,
}

/// A histogram in a file: its percentiles, and all of it in HdrHistogram's V2 form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoredHistogram {
    /// What a person reads.
    pub percentiles: Percentiles,
    /// V2 serialisation.
    pub histogram_v2: Vec<u8>,
}

/// Why a report was refused.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file could not be read or written.
    #[error("report: {0}")]
    Io(#[from] io::Error),
    /// The file is not a report of this version, or damaged.
    #[error("report: {0}")]
    Format(String),
}

impl StoredHistogram {
    /// Stores a histogram.
    ///
    /// # Errors
    /// [`ReportError::Format`] if it cannot be serialised.
    pub fn new(latency: &Latency) -> Result<Self, ReportError> {
        let mut histogram_v2 = Vec::new();
        V2Serializer::new()
            .serialize(latency.histogram(), &mut histogram_v2)
            .map_err(|e| ReportError::Format(e.to_string()))?;
        Ok(Self {
            percentiles: latency.percentiles(),
            histogram_v2,
        })
    }

    /// The whole histogram.
    ///
    /// # Errors
    /// [`ReportError::Format`] if the bytes are not a V2 histogram.
    pub fn histogram(&self) -> Result<Histogram<u64>, ReportError> {
        Deserializer::new()
            .deserialize(&mut self.histogram_v2.as_slice())
            .map_err(|e| ReportError::Format(e.to_string()))
    }
}

impl RunReport {
    /// A report of `service`'s timing, by the thread that cycles.
    ///
    /// # Errors
    /// [`ReportError::Format`] if a histogram cannot be serialised.
    pub fn new(
        service: &str,
        timing: &Timing,
        page_faults: Option<[u64; 2]>,
    ) -> Result<Self, ReportError> {
        Ok(Self {
            service: service.to_owned(),
            wake_up: StoredHistogram::new(&timing.wake_up)?,
            step: StoredHistogram::new(&timing.step)?,
            from_schedule: StoredHistogram::new(&timing.from_schedule)?,
            page_faults,
            timer_slack_ns: placement::timer_slack_ns(),
        })
    }

    /// Encodes the report.
    ///
    /// # Errors
    /// [`ReportError::Format`] if it is too large.
    pub fn encode(&self) -> Result<Vec<u8>, ReportError> {
        let payload = bincode::serde::encode_to_vec(self, bincode::config::legacy())
            .map_err(|e| ReportError::Format(e.to_string()))?;
        let mut bytes = Vec::with_capacity(payload.len() + 12);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(crc32fast::hash(&payload).to_le_bytes());
        bytes.extend(payload);
        Ok(bytes)
    }

    /// Decodes a report.
    ///
    /// # Errors
    /// [`ReportError::Format`] naming what is wrong: magic, version, checksum or content.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let wrong = |what: String| Err(ReportError::Format(what));
        let word = |at: usize| {
            bytes
                .get(at..at + 4)
                .and_then(|b| b.try_into().ok())
                .map(u32::from_le_bytes)
        };
        if bytes.get(..4) != Some(MAGIC.as_slice()) {
            return wrong("not a run report".into());
        }
        if word(4) != Some(VERSION) {
            return wrong(format!(
                "version {:?}, this program reads {VERSION}",
                word(4)
            ));
        }
        let payload = bytes.get(12..).unwrap_or_default();
        if word(8) != Some(crc32fast::hash(payload)) {
            return wrong("checksum mismatch: the file is damaged".into());
        }
        let config = bincode::config::legacy().with_limit::<PAYLOAD_MAX>();
        match bincode::serde::decode_from_slice(payload, config) {
            Ok((report, _)) => Ok(report),
            Err(error) => wrong(error.to_string()),
        }
    }

    /// Writes the report to `path`.
    ///
    /// # Errors
    /// The file system's, or the encoding's.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        Ok(std::fs::write(path, self.encode()?)?)
    }

    /// Reads a report from `path`.
    ///
    /// # Errors
    /// The file system's, or the decoding's.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        Self::decode(&std::fs::read(path)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> RunReport {
        let mut timing = Timing::new().unwrap();
        (1..=1000).for_each(|us| timing.step.record(us * 1000));
        RunReport::new("detector", &timing, Some([3, 0])).unwrap()
    }

    #[test]
    fn a_report_comes_back_whole_with_its_histogram() {
        let back = RunReport::decode(&report().encode().unwrap()).unwrap();
        assert_eq!(back, report());
        let histogram = back.step.histogram().unwrap();
        assert_eq!(histogram.len(), 1000);
        assert!((histogram.value_at_quantile(0.5) as f64 / 500_000.0 - 1.0).abs() < 2e-3);
    }

    #[test]
    fn the_envelope_is_pinned_byte_by_byte() {
        let bytes = report().encode().unwrap();
        assert_eq!(&bytes[..8], b"VGRP\x02\0\0\0");
        assert_eq!(bytes[8..12], crc32fast::hash(&bytes[12..]).to_le_bytes());
        // Legacy encoding: the name's length as u64, then its bytes.
        assert_eq!(&bytes[12..28], b"\x08\0\0\0\0\0\0\0detector");
    }

    #[test]
    fn damage_truncation_and_foreign_files_are_refused() {
        let good = report().encode().unwrap();
        for cut in [0, 3, 11, 40, good.len() - 1] {
            assert!(RunReport::decode(&good[..cut]).is_err());
        }
        for at in [0, 5, 9, 20, good.len() - 1] {
            let mut bad = good.clone();
            bad[at] ^= 0x40;
            assert!(RunReport::decode(&bad).is_err());
        }
    }
}

//! When a message was.

use vigil_blocks::Header;
use vigil_timeline::WallClock;

/// Longest time from capture to publication that is believed, ns. Chosen by hand: a graph whose
/// stages are that late has failed; the capture times of a playback lie further off.
const CAPTURE_AGE_MAX_NS: u64 = 10_000_000_000;

/// When a message was, since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MessageTimes {
    /// When its block was published, ns.
    pub(crate) log_ns: u64,
    /// When its data was captured, ns; the same as `log_ns` where that is not known.
    pub(crate) capture_ns: u64,
    /// Sequence number of its block, from which the upper half is cut.
    pub(crate) sequence: u32,
}

impl MessageTimes {
    /// Those of a block.
    pub(crate) fn new(header: &Header, clock: &WallClock) -> Self {
        let (published_ns, captured_ns) = (header.t_publish_ns, header.t_capture_ns);
        let age_ns = published_ns.checked_sub(captured_ns);
        let is_plausible = age_ns.is_some_and(|age_ns| age_ns <= CAPTURE_AGE_MAX_NS);
        let captured_ns = if is_plausible {
            captured_ns
        } else {
            published_ns
        };
        Self {
            log_ns: clock.unix_ns(published_ns),
            capture_ns: clock.unix_ns(captured_ns),
            sequence: header.seq as u32,
        }
    }

    /// Those of something that is no block.
    pub(crate) const fn at(log_ns: u64) -> Self {
        Self {
            log_ns,
            capture_ns: log_ns,
            sequence: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capture_time_counts_if_it_is_shortly_before_the_publication() {
        let clock = WallClock::ahead_by(1_000);
        let times = |t_capture_ns| {
            let header = Header {
                seq: (1 << 32) + 5,
                t_publish_ns: 20_000_000_000,
                t_capture_ns,
                ..Header::default()
            };
            MessageTimes::new(&header, &clock)
        };
        assert_eq!(times(19_999_000_000).capture_ns, 19_999_001_000);
        assert_eq!(times(19_999_000_000).log_ns, 20_000_001_000);
        assert_eq!(times(19_999_000_000).sequence, 5);
        assert_eq!(times(20_000_000_001).capture_ns, 20_000_001_000);
        assert_eq!(times(3).capture_ns, 20_000_001_000);
    }
}

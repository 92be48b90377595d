//! Accounting of input blocks by (epoch, sequence number), and refusal of impossible headers.

use vigil_blocks::{Block, Header};

/// A scheduled instant may be ahead of the reader's clock by this much at most, in periods.
const AHEAD_PERIODS_MAX: u64 = 2;
/// A scheduled instant may lie this far in the past, ns: older blocks are not of this drive, or of
/// another clock.
const BEHIND_NS_MAX: u64 = 10_000_000_000;

/// What an input block is, by its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// The next in sequence, or the first of all.
    Next,
    /// The first of a new epoch: the writer has restarted.
    NewEpoch,
    /// In sequence after this many lost ones.
    AfterGap(u64),
    /// Seen before, or older than one seen before: not to be taken.
    Duplicate,
    /// Impossible: wrong schema, or scheduled in the future or long ago. Not to be taken.
    Invalid,
}

impl Arrival {
    /// True if the block is to be taken.
    #[must_use]
    pub const fn is_taken(self) -> bool {
        !matches!(self, Self::Duplicate | Self::Invalid)
    }
}

/// Accounts the blocks of one topic.
#[derive(Debug, Clone, Default)]
pub struct InputAccount {
    last: Option<(u64, u64)>,
    /// Blocks lost, by gaps in the sequence.
    pub lost: u64,
    /// Blocks seen twice.
    pub duplicate: u64,
    /// Blocks refused.
    pub invalid: u64,
}

impl InputAccount {
    /// Accounts a block by its header, at `now_ns`, for a schedule of `period_ns`.
    pub fn arrive<T: Block>(&mut self, header: &Header, now_ns: u64, period_ns: u64) -> Arrival {
        let due_ns = header.t_schedule_ns;
        let is_live = due_ns <= now_ns.saturating_add(AHEAD_PERIODS_MAX * period_ns)
            && due_ns >= now_ns.saturating_sub(BEHIND_NS_MAX);
        if header.schema != T::SCHEMA || header.epoch == 0 || !is_live {
            self.invalid += 1;
            return Arrival::Invalid;
        }
        let arrival = match self.last {
            None => Arrival::Next,
            Some((epoch, _)) if epoch != header.epoch => Arrival::NewEpoch,
            Some((_, seq)) if header.seq <= seq => Arrival::Duplicate,
            Some((_, seq)) if header.seq == seq + 1 => Arrival::Next,
            Some((_, seq)) => Arrival::AfterGap(header.seq - seq - 1),
        };
        match arrival {
            Arrival::Duplicate => self.duplicate += 1,
            Arrival::AfterGap(lost) => self.lost += lost,
            _ => {}
        }
        if arrival.is_taken() {
            self.last = Some((header.epoch, header.seq));
        }
        arrival
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::SensorFrame;

    fn arrive(account: &mut InputAccount, epoch: u64, seq: u64) -> Arrival {
        let header = Header {
            schema: SensorFrame::SCHEMA,
            epoch,
            seq,
            ..Header::default()
        };
        account.arrive::<SensorFrame>(&header, 1_000_000, 1000)
    }

    #[test]
    fn sequence_faults_are_told_apart_and_counted() {
        let mut a = InputAccount::default();
        assert_eq!(arrive(&mut a, 7, 3), Arrival::Next);
        assert_eq!(arrive(&mut a, 7, 4), Arrival::Next);
        assert_eq!(arrive(&mut a, 7, 4), Arrival::Duplicate);
        assert_eq!(arrive(&mut a, 7, 8), Arrival::AfterGap(3));
        assert_eq!(arrive(&mut a, 7, 6), Arrival::Duplicate);
        assert_eq!(arrive(&mut a, 8, 0), Arrival::NewEpoch);
        assert_eq!(arrive(&mut a, 8, 1), Arrival::Next);
        assert_eq!((a.lost, a.duplicate, a.invalid), (3, 2, 0));
    }

    #[test]
    fn impossible_headers_are_refused() {
        let mut a = InputAccount::default();
        let good = Header {
            schema: SensorFrame::SCHEMA,
            epoch: 1,
            t_schedule_ns: 60_000_000_000,
            ..Header::default()
        };
        let now_ns = good.t_schedule_ns;
        for bad in [
            Header { schema: 1, ..good },
            Header { epoch: 0, ..good },
            Header {
                t_schedule_ns: now_ns + 2001,
                ..good
            },
            Header {
                t_schedule_ns: u64::MAX,
                ..good
            },
            Header {
                t_schedule_ns: now_ns - BEHIND_NS_MAX - 1,
                ..good
            },
        ] {
            assert_eq!(
                a.arrive::<SensorFrame>(&bad, now_ns, 1000),
                Arrival::Invalid
            );
        }
        assert_eq!(a.arrive::<SensorFrame>(&good, now_ns, 1000), Arrival::Next);
        assert_eq!(a.invalid, 5);
    }
}

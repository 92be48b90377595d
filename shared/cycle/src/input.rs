//! End-to-end check of input blocks, by what their headers say, and the account of it.
//!
//! After AUTOSAR's end-to-end protocol (specification of E2E Protocol, R4): repetition, loss,
//! wrong sequence, insertion and delay are told apart, and a source that misbehaves is trusted
//! again only after it has behaved for a while.

use vigil_blocks::{Block, Header, REJECTIONS, Rejection};

/// A scheduled instant may be ahead of the reader's clock by this much at most, in periods.
const AHEAD_PERIODS_MAX: u64 = 2;
/// A scheduled instant may lie this far in the past, ns: older blocks are not of this drive, or of
/// another clock.
const BEHIND_NS_MAX: u64 = 10_000_000_000;
/// A sequence number that is further ahead is not believed.
const STEP_MAX: u64 = 1_000_000;
/// Once nothing was taken for so long, ns, a source is silent: another one is believed, and a lower
/// or far higher sequence number is a new start, of a counter that wraps around or of a device that
/// always has the same epoch.
const SILENT_NS: u64 = 1_000_000_000;
/// Blocks closer to the last one than this part of a period are more than the schedule allows.
const EARLY_PERIOD_PART: u64 = 4;
/// So many blocks are taken at once, whenever they say that they were due: those that have waited.
const BURST_MAX: u64 = 256;
/// A source that misbehaved in so many of its last [`HISTORY`] blocks is not trusted.
const MISBEHAVED_MAX: u32 = 8;
/// Blocks that are remembered; it is trusted again after so many good ones in a row.
const HISTORY: u32 = 16;

/// What an input block is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// The next in sequence, or the first of all.
    Next,
    /// The first of a new epoch: the writer has restarted.
    NewEpoch,
    /// In sequence after this many lost ones.
    AfterGap(u64),
    /// Not to be taken.
    Rejected(Rejection),
}

impl Arrival {
    /// True if the block is to be taken.
    #[must_use]
    pub const fn is_taken(self) -> bool {
        !matches!(self, Self::Rejected(_))
    }
}

/// Who writes the blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Writer {
    /// A service of the graph.
    #[default]
    Service,
    /// A program outside of it, through shared memory: the transport admits one at a time.
    Publisher,
    /// Anybody who reaches a socket: one is believed at a time.
    Stranger,
}

/// The newest block of the known writer.
#[derive(Debug, Clone, Copy)]
struct Last {
    epoch: u64,
    seq: u64,
    /// When its first block came, ns.
    started_ns: u64,
    /// When a block was taken last, and for when that was due, ns.
    taken_ns: u64,
    t_schedule_ns: u64,
}

/// Checks and accounts the blocks of one topic.
#[derive(Debug, Clone, Default)]
pub struct InputAccount {
    writer: Writer,
    last: Option<Last>,
    /// Whether the last blocks were misbehaviour, the newest in the lowest bit.
    misbehaved: u32,
    is_quarantined: bool,
    /// What has been taken is what the schedule allows up to then, ns.
    paced_ns: u64,
    /// Blocks lost, by gaps in the sequence.
    pub lost: u64,
    /// Blocks seen before, or older than one seen before.
    pub duplicate: u64,
    /// Blocks refused for another reason.
    pub invalid: u64,
    /// Refused blocks by [`Rejection`].
    pub rejected: [u64; REJECTIONS],
}

impl InputAccount {
    /// An account of this writer's blocks. One outside the graph is no faster than the schedule,
    /// and not trusted for ever.
    #[must_use]
    pub fn of(writer: Writer) -> Self {
        Self {
            writer,
            ..Self::default()
        }
    }

    /// True while nothing of this source is taken, since it has misbehaved.
    #[must_use]
    pub const fn is_quarantined(&self) -> bool {
        self.is_quarantined
    }

    /// Accounts a block by its header, at `now_ns`, for a schedule of `period_ns`.
    pub fn arrive<T: Block>(&mut self, header: &Header, now_ns: u64, period_ns: u64) -> Arrival {
        self.admit::<T>(header, now_ns, period_ns, || Ok(()))
    }

    /// The same; a block that passes is taken only if `content` finds nothing wrong with it.
    pub fn admit<T: Block>(
        &mut self,
        header: &Header,
        now_ns: u64,
        period_ns: u64,
        content: impl FnOnce() -> Result<(), Rejection>,
    ) -> Arrival {
        let arrival = match self.judge::<T>(header, now_ns, period_ns) {
            Arrival::Rejected(rejection) => return self.reject(rejection),
            good => good,
        };
        if let Arrival::AfterGap(lost) = arrival {
            self.lost += lost;
        }
        // It has arrived, whatever it says: the next one is not after a gap.
        let last = self.last.get_or_insert(Last {
            epoch: header.epoch,
            seq: header.seq,
            started_ns: now_ns,
            taken_ns: now_ns,
            t_schedule_ns: 0,
        });
        (last.epoch, last.seq) = (header.epoch, header.seq);
        if arrival == Arrival::NewEpoch {
            (last.started_ns, last.t_schedule_ns) = (now_ns, 0);
            // Another start is no other source: only silence makes its misdeeds forgotten.
            if now_ns.saturating_sub(last.taken_ns) > SILENT_NS {
                (self.misbehaved, self.is_quarantined) = (0, false);
            }
        }
        if let Err(rejection) = content() {
            return self.reject(rejection);
        }
        if self.writer != Writer::Service {
            let earliest_ns = last.t_schedule_ns + period_ns / EARLY_PERIOD_PART;
            let is_too_soon = last.t_schedule_ns > 0 && header.t_schedule_ns < earliest_ns;
            if is_too_soon || self.paced_ns > now_ns {
                return self.reject(Rejection::Early);
            }
            self.remember(false);
            if self.is_quarantined {
                return self.reject(Rejection::Quarantined);
            }
            let spacing_ns = period_ns / EARLY_PERIOD_PART;
            let burst_ns = (BURST_MAX - 1) * spacing_ns;
            self.paced_ns = self.paced_ns.max(now_ns.saturating_sub(burst_ns)) + spacing_ns;
        }
        if let Some(last) = &mut self.last {
            (last.taken_ns, last.t_schedule_ns) = (now_ns, header.t_schedule_ns);
        }
        arrival
    }

    /// Accounts what was refused before it had a header to look at.
    pub fn reject(&mut self, rejection: Rejection) -> Arrival {
        self.rejected[rejection as usize] += 1;
        match rejection {
            Rejection::Repeated | Rejection::WrongSequence => self.duplicate += 1,
            _ => self.invalid += 1,
        }
        // Before there is a known writer, nobody can misbehave in its name.
        let is_known = self.writer != Writer::Service && self.last.is_some();
        if rejection.is_misbehaviour() && is_known {
            self.remember(true);
        }
        Arrival::Rejected(rejection)
    }

    fn judge<T: Block>(&self, header: &Header, now_ns: u64, period_ns: u64) -> Arrival {
        let due_ns = header.t_schedule_ns;
        if header.schema != T::SCHEMA {
            return Arrival::Rejected(Rejection::Schema);
        }
        if header.epoch == 0 {
            return Arrival::Rejected(Rejection::NoEpoch);
        }
        if due_ns > now_ns.saturating_add(AHEAD_PERIODS_MAX * period_ns) {
            return Arrival::Rejected(Rejection::Ahead);
        }
        if due_ns < now_ns.saturating_sub(BEHIND_NS_MAX) {
            return Arrival::Rejected(Rejection::Behind);
        }
        let Some(last) = self.last else {
            return Arrival::Next;
        };
        let is_silent = now_ns.saturating_sub(last.taken_ns) > SILENT_NS;
        if header.epoch != last.epoch {
            let is_believed = match self.writer {
                Writer::Service => true,
                // The transport says that the one before is gone; but nobody starts anew each time.
                Writer::Publisher => now_ns.saturating_sub(last.started_ns) > SILENT_NS,
                Writer::Stranger => is_silent,
            };
            return if is_believed {
                Arrival::NewEpoch
            } else {
                Arrival::Rejected(Rejection::OtherWriter)
            };
        }
        let starts_again = self.writer != Writer::Service && is_silent;
        match header.seq.checked_sub(last.seq) {
            Some(0) => Arrival::Rejected(Rejection::Repeated),
            Some(1) => Arrival::Next,
            Some(steps) if steps <= STEP_MAX => Arrival::AfterGap(steps - 1),
            _ if starts_again => Arrival::NewEpoch,
            _ => Arrival::Rejected(Rejection::WrongSequence),
        }
    }

    fn remember(&mut self, is_misbehaviour: bool) {
        let mask = (1 << HISTORY) - 1;
        self.misbehaved = (self.misbehaved << 1 | u32::from(is_misbehaviour)) & mask;
        if self.misbehaved.count_ones() >= MISBEHAVED_MAX {
            self.is_quarantined = true;
        } else if self.misbehaved == 0 {
            self.is_quarantined = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::SensorFrame;

    const PERIOD_NS: u64 = 1_000_000;
    const START_NS: u64 = 60_000_000_000;

    /// A block of `epoch` with `seq`, due in period `k` and taken right then.
    fn at(account: &mut InputAccount, (epoch, seq, k): (u64, u64, u64)) -> Arrival {
        with(account, (epoch, seq, k), Ok(()))
    }

    fn with(
        account: &mut InputAccount,
        (epoch, seq, k): (u64, u64, u64),
        content: Result<(), Rejection>,
    ) -> Arrival {
        let now_ns = START_NS + k * PERIOD_NS;
        let header = Header {
            schema: SensorFrame::SCHEMA,
            epoch,
            seq,
            t_schedule_ns: now_ns,
            ..Header::default()
        };
        account.admit::<SensorFrame>(&header, now_ns, PERIOD_NS, || content)
    }

    #[test]
    fn sequence_faults_are_told_apart_and_counted() {
        use Rejection::{Repeated, WrongSequence};
        for writer in [Writer::Service, Writer::Publisher, Writer::Stranger] {
            let mut a = InputAccount::of(writer);
            // Another start is believed at once, or after a second.
            let later = if writer == Writer::Service { 6 } else { 1006 };
            assert_eq!(at(&mut a, (7, 3, 1)), Arrival::Next);
            assert_eq!(at(&mut a, (7, 4, 2)), Arrival::Next);
            assert_eq!(at(&mut a, (7, 4, 3)), Arrival::Rejected(Repeated));
            assert_eq!(at(&mut a, (7, 8, 4)), Arrival::AfterGap(3));
            assert_eq!(at(&mut a, (7, 6, 5)), Arrival::Rejected(WrongSequence));
            assert_eq!(at(&mut a, (8, 0, later)), Arrival::NewEpoch);
            assert_eq!(at(&mut a, (8, 1, later + 1)), Arrival::Next);
            assert_eq!((a.lost, a.duplicate, a.invalid), (3, 2, 0));
            let counted = [Repeated, WrongSequence].map(|r| a.rejected[r as usize]);
            assert_eq!(counted, [1, 1]);
        }
    }

    #[test]
    fn the_last_sequence_number_does_not_wrap() {
        let mut a = InputAccount::default();
        // A service's epoch changes when it starts anew, and its numbers with it.
        assert_eq!(at(&mut a, (7, u64::MAX - 1, 1)), Arrival::Next);
        assert_eq!(at(&mut a, (7, u64::MAX, 2)), Arrival::Next);
        let wrapped = at(&mut a, (7, 0, 3));
        assert_eq!(wrapped, Arrival::Rejected(Rejection::WrongSequence));
    }

    #[test]
    fn impossible_headers_are_refused_each_with_its_cause() {
        let good = Header {
            schema: SensorFrame::SCHEMA,
            epoch: 1,
            t_schedule_ns: START_NS,
            ..Header::default()
        };
        let due = |t_schedule_ns| Header {
            t_schedule_ns,
            ..good
        };
        let cases = [
            (Header { schema: 1, ..good }, Rejection::Schema),
            (Header { epoch: 0, ..good }, Rejection::NoEpoch),
            (due(START_NS + 2 * PERIOD_NS + 1), Rejection::Ahead),
            (due(u64::MAX), Rejection::Ahead),
            (due(START_NS - BEHIND_NS_MAX - 1), Rejection::Behind),
            (due(0), Rejection::Behind),
        ];
        let mut a = InputAccount::default();
        for (bad, cause) in cases {
            let arrival = a.arrive::<SensorFrame>(&bad, START_NS, PERIOD_NS);
            assert_eq!(arrival, Arrival::Rejected(cause));
        }
        let latest = due(START_NS + 2 * PERIOD_NS);
        let arrival = a.arrive::<SensorFrame>(&latest, START_NS, PERIOD_NS);
        assert_eq!((arrival, a.invalid), (Arrival::Next, 6));
    }

    #[test]
    fn an_outsider_is_replaced_only_once_it_is_silent() {
        let mut a = InputAccount::of(Writer::Stranger);
        assert_eq!(at(&mut a, (7, 0, 1)), Arrival::Next);
        let other = Arrival::Rejected(Rejection::OtherWriter);
        assert_eq!(at(&mut a, (9, 0, 2)), other);
        assert_eq!(at(&mut a, (7, 1, 2)), Arrival::Next);
        assert_eq!(at(&mut a, (9, 1, 1002)), other);
        assert_eq!(at(&mut a, (9, 2, 1003)), Arrival::NewEpoch);
        assert_eq!(at(&mut a, (7, 2, 1004)), other);
        // For one that starts anew in shared memory there is the transport's word that the old one
        // is gone: only who starts anew again and again is not believed.
        let mut a = InputAccount::of(Writer::Publisher);
        assert_eq!(at(&mut a, (7, 0, 1)), Arrival::Next);
        assert_eq!(at(&mut a, (7, 1, 1001)), Arrival::Next);
        assert_eq!(at(&mut a, (8, 0, 1001)), other);
        assert_eq!(at(&mut a, (8, 0, 1002)), Arrival::NewEpoch);
        for k in 1003..=2002 {
            assert_eq!(at(&mut a, (k, 0, k)), other);
        }
        assert_eq!(at(&mut a, (9, 0, 2003)), Arrival::NewEpoch);
    }

    #[test]
    fn a_counter_that_starts_again_is_believed_after_a_second_without_it() {
        let mut a = InputAccount::of(Writer::Publisher);
        let wrong = Arrival::Rejected(Rejection::WrongSequence);
        assert_eq!(at(&mut a, (1, 65_535, 1)), Arrival::Next);
        for k in 2..=1001 {
            assert_eq!(at(&mut a, (1, k - 2, k)), wrong);
        }
        assert_eq!(at(&mut a, (1, 1000, 1002)), Arrival::NewEpoch);
        assert_eq!(at(&mut a, (1, 1001, 1003)), Arrival::Next);
        // A number far ahead is not believed at once either, and spoils nothing.
        assert_eq!(at(&mut a, (1, 1 << 63, 1004)), wrong);
        assert_eq!(at(&mut a, (1, 1003, 1005)), Arrival::AfterGap(1));
        assert_eq!(at(&mut a, (1, 1 << 63, 2005)), wrong);
        assert_eq!(at(&mut a, (1, 1 << 63, 2006)), Arrival::NewEpoch);
        assert_eq!(a.lost, 1);
    }

    #[test]
    fn no_more_than_a_burst_is_taken_at_once_whenever_it_says_that_it_was_due() {
        let mut a = InputAccount::of(Writer::Publisher);
        let mut sent = 0;
        let mut taken_at = |now_ns: u64, count: u64| {
            let mut taken = 0;
            for _ in 0..count {
                sent += 1;
                let header = Header {
                    schema: SensorFrame::SCHEMA,
                    epoch: 1,
                    seq: sent,
                    t_schedule_ns: START_NS - 9_000_000_000 + sent * PERIOD_NS / 4,
                    ..Header::default()
                };
                let arrival = a.arrive::<SensorFrame>(&header, now_ns, PERIOD_NS);
                taken += u64::from(arrival.is_taken());
            }
            taken
        };
        assert_eq!(taken_at(START_NS, 1000), BURST_MAX);
        assert_eq!(taken_at(START_NS + PERIOD_NS / 4 - 1, 1000), 0);
        assert_eq!(taken_at(START_NS + PERIOD_NS / 4, 1000), 1);
        assert_eq!(taken_at(START_NS + 5 * PERIOD_NS, 1000), 19);
        assert_eq!(taken_at(START_NS + 1000 * PERIOD_NS, 1000), BURST_MAX);
    }

    #[test]
    fn nobody_misbehaves_in_the_name_of_a_writer_that_is_not_known_yet() {
        let mut a = InputAccount::of(Writer::Stranger);
        for _ in 0..100 {
            a.reject(Rejection::Schema);
        }
        assert_eq!(at(&mut a, (1, 0, 1)), Arrival::Next);
    }

    #[test]
    fn an_outsider_faster_than_the_schedule_is_thinned_out_and_stays_trusted() {
        let mut a = InputAccount::of(Writer::Stranger);
        let mut taken = 0;
        for seq in 0..10_000 {
            // Twenty blocks a period.
            let now_ns = START_NS + seq * PERIOD_NS / 20;
            let header = Header {
                schema: SensorFrame::SCHEMA,
                epoch: 1,
                seq,
                t_schedule_ns: now_ns,
                ..Header::default()
            };
            let arrival = a.arrive::<SensorFrame>(&header, now_ns, PERIOD_NS);
            taken += u64::from(arrival.is_taken());
        }
        // One of five, a quarter of a period apart.
        assert_eq!((taken, a.lost), (2_000, 0));
        assert_eq!(a.rejected[Rejection::Early as usize], 8_000);
        assert!(!a.is_quarantined());
    }

    #[test]
    fn a_source_that_misbehaves_is_quarantined_until_it_behaves() {
        let mut a = InputAccount::of(Writer::Stranger);
        let mut k = 0;
        let mut next = |a: &mut InputAccount, content| {
            k += 1;
            with(a, (1, k, k), content)
        };
        let bad = Err(Rejection::NotFinite);
        for _ in 0..7 {
            assert_eq!(
                next(&mut a, bad),
                Arrival::Rejected(Rejection::NotFinite),
                "told by its own cause"
            );
            assert!(next(&mut a, Ok(())).is_taken());
        }
        assert!(!a.is_quarantined(), "seven of the last sixteen");
        next(&mut a, bad);
        assert!(a.is_quarantined(), "eight");
        for _ in 0..15 {
            let refused = Arrival::Rejected(Rejection::Quarantined);
            assert_eq!(next(&mut a, Ok(())), refused);
        }
        assert!(next(&mut a, Ok(())).is_taken(), "sixteen good ones");
        assert_eq!(a.lost, 0);
        // A service is not.
        let mut a = InputAccount::default();
        for k in 0..100 {
            with(&mut a, (1, k, k), bad);
        }
        assert!(!a.is_quarantined());
    }
}

//! End-to-end check of input blocks, by what their headers say, and the account of it.
//!
//! After AUTOSAR's end-to-end protocol (specification of E2E Protocol, R4): repetition, loss,
//! wrong sequence, insertion and delay are distinguished, and a source in quarantine is read again
//! only after a row of good blocks.

use vigil_blocks::{Block, Header, REJECTIONS, Rejection};

/// A scheduled instant may be ahead of the reader's clock by this much at most, in periods.
const AHEAD_PERIODS_MAX: u64 = 2;
/// A scheduled instant may lie this far in the past, ns: older blocks are not of this drive, or of
/// another clock. Chosen by hand: a reader that was stopped for seconds still takes what waited.
const BEHIND_NS_MAX: u64 = 10_000_000_000;
/// A sequence number further ahead is an error of the writer, not a gap: 17 minutes at 1 kHz.
const STEP_MAX: u64 = 1_000_000;
/// Once nothing was taken for so long, ns, a source is silent: another one is believed, and a lower
/// or far higher sequence number is a new start, of a counter that wraps around or of a device that
/// always has the same epoch.
pub const SILENT_NS: u64 = 1_000_000_000;
/// Blocks closer to the last one than a period over this are more than the schedule allows. Chosen:
/// four times the graph's rate. Smaller refuses a publisher that is merely faster or jitters.
/// Larger lets one that floods the graph load it more.
const EARLY_PERIOD_DIVISOR: u64 = 4;
/// So many blocks are taken at once, whatever their schedule: the full queue of sensor frames after
/// a reader was held up.
const BURST_MAX: u64 = 256;
/// So many offences within the last [`HISTORY`] blocks put a source in quarantine: half of them.
/// With fewer, a few damaged blocks would silence a robot's only sensor; with more, the filters
/// would get mostly nonsense.
const OFFENCES_MAX: u32 = 8;
/// Blocks that are remembered; so many without an offence end a quarantine: 0.16 s at 100 Hz.
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
    /// Any program that reaches a socket: one is accepted at a time.
    Socket,
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
    /// Which of the last blocks were offences, the newest in the lowest bit.
    offences: u32,
    is_quarantined: bool,
    /// When a block came last, whatever became of it, ns.
    heard_ns: u64,
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
    /// An account of this writer's blocks. Those from outside the graph are held to the pace of the
    /// schedule, and to quarantine.
    #[must_use]
    pub fn new(writer: Writer) -> Self {
        Self {
            writer,
            ..Self::default()
        }
    }

    /// True while this source is in quarantine: none of its blocks is taken.
    #[must_use]
    pub const fn is_quarantined(&self) -> bool {
        self.is_quarantined
    }

    /// Accounts a block by its header, at `now_ns`, for a schedule of `period_ns`, and, if that
    /// passes, by what `content` finds in it.
    pub fn admit<T: Block>(
        &mut self,
        header: &Header,
        now_ns: u64,
        period_ns: u64,
        content: impl FnOnce() -> Result<(), Rejection>,
    ) -> Arrival {
        let is_after_silence = now_ns.saturating_sub(self.heard_ns) > SILENT_NS;
        self.heard_ns = now_ns;
        let arrival = match self.judge::<T>(header, now_ns, period_ns) {
            Arrival::Rejected(rejection) => return self.reject(rejection),
            good => good,
        };
        let content = content();
        if let (None, Err(rejection)) = (self.last, content) {
            // A source becomes the known writer by a good block only.
            return self.reject(rejection);
        }
        if let Arrival::AfterGap(lost) = arrival {
            self.lost += lost;
        }
        // It has arrived, good or not: the next one is not after a gap.
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
            // A restart clears no offences: only a second of silence does.
            if is_after_silence {
                (self.offences, self.is_quarantined) = (0, false);
            }
        }
        if let Err(rejection) = content {
            return self.reject(rejection);
        }
        if self.writer != Writer::Service {
            let earliest_ns = last.t_schedule_ns + period_ns / EARLY_PERIOD_DIVISOR;
            let is_too_soon = last.t_schedule_ns > 0 && header.t_schedule_ns < earliest_ns;
            if is_too_soon || self.paced_ns > now_ns {
                return self.reject(Rejection::Early);
            }
            self.remember(false);
            if self.is_quarantined {
                return self.reject(Rejection::Quarantined);
            }
            let spacing_ns = period_ns / EARLY_PERIOD_DIVISOR;
            let burst_ns = (BURST_MAX - 1) * spacing_ns;
            self.paced_ns = self.paced_ns.max(now_ns.saturating_sub(burst_ns)) + spacing_ns;
        }
        if let Some(last) = &mut self.last {
            (last.taken_ns, last.t_schedule_ns) = (now_ns, header.t_schedule_ns);
        }
        arrival
    }

    /// Accounts what was refused and cannot be attributed to a writer.
    pub fn count(&mut self, rejection: Rejection) {
        self.rejected[rejection as usize] += 1;
        match rejection {
            Rejection::Repeated | Rejection::WrongSequence => self.duplicate += 1,
            _ => self.invalid += 1,
        }
    }

    /// Accounts what the known writer sent and was refused before its header could be read.
    pub fn reject(&mut self, rejection: Rejection) -> Arrival {
        self.count(rejection);
        // Without a known writer there is nobody to hold it against.
        let is_known = self.writer != Writer::Service && self.last.is_some();
        if rejection.is_offence() && is_known {
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
            let is_accepted = match self.writer {
                Writer::Service => true,
                // The transport guarantees that the one before is gone. One that restarts with
                // every block is refused all the same.
                Writer::Publisher => now_ns.saturating_sub(last.started_ns) > SILENT_NS,
                Writer::Socket => is_silent,
            };
            return if is_accepted {
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

    fn remember(&mut self, is_offence: bool) {
        let mask = (1 << HISTORY) - 1;
        self.offences = (self.offences << 1 | u32::from(is_offence)) & mask;
        if self.offences.count_ones() >= OFFENCES_MAX {
            self.is_quarantined = true;
        } else if self.offences == 0 {
            self.is_quarantined = false;
        }
    }
}

#[cfg(test)]
mod tests;

//! The account of an input judges any series of blocks as its rules say, found out anew for each
//! block from all that came before.

use proptest::prelude::*;
use vigil_blocks::{Block, Header, Rejection, SensorFrame};
use vigil_cycle::{InputAccount, Writer};

const PERIOD_NS: u64 = 10_000_000;
const START_NS: u64 = 60_000_000_000;
const S: u64 = 1_000_000_000;

/// A block on its way, relative to the one before.
#[derive(Debug, Clone, Copy)]
struct Sent {
    after_ns: u64,
    is_our_schema: bool,
    epoch: u64,
    steps: i64,
    due_ns: i64,
    content: Result<(), Rejection>,
    /// It is not even a block.
    garbage: Option<Rejection>,
}

fn sent() -> impl Strategy<Value = Sent> {
    let after_ns = prop_oneof![
        2 => 0..PERIOD_NS / 2,
        12 => Just(PERIOD_NS),
        2 => PERIOD_NS..4 * PERIOD_NS,
        1 => S - PERIOD_NS..S + PERIOD_NS,
    ];
    let epoch = prop_oneof![1 => Just(0_u64), 30 => Just(1_u64), 3 => 2..4_u64];
    let steps = prop_oneof![20 => Just(1), 2 => -3..=4_i64, 1 => -70_000..2_000_000_i64];
    let due_ns = prop_oneof![
        12 => Just(0),
        3 => -(PERIOD_NS as i64)..3 * PERIOD_NS as i64,
        1 => -11 * S as i64..-9 * S as i64,
    ];
    let content = prop_oneof![
        8 => Just(Ok(())),
        1 => prop_oneof![
            Just(Err(Rejection::NotFinite)),
            Just(Err(Rejection::OutOfRange)),
            Just(Err(Rejection::Jump)),
        ],
    ];
    let garbage = prop_oneof![
        30 => Just(None),
        1 => Just(Some(Rejection::Malformed)),
        1 => Just(Some(Rejection::Corrupt)),
    ];
    let is_our_schema = prop::bool::weighted(0.98);
    (
        after_ns,
        is_our_schema,
        epoch,
        steps,
        due_ns,
        content,
        garbage,
    )
        .prop_map(
            |(after_ns, is_our_schema, epoch, steps, due_ns, content, garbage)| Sent {
                after_ns,
                is_our_schema,
                epoch,
                steps,
                due_ns,
                content,
                garbage,
            },
        )
}

/// A block that came, and what became of it.
#[derive(Debug, Clone, Copy)]
struct Came {
    now_ns: u64,
    header: Header,
    /// `None` for what was taken.
    rejection: Option<Rejection>,
}

impl Came {
    /// It was the known writer's next, whatever it said.
    fn was_in_sequence(&self) -> bool {
        use Rejection::{Early, Jump, NotFinite, OutOfRange, Quarantined};
        let after = [NotFinite, OutOfRange, Jump, Early, Quarantined];
        self.rejection
            .is_none_or(|rejection| after.contains(&rejection))
    }

    /// Nothing was wrong with what it said.
    fn said_something_good(&self) -> bool {
        let good = [None, Some(Rejection::Early), Some(Rejection::Quarantined)];
        good.contains(&self.rejection)
    }
}

/// The known writer's blocks, with their places in the history: from the first on that said
/// something good.
fn in_sequence(history: &[Came]) -> impl DoubleEndedIterator<Item = (usize, &Came)> {
    let first = history.iter().position(Came::said_something_good);
    let all = history.iter().enumerate();
    all.skip(first.unwrap_or(history.len()))
        .filter(|(_, came)| came.was_in_sequence())
}

/// What is wrong with a block after `history`; the first cause that applies, in the order told.
fn wrong(
    writer: Writer,
    history: &[Came],
    (now_ns, header): (u64, &Header),
    content: Result<(), Rejection>,
) -> Option<Rejection> {
    let is_outside = writer != Writer::Service;
    let silent_ns = silent_ns(history, now_ns);
    let last = in_sequence(history).next_back().map(|(_, came)| came);
    let same = last.filter(|last| last.header.epoch == header.epoch);
    let before = same.map(|last| last.header.seq);
    let begins_anew = same.is_none_or(|last| is_new_start(&last.header, header));
    let starts_again = is_outside && silent_ns > S;
    let started = starts(history).pop();
    let known_for_ns = started.map_or(0, |i| now_ns - history[i].now_ns);
    let taken = taken_of_start(history).filter(|_| !begins_anew);
    let too_soon = |last: &Came| header.t_schedule_ns < last.header.t_schedule_ns + PERIOD_NS / 4;
    // This block counts for its source before it is known whether the source is trusted.
    let mut with_this = history.to_vec();
    with_this.push(Came {
        now_ns,
        header: *header,
        rejection: Some(Rejection::Quarantined),
    });
    let causes = [
        (header.schema != SensorFrame::SCHEMA, Rejection::Schema),
        (header.epoch == 0, Rejection::NoEpoch),
        (
            header.t_schedule_ns > now_ns + 2 * PERIOD_NS,
            Rejection::Ahead,
        ),
        (header.t_schedule_ns + 10 * S < now_ns, Rejection::Behind),
        (
            last.is_some_and(|last| last.header.epoch != header.epoch)
                && match writer {
                    Writer::Service => false,
                    Writer::Publisher => known_for_ns <= S,
                    Writer::Socket => silent_ns <= S,
                },
            Rejection::OtherWriter,
        ),
        (before == Some(header.seq), Rejection::Repeated),
        (
            same.is_some() && begins_anew && !starts_again,
            Rejection::WrongSequence,
        ),
        (content.is_err(), content.err().unwrap_or(Rejection::Schema)),
        (is_outside && taken.is_some_and(too_soon), Rejection::Early),
        (
            is_outside && is_quarantined(&with_this),
            Rejection::Quarantined,
        ),
    ];
    causes
        .into_iter()
        .find_map(|(applies, cause)| applies.then_some(cause))
}

/// Since when nothing was taken, ns, or since the first that might have been.
fn silent_ns(history: &[Came], now_ns: u64) -> u64 {
    let first = in_sequence(history).next().map(|(_, came)| came);
    let taken = history.iter().rfind(|came| came.rejection.is_none());
    taken.or(first).map_or(0, |came| now_ns - came.now_ns)
}

/// A block with this header after that one is of another start: another epoch, a number that went
/// back, or one far ahead.
fn is_new_start(before: &Header, after: &Header) -> bool {
    before.epoch != after.epoch || after.seq < before.seq || after.seq - before.seq > 1_000_000
}

/// Where in the history starts of the writer begin.
fn starts(history: &[Came]) -> Vec<usize> {
    let known: Vec<usize> = in_sequence(history).map(|(i, _)| i).collect();
    let others = known.windows(2).map(|pair| (pair[0], pair[1]));
    let others = others.filter(|(a, b)| is_new_start(&history[*a].header, &history[*b].header));
    known
        .first()
        .copied()
        .into_iter()
        .chain(others.map(|(_, b)| b))
        .collect()
}

/// What was taken last of the newest start.
fn taken_of_start(history: &[Came]) -> Option<&Came> {
    let from = starts(history).pop()?;
    history[from..]
        .iter()
        .rfind(|came| came.rejection.is_none())
}

/// Since when no block came, ns; what is none says nothing.
fn quiet_ns(history: &[Came], now_ns: u64) -> u64 {
    let garbage = [Some(Rejection::Malformed), Some(Rejection::Corrupt)];
    let last = history.iter().rfind(|c| !garbage.contains(&c.rejection));
    last.map_or(u64::MAX, |came| now_ns - came.now_ns)
}

/// Since when its deeds count for the source: its first block, or the first after a second in which
/// nothing came that is a new start.
fn judged_from(history: &[Came]) -> usize {
    let mut starts = starts(history);
    let first = starts.first().copied().unwrap_or(history.len());
    starts.retain(|i| quiet_ns(&history[..*i], history[*i].now_ns) > S);
    starts.pop().unwrap_or(first)
}

/// Eight bad ones of sixteen put a source in quarantine, sixteen good ones in a row end it.
fn is_quarantined(history: &[Came]) -> bool {
    let (mut marks, mut is_quarantined) = (Vec::new(), false);
    for came in &history[judged_from(history)..] {
        match came.rejection {
            None | Some(Rejection::Quarantined) => marks.push(false),
            Some(rejection) if rejection.is_offence() => marks.push(true),
            Some(_) => continue,
        }
        let recent = &marks[marks.len().saturating_sub(16)..];
        if recent.iter().filter(|bad| **bad).count() >= 8 {
            is_quarantined = true;
        } else if recent.iter().all(|bad| !bad) {
            is_quarantined = false;
        }
    }
    is_quarantined
}

fn judged(writer: Writer, series: &[Sent]) -> (InputAccount, Vec<Came>) {
    let mut account = InputAccount::new(writer);
    let (mut history, mut now_ns, mut seq) = (Vec::new(), START_NS, 100_000_u64);
    for sent in series {
        now_ns += sent.after_ns;
        if let Some(rejection) = sent.garbage {
            account.reject(rejection);
            let header = Header::default();
            history.push(Came {
                now_ns,
                header,
                rejection: Some(rejection),
            });
            continue;
        }
        seq = seq.saturating_add_signed(sent.steps);
        let header = Header {
            schema: SensorFrame::SCHEMA + u64::from(!sent.is_our_schema),
            epoch: sent.epoch,
            seq,
            t_schedule_ns: now_ns.saturating_add_signed(sent.due_ns),
            ..Header::default()
        };
        let expected = wrong(writer, &history, (now_ns, &header), sent.content);
        let arrival = account.admit::<SensorFrame>(&header, now_ns, PERIOD_NS, || sent.content);
        let found = match arrival {
            vigil_cycle::input::Arrival::Rejected(rejection) => Some(rejection),
            _ => None,
        };
        assert_eq!(found, expected, "{sent:?} after {} blocks", history.len());
        history.push(Came {
            now_ns,
            header,
            rejection: found,
        });
    }
    (account, history)
}

proptest! {
    #[test]
    fn every_block_is_judged_by_the_rules_and_counted_once(
        writer in prop::sample::select(vec![Writer::Service, Writer::Publisher, Writer::Socket]),
        series in prop::collection::vec(sent(), 1..200),
    ) {
        let (account, history) = judged(writer, &series);
        for &cause in Rejection::ALL {
            let counted = history.iter().filter(|came| came.rejection == Some(cause)).count();
            prop_assert_eq!(account.rejected[cause as usize], counted as u64, "{:?}", cause);
        }
        let known: Vec<&Came> = in_sequence(&history).map(|(_, came)| came).collect();
        let gaps = known.windows(2).filter_map(|pair| {
            let [before, after] = [pair[0].header, pair[1].header];
            (!is_new_start(&before, &after)).then(|| after.seq - before.seq - 1)
        });
        prop_assert_eq!(account.lost, gaps.sum::<u64>());
    }
}

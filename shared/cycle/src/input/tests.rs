use super::*;
use vigil_blocks::SensorFrame;

impl InputAccount {
    /// Accounts a block whose content is good.
    fn arrive<T: Block>(&mut self, header: &Header, now_ns: u64, period_ns: u64) -> Arrival {
        self.admit::<T>(header, now_ns, period_ns, || Ok(()))
    }
}

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
    for writer in [Writer::Service, Writer::Publisher, Writer::Socket] {
        let mut a = InputAccount::new(writer);
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
    let mut a = InputAccount::new(Writer::Socket);
    assert_eq!(at(&mut a, (7, 0, 1)), Arrival::Next);
    let other = Arrival::Rejected(Rejection::OtherWriter);
    assert_eq!(at(&mut a, (9, 0, 2)), other);
    assert_eq!(at(&mut a, (7, 1, 2)), Arrival::Next);
    assert_eq!(at(&mut a, (9, 1, 1002)), other);
    assert_eq!(at(&mut a, (9, 2, 1003)), Arrival::NewEpoch);
    assert_eq!(at(&mut a, (7, 2, 1004)), other);
    // For one that starts anew in shared memory there is the transport's word that the old one
    // is gone: only who starts anew again and again is not believed.
    let mut a = InputAccount::new(Writer::Publisher);
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
    let mut a = InputAccount::new(Writer::Publisher);
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
    let mut a = InputAccount::new(Writer::Publisher);
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
    let mut a = InputAccount::new(Writer::Socket);
    for _ in 0..100 {
        a.reject(Rejection::Schema);
    }
    assert_eq!(at(&mut a, (1, 0, 1)), Arrival::Next);
}

#[test]
fn an_outsider_faster_than_the_schedule_is_thinned_out_and_stays_trusted() {
    let mut a = InputAccount::new(Writer::Socket);
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
fn who_says_something_bad_first_shuts_out_nobody() {
    let mut a = InputAccount::new(Writer::Socket);
    let bad = Err(Rejection::OutOfRange);
    assert!(!with(&mut a, (7, 1, 1), bad).is_taken());
    assert_eq!(at(&mut a, (8, 1, 2)), Arrival::Next);
}

#[test]
fn a_counter_that_starts_over_does_not_end_a_quarantine_but_silence_does() {
    let spoil = |a: &mut InputAccount| {
        assert!(with(a, (1, 100, 1), Ok(())).is_taken());
        for k in 2..20 {
            with(a, (1, 99 + k, k), Err(Rejection::NotFinite));
        }
        assert!(a.is_quarantined());
    };
    let mut a = InputAccount::new(Writer::Socket);
    spoil(&mut a);
    // It sends on, by numbers that have started over; after a second that is a new start.
    for k in 20..1020 {
        with(&mut a, (1, k - 20, k), Err(Rejection::NotFinite));
    }
    let refused = Arrival::Rejected(Rejection::Quarantined);
    assert_eq!(at(&mut a, (1, 1001, 1021)), refused);
    let mut a = InputAccount::new(Writer::Socket);
    spoil(&mut a);
    assert_eq!(at(&mut a, (1, 0, 1021)), Arrival::NewEpoch);
}

#[test]
fn a_source_that_misbehaves_is_quarantined_until_it_behaves() {
    let mut a = InputAccount::new(Writer::Socket);
    let mut k = 0;
    let mut next = |a: &mut InputAccount, content| {
        k += 1;
        with(a, (1, k, k), content)
    };
    let bad = Err(Rejection::NotFinite);
    // Before it has said something good, nobody is known by what is bad.
    next(&mut a, bad);
    assert!(next(&mut a, Ok(())).is_taken());
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

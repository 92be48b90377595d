//! Instants of the monotonic clock by the calendar.

use std::time::{SystemTime, UNIX_EPOCH};

use jiff::Timestamp;
use jiff::tz::TimeZone;
use vigil_cycle::{Clock, Monotonic};

/// What the calendar says at instants of `CLOCK_MONOTONIC`, as of when this was made: a clock that
/// is set later moves no event against another.
#[derive(Debug, Clone, Copy)]
pub struct WallClock {
    /// From `CLOCK_MONOTONIC` to the time since 1970, ns.
    ahead_ns: i128,
}

impl WallClock {
    /// As the machine's clocks stand.
    #[must_use]
    pub fn now() -> Self {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let since_1970_ns = since_1970.map_or(0, |since| since.as_nanos());
        Self {
            ahead_ns: since_1970_ns as i128 - i128::from(Monotonic.now_ns()),
        }
    }

    /// A clock that is `ahead_ns` later since 1970 than `CLOCK_MONOTONIC` says, as of a graph that
    /// ran at another time.
    #[must_use]
    pub const fn ahead_by(ahead_ns: i128) -> Self {
        Self { ahead_ns }
    }

    /// From `CLOCK_MONOTONIC` to the time since 1970, ns.
    #[must_use]
    pub const fn ahead_ns(&self) -> i128 {
        self.ahead_ns
    }

    /// Time since 1970, ns; 0 for what lies before.
    #[must_use]
    pub fn unix_ns(&self, t_ns: u64) -> u64 {
        let unix_ns = self.ahead_ns + i128::from(t_ns);
        u64::try_from(unix_ns.max(0)).unwrap_or(u64::MAX)
    }

    /// RFC 3339, UTC, to the millisecond.
    #[must_use]
    pub fn rfc3339(&self, t_ns: u64) -> String {
        let timestamp = Timestamp::from_nanosecond(self.ahead_ns + i128::from(t_ns));
        timestamp.map_or_else(|_| "?".to_owned(), |timestamp| format!("{timestamp:.3}"))
    }
}

/// Time of day where the machine stands, of seconds since 1970.
#[must_use]
pub fn unix_time_of_day(unix_s: f64) -> String {
    let timestamp = Timestamp::from_millisecond((unix_s * 1e3) as i64);
    timestamp.map_or_else(
        |_| "?".to_owned(),
        |timestamp| time_of_day(&format!("{timestamp:.3}")),
    )
}

/// Time of day where the machine stands, of an instant as [`WallClock::rfc3339`] writes it.
#[must_use]
pub fn time_of_day(rfc3339: &str) -> String {
    let timestamp: Result<Timestamp, _> = rfc3339.parse();
    timestamp.map_or_else(
        |_| "?".to_owned(),
        |timestamp| {
            let here = timestamp.to_zoned(TimeZone::system());
            here.strftime("%H:%M:%S%.3f").to_string()
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_have_a_date_and_a_time_to_the_millisecond() {
        let clock = WallClock::ahead_by(1_700_000_000_000_000_000);
        assert_eq!(clock.unix_ns(12), 1_700_000_000_000_000_012);
        assert_eq!(WallClock::ahead_by(-9).unix_ns(8), 0);
        // `date -u -d @1700000012` says 22:13:32 of 2023-11-14.
        assert_eq!(clock.rfc3339(12_345_678_901), "2023-11-14T22:13:32.345Z");
        assert_eq!(clock.rfc3339(u64::MAX), "2608-06-04T21:47:53.709Z");
        let now = WallClock::now().rfc3339(Monotonic.now_ns());
        let stamp: Timestamp = now.parse().unwrap();
        assert!((stamp.as_second() - Timestamp::now().as_second()).abs() <= 1);
    }

    #[test]
    fn what_is_no_time_has_a_question_mark() {
        let text = time_of_day("2023-11-14T22:13:32.345Z");
        assert!(text.ends_with(":32.345"), "{text}");
        assert_eq!(time_of_day("yesterday"), "?");
        let same = unix_time_of_day(1_699_999_212.345 + 800.0);
        assert_eq!(same, time_of_day("2023-11-14T22:13:32.345Z"));
        assert_eq!(unix_time_of_day(f64::MAX), "?");
    }
}

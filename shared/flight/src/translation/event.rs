//! Events in words, as lines of a log and as JSON.

use vigil_blocks::EventKind;
use vigil_timeline::TimelineEntry;

use crate::message_times::MessageTimes;
use crate::messages::header::Stamp;
use crate::messages::log::{LogLevel, LogLine};
use crate::sink::Sink;
use crate::topics;

/// Codes of kinds, some of which no kind has.
const CODES: std::ops::Range<u32> = 0..256;

fn level(name: &str) -> LogLevel {
    use EventKind as K;
    let mut kinds = CODES.filter_map(K::from_repr);
    match kinds.find(|kind| kind.name() == name) {
        Some(K::Assertion) => LogLevel::Fatal,
        Some(
            K::Diagnosis
            | K::Fault
            | K::InputLost
            | K::SafeStop
            | K::Watchdog
            | K::Blind
            | K::Publisher,
        ) => LogLevel::Error,
        Some(
            K::Alarm
            | K::Miss
            | K::Refused
            | K::Degraded
            | K::Rejected
            | K::Restarted
            | K::Injected
            | K::Latched
            | K::Symptoms,
        ) => LogLevel::Warn,
        Some(K::Step | K::Weighed | K::Particles) => LogLevel::Debug,
        _ => LogLevel::Info,
    }
}

/// Writes an event; when it was.
pub(crate) fn write_event<S: Sink>(
    entry: &TimelineEntry,
    sink: &mut S,
) -> Result<MessageTimes, S::Error> {
    let times = MessageTimes::at(sink.clock().unix_ns(entry.t_ns));
    let line = entry.to_string();
    let line = LogLine {
        stamp: Stamp {
            unix_ns: times.log_ns,
        },
        level: level(&entry.event),
        name: &entry.service,
        text: line.trim(),
    };
    sink.write(&topics::EVENTS, times, &line)?;
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_follow_the_kind_and_what_is_not_known_is_told() {
        assert_eq!(level("diagnosis"), LogLevel::Error);
        assert_eq!(level("safe-stop"), LogLevel::Error);
        assert_eq!(level("assertion"), LogLevel::Fatal);
        assert_eq!(level("alarm"), LogLevel::Warn);
        assert_eq!(level("step"), LogLevel::Debug);
        assert_eq!(level("ready"), LogLevel::Info);
        assert_eq!(level("another"), LogLevel::Info);
    }
}

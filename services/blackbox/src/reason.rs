//! Why a recording is written.

use std::fmt;

use vigil_blocks::{EventKind, FaultState};
use vigil_cycle::topic::ServiceName;

use crate::feeds::News;

/// Why a recording is written, in the order of what names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// A service has ended, was replaced, or no longer reports.
    Crash,
    /// An alarm rose, or a fault became active.
    Alarm,
    /// The robot was told to stop, or stopped itself.
    SafeStop,
    /// Somebody asked for it.
    Request,
    /// A service missed cycles.
    Miss,
    /// Somebody records into a file of his own.
    Record,
}

impl Reason {
    /// The reason that news is of, if any.
    pub fn find(news: &News) -> Option<(Self, ServiceName)> {
        match news {
            News::Replaced(service) | News::Silent(service) => Some((Self::Crash, *service)),
            News::Event(service, event) => {
                let reason = match EventKind::from_repr(event.kind)? {
                    EventKind::Fault => {
                        let state = FaultState::from_repr(event.value as u32 & 0xff);
                        (state == Some(FaultState::Active)).then_some(Self::Alarm)
                    }
                    EventKind::Alarm => Some(Self::Alarm),
                    EventKind::SafeStop => Some(Self::SafeStop),
                    EventKind::Miss => Some(Self::Miss),
                    _ => None,
                };
                Some((reason?, *service))
            }
        }
    }

    /// Its word, as in names of files.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Request => "request",
            Self::Crash => "crash",
            Self::Alarm => "alarm",
            Self::SafeStop => "safe-stop",
            Self::Miss => "miss",
            Self::Record => "record",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_blocks::Event;

    fn reason(kind: EventKind, value: u64) -> Option<Reason> {
        let event = Event {
            kind: kind as u32,
            value,
            ..Event::default()
        };
        Reason::find(&News::Event(ServiceName::Detector, event)).map(|(reason, _)| reason)
    }

    #[test]
    fn alarms_active_faults_crashes_and_misses_are_reasons_and_other_events_are_none() {
        assert_eq!(reason(EventKind::Alarm, 0), Some(Reason::Alarm));
        let state = |state: FaultState| state as u64 | 7 << 8;
        assert_eq!(
            reason(EventKind::Fault, state(FaultState::Active)),
            Some(Reason::Alarm)
        );
        assert_eq!(reason(EventKind::Fault, state(FaultState::Cleared)), None);
        assert_eq!(reason(EventKind::Miss, 3), Some(Reason::Miss));
        assert_eq!(reason(EventKind::SafeStop, 1), Some(Reason::SafeStop));
        assert_eq!(reason(EventKind::Diagnosis, 0), None);
        let replaced = News::Replaced(ServiceName::Supervisor);
        let found = Reason::find(&replaced);
        assert_eq!(found, Some((Reason::Crash, ServiceName::Supervisor)));
    }
}

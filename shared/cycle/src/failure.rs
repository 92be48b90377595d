//! The end of a service of which an assertion has failed.
//!
//! An assertion states what Vigil itself guarantees. When one fails, nothing that the process would
//! publish from then on can be relied upon: it leaves a [`Failure`] for the launcher and ends at
//! once. No further action is published, the last one expires, and the robot stops.

use std::cell::Cell;
use std::fmt;
use std::fs;
use std::io;
use std::panic::{self, PanicHookInfo};
use std::path::{Path, PathBuf};

use crate::clock::{Clock, Monotonic};

/// Exit code of a service that a failed assertion has ended: `EX_SOFTWARE` of sysexits.h.
pub const EXIT_ASSERTION: u8 = 70;

/// What a service works on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Work {
    /// Its start: nothing has been taken yet.
    Start,
    /// The input block with this identity.
    Input { epoch: u64, seq: u64 },
    /// The prediction after so many deadlines without input.
    Missed(u32),
    /// The frame of a source that was due at this instant, ns.
    Frame { t_schedule_ns: u64 },
}

thread_local! {
    static WORK: Cell<Work> = const { Cell::new(Work::Start) };
}

/// Notes what the calling thread works on from now on. Costs one store.
pub(crate) fn work_on(work: Work) {
    WORK.set(work);
}

impl fmt::Display for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => write!(f, "at the start"),
            Self::Input { epoch, seq } => write!(f, "at input {seq} of epoch {epoch}"),
            Self::Missed(count) => write!(f, "after {count} deadlines without input"),
            Self::Frame { t_schedule_ns } => write!(f, "at the frame due at {t_schedule_ns} ns"),
        }
    }
}

/// A failed assertion of a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// When it failed, `CLOCK_MONOTONIC` ns.
    pub t_ns: u64,
    /// File, line and column of the assertion.
    pub location: String,
    /// What the service was working on.
    pub work: String,
    /// What the assertion says, in one line.
    pub message: String,
}

impl Failure {
    fn new(panic: &PanicHookInfo<'_>) -> Self {
        let payload = panic.payload();
        let literal = payload.downcast_ref::<&str>().copied();
        let formatted = payload.downcast_ref::<String>().map(String::as_str);
        let message = literal.or(formatted).unwrap_or("no message");
        Self {
            t_ns: Monotonic.now_ns(),
            location: panic.location().map_or("?".into(), ToString::to_string),
            work: WORK.get().to_string(),
            // An `assert_eq` has a line for each side.
            message: message.split_whitespace().collect::<Vec<_>>().join(" "),
        }
    }

    fn write(&self, path: &Path) -> io::Result<()> {
        let Self {
            t_ns,
            location,
            work,
            message,
        } = self;
        fs::write(path, format!("{t_ns}\n{location}\n{work}\n{message}\n"))
    }

    /// The failure that a process has left at `path`, which is then gone; `None` if it left none.
    #[must_use]
    pub fn take(path: &Path) -> Option<Self> {
        let text = fs::read_to_string(path).ok()?;
        // What cannot be removed now is removed with the graph's other files.
        let _ = fs::remove_file(path);
        let mut lines = text.lines().map(str::to_owned);
        Some(Self {
            t_ns: lines.next()?.parse().ok()?,
            location: lines.next()?,
            work: lines.next()?,
            message: lines.next()?,
        })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            location,
            work,
            message,
            ..
        } = self;
        write!(f, "{message} ({location}), {work}")
    }
}

/// From now on a panic of any thread leaves a [`Failure`] at `path` and ends the process with
/// [`EXIT_ASSERTION`].
pub(crate) fn end_on_panic(path: PathBuf) {
    let print = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        // A file that cannot be written must not keep the process alive.
        let _ = Failure::new(info).write(&path);
        print(info);
        std::process::exit(EXIT_ASSERTION.into());
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_read_once_and_a_damaged_one_is_none() {
        let path = std::env::temp_dir().join(format!("failure-{}", std::process::id()));
        let failure = Failure {
            t_ns: 7,
            location: "src/deadline.rs:7:9".into(),
            work: Work::Input { epoch: 5, seq: 12 }.to_string(),
            message: "instants never go back".into(),
        };
        failure.write(&path).unwrap();
        let read = Failure::take(&path).unwrap();
        assert_eq!(read, failure);
        assert_eq!(
            read.to_string(),
            "instants never go back (src/deadline.rs:7:9), at input 12 of epoch 5"
        );
        assert_eq!(Failure::take(&path), None);
        fs::write(&path, "one line").unwrap();
        assert_eq!(Failure::take(&path), None);
        assert!(!path.exists());
    }
}

//! When a long computation ends: its time is up, or Python was told to stop.

use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::errors::refusal;

/// Between two looks at Python's signals: they need Python's lock, which others hold too.
const LOOK: Duration = Duration::from_millis(50);

/// The end of a computation.
pub struct End {
    at: Option<Instant>,
    next_look: Instant,
    raised: Option<PyErr>,
}

impl End {
    /// After so many seconds; never by itself without any.
    pub fn after(timeout_s: Option<f64>) -> PyResult<Self> {
        let now = Instant::now();
        let at = match timeout_s.map(Duration::try_from_secs_f64) {
            None => None,
            // Beyond what a clock can hold is never.
            Some(Ok(duration)) => now.checked_add(duration),
            Some(Err(_)) => {
                let found = timeout_s.unwrap_or_default();
                return Err(refusal(format!(
                    "timeout_s is {found}, allowed is a number from 0, or None"
                )));
            }
        };
        Ok(Self {
            at,
            next_look: now + LOOK,
            raised: None,
        })
    }

    /// True once it has come. Called without Python's lock.
    pub fn has_come(&mut self) -> bool {
        let now = Instant::now();
        if now >= self.next_look && self.raised.is_none() {
            self.next_look = now + LOOK;
            self.raised = Python::attach(|py| py.check_signals()).err();
        }
        self.raised.is_some() || self.at.is_some_and(|at| now >= at)
    }

    /// What a signal raised, such as KeyboardInterrupt.
    pub fn finish(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

//! When to stop: long computations ask again and again, and end within a moment of being told.

use std::fmt;

/// Elementary operations (multiply and add, compare) between two questions: some 20 us.
const WORK_PER_QUESTION: usize = 20_000;

/// Told to stop before the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StopRequest;

/// What a computation may spend. The caller owns the clock: its closure says when time is up.
pub struct Budget<'a> {
    stop: &'a mut dyn FnMut() -> bool,
    is_stopped: bool,
    work: usize,
    spent: u64,
}

impl<'a> Budget<'a> {
    /// A budget that ends when `stop` says so; once it has, it is not asked again.
    pub fn new(stop: &'a mut dyn FnMut() -> bool) -> Self {
        Self {
            stop,
            is_stopped: false,
            work: 0,
            spent: 0,
        }
    }

    /// Accounts for `work` elementary operations.
    ///
    /// # Errors
    /// [`StopRequest`] once the budget has ended.
    pub fn spend(&mut self, work: usize) -> Result<(), StopRequest> {
        self.work += work;
        self.spent += work as u64;
        if !self.is_stopped && self.work >= WORK_PER_QUESTION {
            self.work = 0;
            self.is_stopped = (self.stop)();
        }
        if self.is_stopped {
            Err(StopRequest)
        } else {
            Ok(())
        }
    }

    /// Elementary operations so far.
    #[must_use]
    pub const fn spent(&self) -> u64 {
        self.spent
    }
}

impl fmt::Debug for Budget<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Budget")
            .field("is_stopped", &self.is_stopped)
            .field("work", &self.work)
            .finish_non_exhaustive()
    }
}

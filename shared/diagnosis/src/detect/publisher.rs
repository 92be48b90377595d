//! Tests of a live publisher: whether its frames come when they are due, and mean what they should.

use vigil_blocks::SensorFrame;
use vigil_checkpoint::Checkpoint;
use vigil_robot::Description;
use vigil_robot::publisher_check::{Finding, PublisherCheck};

use crate::detect::pace::Pace;

/// The tests of a live publisher.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct Publisher {
    meaning: PublisherCheck,
    pace: Pace,
    epoch: u64,
    run_id: u64,
    /// Findings that were not taken yet: of the pace, of the meaning. Nothing follows from them.
    #[checkpoint(scratch)]
    found: [Option<Finding>; 2],
}

impl Publisher {
    /// Of frames of `robot` in a graph of this period, s.
    pub(crate) fn new(robot: &Description, period_s: f64) -> Self {
        Self {
            meaning: PublisherCheck::new(robot),
            pace: Pace::new(period_s),
            epoch: 0,
            run_id: 0,
            found: [None; 2],
        }
    }

    /// True if what was found would hide every fault.
    pub(crate) const fn is_blinding(&self) -> bool {
        self.meaning.is_blinding()
    }

    /// Takes a frame.
    pub(crate) fn take(&mut self, frame: &SensorFrame) {
        let source = (frame.header.epoch, frame.run_id);
        if source != (self.epoch, self.run_id) {
            (self.epoch, self.run_id) = source;
            self.meaning.reset();
        }
        let pace = self.pace.take(frame.header.t_capture_ns);
        self.found[0] = pace.or(self.found[0]);
        // Frames come faster than findings, so that none waits for the next.
        self.found[1] = self.meaning.take(frame).or(self.found[1]);
    }

    /// Deadlines passed without input.
    pub(crate) const fn miss(&mut self, count: u32) {
        self.pace.miss(count);
    }

    /// Findings that were not taken yet.
    pub(crate) fn take_findings(&mut self) -> [Option<Finding>; 2] {
        std::mem::take(&mut self.found)
    }
}

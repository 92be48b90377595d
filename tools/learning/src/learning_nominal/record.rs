//! A run as observations, each with what came before it.

use vigil_robot::Description;
use vigil_robot::nominal::{History, Observer};

use vigil_recording::frames::Run;

/// One run.
#[derive(Debug, Clone)]
pub(super) struct Record {
    /// After each observation: it and those before it.
    pub histories: Vec<History>,
}

/// Observations of a run that one fit looks at.
#[derive(Debug, Clone)]
pub(super) struct Part<'a> {
    /// After each observation: it and those before it.
    pub histories: Vec<&'a History>,
}

impl Record {
    /// Time in motion, s.
    pub fn moving_s(&self) -> f64 {
        let newest = self.histories.iter().filter_map(|history| history.ago(0));
        newest.filter(|now| now.moving).map(|now| now.dt_s).sum()
    }

    /// All of it.
    pub fn whole(&self) -> Part<'_> {
        Part {
            histories: self.histories.iter().collect(),
        }
    }

    /// Cut into blocks: all but every third, and every third.
    pub fn split(&self, blocks: usize) -> (Part<'_>, Part<'_>) {
        let length = self.histories.len().div_ceil(blocks.max(3)).max(1);
        let part = |is_test: bool| {
            let chunks = self.histories.chunks(length).enumerate();
            let chunks = chunks.filter(|(i, _)| (i % 3 == 2) == is_test);
            Part {
                histories: chunks.flat_map(|(_, chunk)| chunk).collect(),
            }
        };
        (part(false), part(true))
    }
}

/// The runs up to a time, s.
pub(super) fn all(runs: &[&Run], until_s: f64, robot: &Description) -> Vec<Record> {
    let record = |run: &&Run| {
        let mut observer = Observer::new(robot);
        let mut histories = Vec::new();
        for frame in &run.frames {
            if frame.header.t_capture_ns as f64 * 1e-9 > until_s {
                break;
            }
            if observer.push(frame).complete {
                histories.push(*observer.history());
            }
        }
        Record { histories }
    };
    runs.iter().map(record).collect()
}

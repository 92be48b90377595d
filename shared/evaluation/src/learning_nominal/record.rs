//! A run as observations, each with what came before it.

use vigil_robot::Description;
use vigil_robot::nominal::{History, Observer};

use crate::frames::Run;

/// One run.
#[derive(Debug, Clone)]
pub(super) struct Record {
    /// After each observation: it and those before it.
    pub histories: Vec<History>,
}

impl Record {
    /// Time in motion, s.
    pub fn moving_s(&self) -> f64 {
        let newest = self.histories.iter().filter_map(|history| history.ago(0));
        newest.filter(|now| now.moving).map(|now| now.dt_s).sum()
    }

    /// The first part and the rest.
    pub fn split(&self, part: f64) -> (Self, Self) {
        let at = (self.histories.len() as f64 * part).round() as usize;
        let (first, rest) = self.histories.split_at(at.min(self.histories.len()));
        let of = |histories: &[History]| Self {
            histories: histories.to_vec(),
        };
        (of(first), of(rest))
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

//! The stages of a run, scored.

use vigil_blocks::SensorFrame;
use vigil_evaluation::scoring::field::Scorer;

use super::frames::Fate;
use super::timeline::Timeline;
use crate::simulated::Stages;

/// When a frame came, s, and how long after the one before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    pub t_s: f64,
    pub dt_s: f64,
}

/// The stages of one set of sensors, and their score.
pub(super) struct Watch<'a> {
    pub(super) stages: Stages,
    pub(super) scorer: Scorer<'a>,
    pub(super) timeline: Option<Timeline>,
}

impl Watch<'_> {
    /// Scores what is said after a frame, `dt_s` after what was scored before.
    pub(super) fn score(&mut self, at: Instant, drives: bool, frame: &SensorFrame) {
        let moment = self.stages.moment(at.t_s, at.dt_s, drives);
        self.scorer.take(&moment);
        if let Some(timeline) = &mut self.timeline {
            timeline.take(&moment, &self.stages, &frame.command);
        }
    }

    /// What comes of a frame; `held` is one that this one has overtaken.
    pub(super) fn deliver(&mut self, frame: &SensorFrame, fate: Fate, held: Option<&SensorFrame>) {
        let stages = &mut self.stages;
        match fate {
            Fate::Lost | Fate::Overtaken => stages.miss(),
            Fate::Late => {
                stages.miss();
                stages.take(frame);
            }
            Fate::Comes | Fate::Doubled => stages.take(frame),
        }
        if let Some(held) = held {
            stages.take(held);
        }
        if fate == Fate::Doubled {
            stages.take(frame);
        }
    }
}

//! The stages of a run, scored.

use vigil_blocks::SensorFrame;
use vigil_evaluation::scoring::Verdict;
use vigil_evaluation::scoring::field::Scorer;
use vigil_evaluation::stages::Stages;

use super::timeline::Timeline;

/// The stages of one set of sensors, and their score.
pub(super) struct Watch<'a> {
    pub(super) stages: Stages,
    pub(super) scorer: Scorer<'a>,
    pub(super) timeline: Option<Timeline>,
}

impl Watch<'_> {
    /// Scores what is said at `t_s`, after a frame that was captured then.
    pub(super) fn score(&mut self, t_s: f64, frame: &SensorFrame) {
        let verdict = Verdict {
            t_s,
            ..self.stages.verdict(frame)
        };
        self.scorer.take(&verdict);
        if let Some(timeline) = &mut self.timeline {
            timeline.take(&verdict, &self.stages, &frame.command);
        }
    }

    /// Takes what arrived in place of a frame; none for one that is missed.
    pub(super) fn take(&mut self, frame: Option<&SensorFrame>) {
        match frame {
            Some(frame) => self.stages.take(frame),
            None => self.stages.miss(),
        }
    }
}

//! The stages of a run, scored.

use vigil_blocks::SensorFrame;
use vigil_evaluation::scoring::Verdict;
use vigil_evaluation::scoring::field::Scorer;
use vigil_evaluation::stages::Stages;

use super::frames::Fate;
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

//! The stages of a run, scored.

use std::collections::BTreeSet;
use std::error::Error;

use vigil_blocks::{FaultRecord, FaultSource, FaultState, Readiness, SensorFrame};
use vigil_decision::{FaultLife, LifeInput};
use vigil_diagnosis::Sensors;
use vigil_evaluation::scoring::Verdict;
use vigil_evaluation::scoring::field::{Run, Scorer, ToldChange};
use vigil_evaluation::stages::Stages;
use vigil_robot::FaultTree;
use vigil_setup::{Setup, fault_name};

use super::timeline::Timeline;
use crate::simulated::stages;

/// The stages of one set of sensors, and their score.
pub(super) struct Watch<'a> {
    pub(super) stages: Stages,
    pub(super) scorer: Scorer<'a>,
    pub(super) timeline: Option<Timeline>,
    told: ToldFaults,
}

/// What an operator is told of the robot's faults.
struct ToldFaults {
    life: FaultLife,
    /// Names of faults.
    tree: FaultTree,
    /// Changes, in order.
    told: Vec<ToldChange>,
    /// The robot's that were pending at some time, by number.
    pending: BTreeSet<u64>,
    /// When the alarm stood last, s.
    alarm_t_s: f64,
    /// Faults that became active without it.
    without_alarm: usize,
}

/// An alarm that has fallen explains what becomes active within this time, s.
const FALLEN_S: f64 = 1.0;

impl ToldFaults {
    fn take(&mut self, t_s: f64, stages: &Stages) {
        let is_armed = stages.detection().readiness == Readiness::Armed as u32;
        self.life.step(LifeInput {
            now_ns: (t_s * 1e9) as u64,
            observed: Some(stages.diagnosis()).filter(|_| is_armed),
            decided: stages.action().into(),
            silent_services: 0,
        });
        if stages.action().alarm != 0 {
            self.alarm_t_s = t_s;
        }
        let is_pending = |record: &&FaultRecord| {
            let is_of_robot = record.source == FaultSource::Robot as u32;
            is_of_robot && record.state() == Some(FaultState::Pending)
        };
        let pending = self.life.records().filter(is_pending);
        self.pending.extend(pending.map(|record| record.number));
        while let Some(record) = self.life.take_change() {
            // That frames are missing is for other figures.
            if record.source == FaultSource::Robot as u32 {
                self.told.push(ToldChange {
                    t_s,
                    number: record.number,
                    fault: fault_name(&self.tree, record.source, record.what).to_owned(),
                    state: record.state().map_or("?", FaultState::name),
                    count: record.count,
                });
                let is_new = record.state() == Some(FaultState::Active);
                let has_alarm = t_s - self.alarm_t_s <= FALLEN_S;
                self.without_alarm += usize::from(is_new && !has_alarm);
            }
        }
    }

    /// Faults of the robot that were gone before they were told of.
    fn pending_alone(&self) -> usize {
        let told: BTreeSet<u64> = self.told.iter().map(|change| change.number).collect();
        self.pending.difference(&told).count()
    }
}

impl<'a> Watch<'a> {
    /// Of the stages of a configuration, but for the sensors they use, the rate and the seed.
    ///
    /// # Errors
    /// If model, robot, tree and settings do not fit together.
    pub(super) fn new(
        setup: &Setup,
        sensors: Sensors,
        rate_hz: f64,
        seed: u64,
        scorer: Scorer<'a>,
    ) -> Result<Self, Box<dyn Error>> {
        Ok(Self {
            stages: stages(setup, sensors, rate_hz, seed)?,
            scorer,
            timeline: None,
            told: ToldFaults {
                life: vigil_supervisor::fault_life(setup)?,
                tree: setup.tree.clone(),
                told: Vec::new(),
                pending: BTreeSet::new(),
                alarm_t_s: f64::NEG_INFINITY,
                without_alarm: 0,
            },
        })
    }

    /// The score.
    pub(super) fn finish(self) -> Run {
        Run {
            told_without_alarm: self.told.without_alarm,
            faults_pending: self.told.pending_alone(),
            told: self.told.told,
            ..self.scorer.finish()
        }
    }

    /// Scores what is said at `t_s`, after a frame that was captured then.
    pub(super) fn score(&mut self, t_s: f64, frame: &SensorFrame) {
        let verdict = Verdict {
            t_s,
            ..self.stages.verdict(frame)
        };
        self.scorer.take(&verdict);
        self.told.take(t_s, &self.stages);
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

//! The identifier at its ports.

use std::collections::VecDeque;

use vigil_blocks::{
    BlockId, Cause, CauseKind, DetectionBelief, Entry, EventKind, FaultBelief, JournalEntry,
    JournalKind, MODE_BLIND, ParticleBlock, SensorFrame,
};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, Graph, HealthBoard, InputAccount, Intake, JournalWriter, PortError, Receiver, Sender,
    Stage, Stamp, Topic, Writer,
};

use vigil_robot::{Description, FrameGuard};

use crate::size_report::SizeReport;
use vigil_diagnosis::identify::{Diagnoser, Input};

/// Sensor frames that may wait for their detection: more than a queue of them holds by default.
const PENDING_MAX: usize = 256;

/// The identifier as a stage of the graph: detections and sensor frames in, belief out.
///
/// It is woken by the detection and joins it with its sensor frame by (epoch, seq). A frame whose
/// detection was folded or lost is stepped without one.
pub struct IdentifierStage {
    identifier: Diagnoser,
    detections: Box<dyn Receiver<DetectionBelief>>,
    detected: Box<dyn Receiver<ParticleBlock>>,
    frames: Box<dyn Receiver<SensorFrame>>,
    frame_account: InputAccount,
    guard: FrameGuard,
    /// Epoch of the last frame that was stepped.
    epoch: u64,
    pending: VecDeque<SensorFrame>,
    /// The last detection that was taken.
    detection: BlockId,
    belief: Box<dyn Sender<FaultBelief>>,
    hypotheses: Box<dyn Sender<ParticleBlock>>,
    reported: LastBelief,
    /// Changes of the mode that the timeline has.
    changes_reported: u32,
    /// The mode that the timeline has. Blindness is the detector's to report.
    mode_reported: u32,
    size: SizeReport,
    journal: JournalWriter,
}

/// The last belief, for the timeline.
#[derive(Debug, Clone, Copy, Default)]
struct LastBelief {
    mode: u32,
    p_mode: f64,
    leaves: u64,
    changes: u32,
    reason: Reason,
}

/// Why the diagnosis is not another.
#[derive(Debug, Clone, Copy, Default)]
struct Reason {
    /// The channel with the most evidence for it.
    channel: u32,
    /// Its evidence, nats.
    evidence: f64,
    /// The next best mode.
    runner_up: u32,
}

impl IdentifierStage {
    /// Opens the identifier's ports on `graph`, for frames of `robot`.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(
        identifier: Diagnoser,
        robot: &Description,
        graph: &Graph,
    ) -> Result<Self, PortError> {
        Ok(Self {
            identifier,
            detections: graph.receiver(Topic::Detection)?,
            detected: graph.receiver(Topic::DetectionParticles)?,
            frames: graph.receiver(Topic::Sensor)?,
            frame_account: InputAccount::new(Writer::Publisher),
            guard: FrameGuard::new(robot),
            epoch: 0,
            pending: VecDeque::with_capacity(PENDING_MAX),
            detection: BlockId::default(),
            belief: graph.sender(Topic::Diagnosis)?,
            hypotheses: graph.sender(Topic::DiagnosisParticles)?,
            reported: LastBelief::default(),
            changes_reported: 0,
            mode_reported: 0,
            size: SizeReport::default(),
            journal: JournalWriter::open(graph, ServiceName::Identifier)?,
        })
    }

    fn take_frames(&mut self, intake: &Intake<'_>) {
        for _ in 0..self.frames.buffer() {
            // A copy: its writer may change the shared block between the check and the step.
            let Some(frame) = self.frames.take_next().copied() else {
                break;
            };
            let (account, content) = (&mut self.frame_account, || self.guard.check(&frame));
            if intake.admit_further::<SensorFrame>(account, &frame.header, content) {
                if self.pending.len() == PENDING_MAX {
                    self.pending.pop_front();
                }
                self.pending.push_back(frame);
            }
        }
    }

    fn position(&self, wanted: BlockId) -> Option<usize> {
        self.pending
            .iter()
            .position(|frame| frame.header.id() == wanted)
    }

    /// Steps the frames up to `wanted`, the one behind the held detection, of which the detector
    /// has folded `count`; false if it was lost on its way here.
    fn step_held(&mut self, wanted: BlockId, count: usize, intake: &Intake<'_>) -> bool {
        if self.position(wanted).is_none() {
            // It was published before its detection, but perhaps after the frames were taken.
            self.take_frames(intake);
        }
        let (Some(last), Some(detection)) = (self.position(wanted), self.detections.held()) else {
            return false;
        };
        while self
            .detected
            .held()
            .is_none_or(|p| precedes(&p.cause, &detection.cause))
        {
            if self.detected.take_next().is_none() {
                break;
            }
        }
        let detected = self.detected.held().filter(|p| p.cause == detection.cause);
        // Frames before those that it has folded, it has refused, by its own clock.
        let refused = (last + 1).saturating_sub(count);
        for (i, frame) in self.pending.drain(..=last).enumerate().skip(refused) {
            let detection = detected.filter(|_| i == last).map(|p| (detection, p));
            let input = Input {
                frame: &frame,
                detection,
            };
            let (belief, out) = (self.belief.block(), self.hypotheses.block());
            let before = std::mem::replace(&mut self.epoch, frame.header.epoch);
            if before != 0 && before != self.epoch {
                self.identifier.step(Entry::Reset, belief, out);
                self.journal.note(JournalEntry::new(JournalKind::Reset, 0));
            }
            self.identifier.step(Entry::Frame(input), belief, out);
            let mut entry = JournalEntry::new(JournalKind::Frame, 1).with_input(frame.header.id());
            if let Some((detection, _)) = detection {
                entry = entry.with_detection(detection.header.id(), detection.blind);
            }
            self.journal.note(entry);
        }
        true
    }
}

/// True if the block behind `a` came before the one behind `b`. A block of another epoch belongs to
/// a source that is gone.
const fn precedes(a: &Cause, b: &Cause) -> bool {
    a.frame_epoch != b.frame_epoch
        || a.frame_seq < b.frame_seq
        || (a.frame_seq == b.frame_seq && a.kind != b.kind)
}

impl Stage for IdentifierStage {
    fn take(&mut self, intake: &mut Intake<'_>) {
        self.take_frames(intake);
        for _ in 0..self.detections.buffer() {
            let Some(detection) = self.detections.take_next() else {
                break;
            };
            let (header, cause) = (detection.header, detection.cause);
            if !intake.accept::<DetectionBelief>(&header) {
                continue;
            }
            self.identifier.look(detection);
            let entry = JournalEntry::new(JournalKind::Looked, 0);
            self.journal
                .note(entry.with_detection(header.id(), detection.blind));
            let newest = header.id();
            let before = std::mem::replace(&mut self.detection, newest);
            let is_next =
                newest.epoch == before.epoch && Some(newest.seq) == before.seq.checked_add(1);
            // Which frames a detection that was lost on its way has answered is not known.
            let folded = if is_next {
                cause.count as usize
            } else {
                PENDING_MAX
            };
            let frame = cause.frame();
            if cause.kind() == Some(CauseKind::Frame) && self.step_held(frame, folded, intake) {
                intake.stepped(&header, frame);
            }
        }
    }

    fn miss(&mut self, count: u32) {
        let (belief, out) = (self.belief.block(), self.hypotheses.block());
        self.identifier.step(Entry::Missed(count), belief, out);
        self.journal
            .note(JournalEntry::new(JournalKind::Missed, count));
    }

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        let belief = self.belief.block();
        belief.cause = cause;
        let evidence = belief.channel_evidence.iter().enumerate();
        let strongest = evidence.max_by(|a, b| a.1.total_cmp(b.1));
        let (channel, evidence) = strongest.map_or((0, 0.0), |(i, value)| (i, *value));
        self.reported = LastBelief {
            mode: belief.mode,
            p_mode: belief.p_mode,
            leaves: belief.sets[0].leaves,
            changes: belief.mode_change_count,
            reason: Reason {
                channel: channel as u32,
                evidence,
                runner_up: belief.runner_up,
            },
        };
        self.size.take(belief);
        self.hypotheses.block().cause = cause;
        self.journal.answer(&*self.belief);
        let published_ns = self.belief.send(stamp, clock)?;
        // The hypotheses have observers only: after the belief.
        self.hypotheses.send(stamp, clock)?;
        Ok(published_ns)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.belief.prepare()?;
        self.hypotheses.prepare()
    }

    fn particles(&self) -> u32 {
        self.identifier.particles()
    }

    fn particles_in_use(&self) -> u32 {
        self.identifier.particles_in_use()
    }

    fn limit(&mut self, particles: u32) {
        let (belief, out) = (self.belief.block(), self.hypotheses.block());
        self.identifier.step(Entry::Budget(particles), belief, out);
        self.journal
            .note(JournalEntry::new(JournalKind::Budget, particles));
    }

    fn has_input(&self) -> bool {
        self.detections.is_waiting()
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        health.add_input(&self.frame_account);
        let LastBelief {
            mode,
            p_mode,
            leaves,
            changes,
            reason,
        } = self.reported;
        if changes != self.changes_reported {
            self.changes_reported = changes;
            if mode == MODE_BLIND || mode == std::mem::replace(&mut self.mode_reported, mode) {
                return;
            }
            let kind = if mode == 0 {
                EventKind::Cleared
            } else {
                EventKind::Diagnosis
            };
            health.event(now_ns, kind, mode, p_mode, leaves);
            if reason.evidence > 0.0 {
                let (evidence, against) = (reason.evidence, u64::from(reason.runner_up));
                health.event(now_ns, EventKind::Reason, reason.channel, evidence, against);
            }
        }
        if let Some(news) = self.size.news() {
            let sd = news.sd.to_bits();
            health.event(now_ns, EventKind::Size, news.what, news.size, sd);
        }
    }

    fn keep_journal(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<(), PortError> {
        self.journal.publish(&self.identifier, stamp, clock)
    }
}

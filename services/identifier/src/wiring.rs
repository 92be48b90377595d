//! The identifier at its ports.

use std::collections::VecDeque;

use vigil_blocks::{
    Cause, CauseKind, DetectionBelief, Entry, EventKind, FaultBelief, ParticleBlock, SensorFrame,
};
use vigil_cycle::{
    Clock, Graph, HealthBoard, InputAccount, Intake, PortError, Receiver, Sender, Stage, Stamp,
    Topic,
};

use crate::{Identifier, Input};

/// Sensor frames that may wait for their detection.
const PENDING_MAX: usize = 64;

/// The identifier as a stage of the graph: detections and sensor frames in, belief out.
///
/// It is woken by the detection and joins it with its sensor frame by (epoch, seq). A frame whose
/// detection was folded or lost is stepped without one.
pub struct IdentifierStage {
    identifier: Identifier,
    detections: Box<dyn Receiver<DetectionBelief>>,
    detected: Box<dyn Receiver<ParticleBlock>>,
    frames: Box<dyn Receiver<SensorFrame>>,
    frame_account: InputAccount,
    pending: VecDeque<SensorFrame>,
    period_ns: u64,
    belief: Box<dyn Sender<FaultBelief>>,
    particles: Box<dyn Sender<ParticleBlock>>,
    stepped: bool,
    reported: Reported,
    told: u32,
}

/// What the last belief said, for the timeline.
#[derive(Debug, Clone, Copy, Default)]
struct Reported {
    mode: u32,
    p_mode: f64,
    leaves: u64,
    changes: u32,
}

impl IdentifierStage {
    /// Opens the identifier's ports on `graph`, for a schedule of `period_ns`.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(identifier: Identifier, graph: &Graph, period_ns: u64) -> Result<Self, PortError> {
        Ok(Self {
            identifier,
            detections: graph.receiver(Topic::Detection)?,
            detected: graph.receiver(Topic::DetectionParticles)?,
            frames: graph.receiver(Topic::Sensor)?,
            frame_account: InputAccount::default(),
            pending: VecDeque::with_capacity(PENDING_MAX),
            period_ns,
            belief: graph.sender(Topic::Diagnosis)?,
            particles: graph.sender(Topic::DiagnosisParticles)?,
            stepped: false,
            reported: Reported::default(),
            told: 0,
        })
    }

    fn take_frames(&mut self, now_ns: u64) {
        for _ in 0..self.frames.buffer() {
            if !self.frames.advance() {
                break;
            }
            let Some(frame) = self.frames.held() else {
                break;
            };
            let account = &mut self.frame_account;
            if account
                .arrive::<SensorFrame>(&frame.header, now_ns, self.period_ns)
                .is_taken()
            {
                if self.pending.len() == PENDING_MAX {
                    self.pending.pop_front();
                }
                self.pending.push_back(*frame);
            }
        }
    }

    /// Steps the frames up to the one behind the held detection.
    fn step_held(&mut self) {
        let Some(detection) = self.detections.held() else {
            return;
        };
        let wanted = (detection.cause.frame_epoch, detection.cause.frame_seq);
        let is_wanted = |f: &SensorFrame| (f.header.epoch, f.header.seq) == wanted;
        let Some(last) = self.pending.iter().position(is_wanted) else {
            return;
        };
        while self
            .detected
            .held()
            .is_none_or(|p| precedes(&p.cause, &detection.cause))
        {
            if !self.detected.advance() {
                break;
            }
        }
        let particles = self.detected.held().filter(|p| p.cause == detection.cause);
        for (i, frame) in self.pending.drain(..=last).enumerate() {
            let detection = particles.filter(|_| i == last).map(|p| (detection, p));
            let input = Input {
                frame: &frame,
                detection,
            };
            let (belief, out) = (self.belief.block(), self.particles.block());
            self.identifier.step(Entry::Frame(input), belief, out);
        }
        self.stepped = true;
    }

    fn step_without_frame(&mut self, count: u32) {
        let (belief, particles) = (self.belief.block(), self.particles.block());
        self.identifier
            .step(Entry::Missed(count), belief, particles);
        self.stepped = true;
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
        self.stepped = false;
        self.take_frames(intake.now_ns());
        for _ in 0..self.detections.buffer() {
            if !self.detections.advance() {
                break;
            }
            let Some(detection) = self.detections.held() else {
                break;
            };
            let cause = detection.cause;
            let is_frame = cause.kind() == Some(CauseKind::Frame);
            let identity = is_frame.then_some((cause.frame_epoch, cause.frame_seq));
            if intake.accept::<DetectionBelief>(&detection.header, identity) && is_frame {
                self.step_held();
            }
        }
    }

    fn miss(&mut self, count: u32) {
        self.step_without_frame(count);
    }

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        if !self.stepped {
            // The frame behind the detection was lost on its way here.
            self.step_without_frame(0);
        }
        let belief = self.belief.block();
        belief.cause = cause;
        self.reported = Reported {
            mode: belief.mode,
            p_mode: belief.p_mode,
            leaves: belief.sets[0].leaves,
            changes: belief.mode_change_count,
        };
        self.particles.block().cause = cause;
        let published_ns = self.belief.send(stamp, clock)?;
        // The particles have observers only: after the belief.
        self.particles.send(stamp, clock)?;
        Ok(published_ns)
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        let Reported {
            mode,
            p_mode,
            leaves,
            changes,
        } = self.reported;
        if changes != self.told {
            let kind = if mode == 0 {
                EventKind::Cleared
            } else {
                EventKind::Diagnosis
            };
            health.event(now_ns, kind, mode, p_mode, leaves);
            self.told = changes;
        }
    }
}

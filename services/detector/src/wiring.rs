//! The detector at its ports.

use vigil_blocks::{
    Cause, DetectionBelief, Entry, EventKind, JournalEntry, JournalKind, ParticleBlock, Readiness,
    SensorFrame,
};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, Graph, HealthBoard, Intake, JournalWriter, PortError, Receiver, Sender, Stage, Stamp,
    Topic, Writer,
};

use vigil_robot::{Description, FrameGuard};

use vigil_diagnosis::detect::Detector;

/// A rest is reported after so long, ns: a robot that reverses stands for less.
const REST_NS: u64 = 1_000_000_000;

/// The detector as a stage of the graph: sensor frames in, belief and hypotheses out.
pub struct DetectorStage {
    detector: Detector,
    guard: FrameGuard,
    /// Epoch of the last frame that was stepped.
    epoch: u64,
    frames: Box<dyn Receiver<SensorFrame>>,
    belief: Box<dyn Sender<DetectionBelief>>,
    hypotheses: Box<dyn Sender<ParticleBlock>>,
    alarm: bool,
    alarm_reported: bool,
    p_fault: f64,
    symptoms: u32,
    symptoms_reported: u32,
    sight: SightReport,
    context: ContextReport,
    journal: JournalWriter,
}

/// The last change that is no fault, and how many the timeline has.
#[derive(Debug, Clone, Copy, Default)]
struct ContextReport {
    count: u32,
    reported: u32,
    context: u32,
    t_capture_ns: u64,
}

impl ContextReport {
    const fn take(&mut self, belief: &DetectionBelief) {
        self.count = belief.context_count;
        (self.context, self.t_capture_ns) = (belief.context, belief.context_t_capture_ns);
    }

    fn report(&mut self, health: &mut HealthBoard, now_ns: u64) {
        if self.count != self.reported {
            let (kind, t_ns) = (EventKind::ContextChanged, self.t_capture_ns);
            health.event(now_ns, kind, self.context, 0.0, t_ns);
            self.reported = self.count;
        }
    }
}

/// Blindness and readiness of the last belief, and what the timeline has of them.
#[derive(Debug, Clone, Copy, Default)]
struct SightReport {
    blind: u32,
    blind_reported: u32,
    blind_since_ns: u64,
    readiness: u32,
    armed_reported: bool,
    /// Since when the robot rests, ns, and whether the timeline has that.
    rest_ns: Option<u64>,
    rest_reported: bool,
}

impl SightReport {
    fn report(&mut self, health: &mut HealthBoard, now_ns: u64) {
        if self.blind != self.blind_reported {
            if self.blind_reported == 0 {
                self.blind_since_ns = now_ns;
            }
            if self.blind == 0 {
                let blind_ns = now_ns.saturating_sub(self.blind_since_ns);
                health.event(now_ns, EventKind::BlindEnds, 0, 0.0, blind_ns);
            } else {
                health.event(now_ns, EventKind::Blind, self.blind, 0.0, 0);
            }
            self.blind_reported = self.blind;
        }
        // A blind detector does not know whether the robot stands.
        let is_blind = self.blind != 0;
        let readiness = Readiness::from_repr(self.readiness).filter(|_| !is_blind);
        let is_armed = matches!(readiness, Some(Readiness::Armed | Readiness::NotExcited));
        if is_armed && !self.armed_reported {
            health.event(now_ns, EventKind::Armed, 0, 0.0, 0);
        }
        self.armed_reported = is_armed || is_blind && self.armed_reported;
        if readiness == Some(Readiness::NotExcited) {
            let since_ns = *self.rest_ns.get_or_insert(now_ns);
            if !self.rest_reported && now_ns.saturating_sub(since_ns) >= REST_NS {
                health.event(now_ns, EventKind::NotExcited, 0, 0.0, 0);
                self.rest_reported = true;
            }
            return;
        }
        self.rest_ns = None;
        if std::mem::take(&mut self.rest_reported) {
            health.event(now_ns, EventKind::Excited, 0, 0.0, 0);
        }
    }
}

impl DetectorStage {
    /// Opens the detector's ports on `graph`, for frames of `robot`.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(detector: Detector, robot: &Description, graph: &Graph) -> Result<Self, PortError> {
        Ok(Self {
            detector,
            guard: FrameGuard::new(robot),
            epoch: 0,
            frames: graph.receiver(Topic::Sensor)?,
            belief: graph.sender(Topic::Detection)?,
            hypotheses: graph.sender(Topic::DetectionParticles)?,
            alarm: false,
            alarm_reported: false,
            p_fault: 0.0,
            symptoms: 0,
            symptoms_reported: 0,
            sight: SightReport::default(),
            context: ContextReport::default(),
            journal: JournalWriter::open(graph, ServiceName::Detector)?,
        })
    }
}

impl Stage for DetectorStage {
    fn take(&mut self, intake: &mut Intake<'_>) {
        for _ in 0..self.frames.buffer() {
            // A copy: its writer may change the shared block between the check and the step.
            let Some(frame) = self.frames.take_next().copied() else {
                break;
            };
            let content = || self.guard.check(&frame);
            if intake.admit::<SensorFrame>(&frame.header, content) {
                let (belief, hypotheses) = (self.belief.block(), self.hypotheses.block());
                let before = std::mem::replace(&mut self.epoch, frame.header.epoch);
                if before != 0 && before != self.epoch {
                    // A publisher that starts anew may have another clock.
                    self.detector.step(Entry::Reset, belief, hypotheses);
                    self.journal.note(JournalEntry::new(JournalKind::Reset, 0));
                }
                self.detector.step(Entry::Frame(&frame), belief, hypotheses);
                let entry = JournalEntry::new(JournalKind::Frame, 1);
                self.journal.note(entry.with_input(frame.header.id()));
                intake.stepped(&frame.header, frame.header.id());
            } else {
                self.detector.refuse();
                self.journal
                    .note(JournalEntry::new(JournalKind::Refused, 1));
            }
        }
    }

    fn miss(&mut self, count: u32) {
        let (belief, hypotheses) = (self.belief.block(), self.hypotheses.block());
        self.detector.step(Entry::Missed(count), belief, hypotheses);
        self.journal
            .note(JournalEntry::new(JournalKind::Missed, count));
    }

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        let belief = self.belief.block();
        belief.cause = cause;
        (self.alarm, self.p_fault) = (belief.alarm != 0, belief.p_fault);
        self.symptoms = belief.symptoms;
        self.context.take(belief);
        (self.sight.blind, self.sight.readiness) = (belief.blind, belief.readiness);
        self.hypotheses.block().cause = cause;
        self.journal.answer(&*self.belief);
        // Hypotheses first: they are there when the belief wakes the identifier.
        self.hypotheses.send(stamp, clock)?;
        self.belief.send(stamp, clock)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.belief.prepare()?;
        self.hypotheses.prepare()
    }

    fn writer(&self) -> Writer {
        Writer::Publisher
    }

    fn has_input(&self) -> bool {
        self.frames.is_waiting()
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        self.sight.report(health, now_ns);
        self.context.report(health, now_ns);
        for finding in self.detector.findings().into_iter().flatten() {
            let what = finding.to_wire();
            health.event(now_ns, EventKind::Publisher, what, finding.value, 0);
        }
        if self.detector.is_monitoring() && self.symptoms != self.symptoms_reported {
            health.event(now_ns, EventKind::Symptoms, self.symptoms, 0.0, 0);
            self.symptoms_reported = self.symptoms;
        }
        if self.alarm != self.alarm_reported {
            let kind = if self.alarm {
                EventKind::Alarm
            } else {
                EventKind::Cleared
            };
            health.event(now_ns, kind, 0, self.p_fault, 0);
            self.alarm_reported = self.alarm;
        }
    }

    fn keep_journal(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<(), PortError> {
        self.journal.publish(&self.detector, stamp, clock)
    }
}

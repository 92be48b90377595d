//! The detector at its ports.

use vigil_blocks::{Cause, DetectionBelief, Entry, EventKind, ParticleBlock, SensorFrame};
use vigil_cycle::{
    Clock, Graph, HealthBoard, Intake, PortError, Receiver, Sender, Stage, Stamp, Topic, Writer,
};

use vigil_robot::{Description, FrameGuard};

use crate::Detector;

/// The detector as a stage of the graph: sensor frames in, belief and particles out.
pub struct DetectorStage {
    detector: Detector,
    guard: FrameGuard,
    /// Epoch of the last frame that was stepped.
    epoch: u64,
    frames: Box<dyn Receiver<SensorFrame>>,
    belief: Box<dyn Sender<DetectionBelief>>,
    particles: Box<dyn Sender<ParticleBlock>>,
    alarm: bool,
    alarm_told: bool,
    p_fault: f64,
    symptoms: u32,
    symptoms_told: u32,
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
            particles: graph.sender(Topic::DetectionParticles)?,
            alarm: false,
            alarm_told: false,
            p_fault: 0.0,
            symptoms: 0,
            symptoms_told: 0,
        })
    }
}

impl Stage for DetectorStage {
    fn take(&mut self, intake: &mut Intake<'_>) {
        for _ in 0..self.frames.buffer() {
            if !self.frames.advance() {
                break;
            }
            // A copy: what is judged must be what is stepped, whatever its writer writes meanwhile.
            let Some(frame) = self.frames.held().copied() else {
                break;
            };
            let content = || self.guard.check(&frame);
            if intake.admit::<SensorFrame>(&frame.header, content) {
                let (belief, particles) = (self.belief.block(), self.particles.block());
                let before = std::mem::replace(&mut self.epoch, frame.header.epoch);
                if before != 0 && before != self.epoch {
                    // A publisher that starts anew may have another clock.
                    self.detector.step(Entry::Reset, belief, particles);
                }
                self.detector.step(Entry::Frame(&frame), belief, particles);
                intake.stepped(&frame.header, (frame.header.epoch, frame.header.seq));
            }
        }
    }

    fn miss(&mut self, count: u32) {
        let (belief, particles) = (self.belief.block(), self.particles.block());
        self.detector.step(Entry::Missed(count), belief, particles);
    }

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        let belief = self.belief.block();
        belief.cause = cause;
        (self.alarm, self.p_fault) = (belief.alarm != 0, belief.p_fault);
        self.symptoms = belief.symptoms;
        self.particles.block().cause = cause;
        // Particles first: they are there when the belief wakes the identifier.
        self.particles.send(stamp, clock)?;
        self.belief.send(stamp, clock)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.detector.prepare();
        self.belief.prepare()?;
        self.particles.prepare()
    }

    fn particles(&self) -> u32 {
        self.detector.particles()
    }

    fn limit(&mut self, particles: u32) {
        let (belief, cloud) = (self.belief.block(), self.particles.block());
        self.detector.step(Entry::Budget(particles), belief, cloud);
    }

    fn writer(&self) -> Writer {
        Writer::Publisher
    }

    fn has_input(&self) -> bool {
        self.frames.is_waiting()
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        if self.detector.is_monitoring() && self.symptoms != self.symptoms_told {
            health.event(now_ns, EventKind::Symptoms, self.symptoms, 0.0, 0);
            self.symptoms_told = self.symptoms;
        }
        if self.alarm != self.alarm_told {
            let kind = if self.alarm {
                EventKind::Alarm
            } else {
                EventKind::Cleared
            };
            health.event(now_ns, kind, 0, self.p_fault, 0);
            self.alarm_told = self.alarm;
        }
    }
}

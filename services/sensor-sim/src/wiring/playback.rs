//! Recorded frames as the source of the graph.

use vigil_blocks::{EventKind, SensorFrame};
use vigil_cycle::{
    Clock, Graph, HealthBoard, PortError, Sender, Source, SourceOutcome, Stamp, Topic,
};

use super::actions::Actions;
use super::peers::Peers;
use crate::playback::Playback;

/// Plays recorded frames, one per period of the schedule; capture times stay the recording's own.
/// A recording ignores actions.
pub struct PlaybackSource {
    playback: Playback,
    peers: Peers,
    actions: Actions,
    frames: Box<dyn Sender<SensorFrame>>,
    run_id: u64,
    run_published: u64,
    ready_published: bool,
    /// Scheduled instant of the last frame.
    last_ns: u64,
    ended: bool,
    end_published: bool,
}

impl PlaybackSource {
    /// Opens the playback's ports on `graph`.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(playback: Playback, graph: &Graph) -> Result<Self, PortError> {
        Ok(Self {
            playback,
            peers: Peers::new(graph)?,
            actions: Actions::new(graph)?,
            frames: graph.sender(Topic::Sensor)?,
            run_id: 0,
            run_published: 0,
            ready_published: false,
            last_ns: 0,
            ended: false,
            end_published: false,
        })
    }
}

impl Source for PlaybackSource {
    fn produce(
        &mut self,
        t_schedule_ns: u64,
        clock: &dyn Clock,
    ) -> Result<SourceOutcome, PortError> {
        if !self.peers.are_up() {
            return Ok(SourceOutcome::Nothing);
        }
        self.actions.take(t_schedule_ns, self.frames.epoch());
        let Some(frame) = self.playback.next() else {
            self.ended = true;
            return Ok(SourceOutcome::End);
        };
        *self.frames.block() = *frame;
        (self.run_id, self.last_ns) = (frame.run_id, t_schedule_ns);
        let stamp = Stamp {
            t_schedule_ns,
            t_capture_ns: frame.header.t_capture_ns,
        };
        self.frames.send(stamp, clock).map(SourceOutcome::Frame)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.frames.prepare()
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        if let (Some(ready_ns), false) = (self.actions.ready_ns(), self.ready_published) {
            health.event(ready_ns, EventKind::Ready, 0, 0.0, self.frames.next_seq());
            self.ready_published = true;
        }
        if self.run_id != self.run_published {
            // Recorded runs count from 0, run ids from 1.
            health.event(now_ns, EventKind::Run, 0, 0.0, self.run_id - 1);
            self.run_published = self.run_id;
        }
        if self.ended && !self.end_published {
            health.event(now_ns, EventKind::EndOfRecording, 0, 0.0, self.last_ns);
            self.end_published = true;
        }
    }
}

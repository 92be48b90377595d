//! The simulated rover as the source of the graph.

use vigil_blocks::{
    ActionRejection, Block, BlockId, Cause, CauseKind, Control, ControlCommand, EventKind,
    SensorFrame, Truth,
};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, Graph, HealthBoard, PortError, Receiver, Sender, Source, SourceOutcome, Stamp, Topic,
};
use vigil_robot::disturbance_kind::PARAMETERS;
use vigil_robot::injection::{Change, WireChange};

use super::actions::Actions;
use super::peers::Peers;
use crate::action_gate::EffectiveCommand;
use crate::injection_schedule::InjectionSchedule;
use crate::navigation::{DecisionId, NavigatorEvent};
use crate::simulation::Simulation;

/// Changes that become events in one cycle; further ones are made without an event.
/// A specification has a handful.
const CHANGES_MAX: usize = 16;

/// Publishes the simulated rover's frames and what is true of it, and executes actions, injections
/// and control commands.
pub struct SimulatorSource {
    simulation: Simulation,
    event: Option<NavigatorEvent>,
    schedule: InjectionSchedule,
    allow_injection: bool,
    peers: Peers,
    actions: Actions,
    control: Box<dyn Receiver<Control>>,
    frames: Box<dyn Sender<SensorFrame>>,
    truths: Box<dyn Sender<Truth>>,
    at_goal: bool,
    last_ns: Option<u64>,
    began_ns: Option<u64>,
    period_ns: u64,
    changes: Vec<(u64, Change)>,
    ready_published: bool,
    rejection: Option<ActionRejection>,
    rejection_published: Option<ActionRejection>,
    /// The decision executed last.
    executed: DecisionId,
    executed_published: DecisionId,
}

impl SimulatorSource {
    /// Opens the simulator's ports on `graph`. Each start of a simulator is a run of its own.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(
        mut simulation: Simulation,
        schedule: InjectionSchedule,
        allow_injection: bool,
        period_ns: u64,
        graph: &Graph,
    ) -> Result<Self, PortError> {
        let frames = graph.sender(Topic::Sensor)?;
        simulation.world.set_run_id(frames.epoch());
        Ok(Self {
            simulation,
            event: None,
            schedule,
            allow_injection,
            peers: Peers::new(graph)?,
            actions: Actions::new(graph)?,
            control: graph.receiver(Topic::Control(ServiceName::SensorSim))?,
            frames,
            truths: graph.sender(Topic::Truth)?,
            at_goal: false,
            last_ns: None,
            period_ns,
            began_ns: None,
            changes: Vec::with_capacity(CHANGES_MAX),
            ready_published: false,
            rejection: None,
            rejection_published: None,
            executed: DecisionId::default(),
            executed_published: DecisionId::default(),
        })
    }

    /// Continues a drive that began at `began_ns`, if given: injections due until now take effect
    /// at once.
    #[must_use]
    pub fn resuming(mut self, began_ns: Option<u64>) -> Self {
        self.ready_published = began_ns.is_some();
        self.began_ns = began_ns;
        self
    }

    /// Makes a change; true if the simulated rover can be changed so.
    fn change(&mut self, change: Change, at_ns: u64) -> bool {
        let done = self.simulation.change(change).is_ok();
        if done && self.changes.len() < CHANGES_MAX {
            self.changes.push((at_ns, change));
        }
        done
    }

    /// Fills the block of truth about this frame.
    fn tell_truth(&mut self, frame: BlockId, run_id: u64, command: EffectiveCommand) {
        let state = self.simulation.world.true_state();
        let truth = self.truths.block();
        truth.cause = Cause {
            kind: CauseKind::Frame as u32,
            count: 1,
            frame_epoch: frame.epoch,
            frame_seq: frame.seq,
        };
        truth.run_id = run_id;
        (truth.pose, truth.velocity) = (state.pose, state.velocity);
        if let (None, Some(action)) = (command.rejection, self.actions.newest()) {
            truth.obeyed = action.kind;
            (truth.stuck_wheels, truth.broken_encoders) =
                (action.stuck_wheels, action.broken_encoders);
        }
        truth.is_disturbed = u32::from(self.simulation.world.is_disturbed());
        truth.touches = u32::from(self.simulation.touches());
        truth.at_goal = u32::from(self.at_goal);
    }

    fn take_due_injections(&mut self, t_schedule_ns: u64) {
        let Some(began_ns) = self.began_ns.or(self.actions.ready_ns()) else {
            return;
        };
        let elapsed_ns = t_schedule_ns.saturating_sub(began_ns);
        while let Some(change) = self.schedule.due(elapsed_ns) {
            self.change(change, t_schedule_ns);
        }
    }

    fn take_control(&mut self, health: &mut HealthBoard, now_ns: u64) {
        for _ in 0..self.control.buffer() {
            let Some(command) = self.control.take_next().copied() else {
                break;
            };
            let wanted = change_of(&command);
            let permitted = self.allow_injection && command.header.schema == Control::SCHEMA;
            let done = permitted && wanted.is_some_and(|change| self.change(change, now_ns));
            health.answer_control(command.header.epoch, command.header.seq, done);
            if !done {
                health.event(now_ns, EventKind::Refused, command.command, 0.0, 0);
            }
        }
    }
}

/// The change that a command asks for, if it is one.
fn change_of(command: &Control) -> Option<Change> {
    let injects = command.command == ControlCommand::Inject as u32;
    let known = injects || command.command == ControlCommand::Clear as u32;
    let mut parameter = [0.0; PARAMETERS];
    parameter.copy_from_slice(&command.parameter[..PARAMETERS]);
    let wire = WireChange {
        injects,
        kind: command.fault,
        place: command.wheel,
        parameter,
    };
    known.then(|| Change::from_wire(&wire)).flatten()
}

impl Source for SimulatorSource {
    fn produce(
        &mut self,
        t_schedule_ns: u64,
        clock: &dyn Clock,
    ) -> Result<SourceOutcome, PortError> {
        if !self.peers.are_up() {
            return Ok(SourceOutcome::Nothing);
        }
        self.actions.take(t_schedule_ns, self.frames.epoch());
        self.take_due_injections(t_schedule_ns);
        let last_ns = self.last_ns.replace(t_schedule_ns);
        let passed_ns = last_ns.map_or(self.period_ns, |last_ns| t_schedule_ns - last_ns);
        let (dt_s, action) = (passed_ns as f64 * 1e-9, self.actions.newest());
        let command = self.simulation.step(dt_s, action, clock.now_ns());
        self.rejection = command.rejection;
        if let (None, Some(action)) = (command.rejection, self.actions.newest()) {
            self.executed = DecisionId {
                epoch: action.header.epoch,
                seq: command.action_seq,
            };
        }
        self.simulation.measure(self.frames.block());
        let run_id = self.frames.block().run_id;
        let frame = BlockId {
            epoch: self.frames.epoch(),
            seq: self.frames.next_seq(),
        };
        self.event = self.simulation.take_event().or(self.event);
        self.at_goal |= self.event == Some(NavigatorEvent::Goal);
        let stamp = Stamp {
            t_schedule_ns,
            t_capture_ns: t_schedule_ns,
        };
        let published_ns = self.frames.send(stamp, clock)?;
        // Nobody in the graph waits for it: after the frame.
        self.tell_truth(frame, run_id, command);
        self.truths.send(stamp, clock)?;
        Ok(SourceOutcome::Frame(published_ns))
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.frames.prepare()?;
        self.truths.prepare()
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        if let (Some(ready_ns), false) = (self.actions.ready_ns(), self.ready_published) {
            health.event(ready_ns, EventKind::Ready, 0, 0.0, self.frames.next_seq());
            self.ready_published = true;
            self.rejection_published = None;
        }
        if self.ready_published
            && self.executed != self.executed_published
            && let Some(action) = self.actions.newest()
        {
            let (what, wheels) = (action.action, action.answered().to_event());
            health.event(now_ns, EventKind::Obeys, what, 0.0, wheels);
            self.executed_published = self.executed;
        }
        match self.event.take() {
            Some(NavigatorEvent::Ended(kind, outcome)) => {
                health.event(now_ns, EventKind::Outcome, kind as u32, 0.0, outcome as u64);
            }
            Some(NavigatorEvent::Goal) => health.event(now_ns, EventKind::Goal, 0, 0.0, 0),
            None => {}
        }
        self.take_control(health, now_ns);
        for (at_ns, change) in self.changes.drain(..) {
            let wire = change.to_wire();
            let (what, p, value) = wire.event();
            let kind = match wire.injects {
                true => EventKind::Injected,
                false => EventKind::Restored,
            };
            health.event(at_ns, kind, what, p, value);
        }
        // Standing still before the first action is no event.
        if self.ready_published && self.rejection != self.rejection_published {
            match self.rejection {
                Some(reason) => health.event(now_ns, EventKind::SafeStop, reason as u32, 0.0, 0),
                None => health.event(now_ns, EventKind::SafeStopEnds, 0, 0.0, 0),
            }
            self.rejection_published = self.rejection;
        }
    }
}

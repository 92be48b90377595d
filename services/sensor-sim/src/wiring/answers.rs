//! What the graph decides, sent back to whoever sends it frames.

use vigil_blocks::{
    Action, Block, FaultBelief, NAME_SIZE, SizeKind, Verdict, datagram, fixed_name, mode_word,
};
use vigil_cycle::datagrams::{Datagrams, From};
use vigil_cycle::{Graph, PortError, Topic};

use super::newest::Newest;

/// The names of a graph's faults and actions, as verdicts carry them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct VerdictNames {
    modes: Vec<[u8; NAME_SIZE]>,
    actions: Vec<[u8; NAME_SIZE]>,
}

impl VerdictNames {
    /// Names of the fault tree's nodes and of the decision model's actions, in their order.
    pub fn new<'a>(
        modes: impl Iterator<Item = &'a str>,
        actions: impl Iterator<Item = &'a str>,
    ) -> Self {
        Self {
            modes: modes.map(fixed_name).collect(),
            actions: actions.map(fixed_name).collect(),
        }
    }

    fn mode(&self, mode: u32) -> [u8; NAME_SIZE] {
        let name = self.modes.get(mode as usize).copied();
        mode_word(mode).map(fixed_name).or(name).unwrap_or_default()
    }

    fn action(&self, action: u32) -> [u8; NAME_SIZE] {
        self.actions
            .get(action as usize)
            .copied()
            .unwrap_or_default()
    }
}

/// Answers each action with a verdict.
pub(super) struct Answers {
    names: VerdictNames,
    action: Newest<Action>,
    belief: Newest<FaultBelief>,
    verdict: Box<Verdict>,
    /// The action has not been answered yet.
    is_new: bool,
}

impl Answers {
    pub(super) fn new(names: VerdictNames, graph: &Graph, epoch: u64) -> Result<Self, PortError> {
        let mut verdict = Box::<Verdict>::default();
        (verdict.header.schema, verdict.header.epoch) = (Verdict::SCHEMA, epoch);
        Ok(Self {
            names,
            action: Newest::new(graph.receiver(Topic::Action)?),
            belief: Newest::new(graph.receiver(Topic::Diagnosis)?),
            verdict,
            is_new: false,
        })
    }

    /// Takes what has been decided; true if anything has.
    pub(super) fn take(&mut self) -> bool {
        self.belief.take(|_| {});
        self.is_new |= self.action.take(|_| {});
        self.is_new
    }

    /// Sends what was taken and not sent yet, if there is somebody to send it to.
    pub(super) fn send(&mut self, datagrams: &Datagrams, to: Option<From>, now_ns: u64) {
        let is_new = std::mem::take(&mut self.is_new);
        let Some(to) = to.filter(|_| is_new) else {
            return;
        };
        let (action, belief) = (self.action.block(), self.belief.block());
        let verdict = &mut self.verdict;
        verdict.fill(action, belief, now_ns);
        verdict.header.t_schedule_ns = action.header.t_schedule_ns;
        verdict.header.t_capture_ns = action.header.t_capture_ns;
        verdict.action_name = self.names.action(action.action);
        verdict.mode_name = self.names.mode(belief.reported);
        verdict.runner_up_name = self.names.mode(belief.runner_up);
        verdict.size_name = fixed_name(SizeKind::from_wire(verdict.size_kind).word());
        verdict.header.t_publish_ns = now_ns;
        // One that does not arrive is replaced by the next; a robot without any stops.
        datagrams.answer(to, &datagram::encode_verdict(verdict));
        verdict.header.seq += 1;
    }
}

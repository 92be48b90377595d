//! Diagnosis of a robot by a model of its channels: which component fails, how, and by how much.

use vigil_blocks::{
    DetectionBelief, Entry, FAULT_NODES, FaultBelief, FaultSet, MODE_UNKNOWN, ParticleBlock,
    Readiness,
};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_robot::channel_model::belief::{ComponentBelief, PairBelief};
use vigil_robot::channel_model::{Model, Monitor, Observer, components};
use vigil_robot::{ChannelMap, Description, DetectorAlarm, FaultTree};

use crate::identify::identifier::Input;
use crate::identify::leaf_map::{IdentifierError, LeafMap};
use crate::identify::onset_sight::OnsetSight;
use crate::identify::reported::ReportedFault;
use crate::identify::tree_belief::TreeBelief;
use crate::invariants;
use crate::sensors::Sensors;

/// Log-odds of a fault in the last seconds above which they say which one it is. Chosen: even odds.
/// Below, as while the robot rests, the last diagnosis stands.
const TELLING_LOG_ODDS: f64 = 0.0;
/// Probability of the unknown, given a fault, from which on no fault is named: even odds.
const NAMED_ELSE: f64 = 0.5;

/// What is believed of the components, given that something is wrong.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Verdict {
    /// Probability of each node's leaf alone.
    leaves: [f64; FAULT_NODES],
    /// Two leaves at once.
    pair: FaultSet,
    unknown: f64,
    size: [f64; FAULT_NODES],
    size_sd: [f64; FAULT_NODES],
    size_kind: [u32; FAULT_NODES],
    onset_ns: u64,
    /// Node of the most probable leaf; 0 if there is none.
    likeliest: usize,
    runner_up: u32,
}

const NO_VERDICT: Verdict = Verdict {
    leaves: [0.0; FAULT_NODES],
    pair: FaultSet { leaves: 0, p: 0.0 },
    unknown: 1.0,
    size: [0.0; FAULT_NODES],
    size_sd: [0.0; FAULT_NODES],
    size_kind: [0; FAULT_NODES],
    onset_ns: 0,
    likeliest: 0,
    runner_up: 0,
};

/// Divides the detector's probability of a fault among the components of the robot.
#[derive(Debug, Clone, Checkpoint)]
pub struct ChannelIdentifier {
    observer: Observer,
    monitor: Monitor,
    #[checkpoint(fixed)]
    map: ChannelMap,
    /// Leaf of each component; none for what the tree does not name: it is unknown.
    #[checkpoint(fixed)]
    leaf: Vec<Option<usize>>,
    #[checkpoint(fixed)]
    leaves: LeafMap,
    verdict: Verdict,
    posterior: TreeBelief,
    reported: ReportedFault,
    run_id: u64,
    /// Capture time of the last frame, ns, and motion in it, s, until it has been reported.
    t_ns: u64,
    moved_s: f64,
    alarm: DetectorAlarm,
    sight: OnsetSight,
    /// The robot moved at the last detection.
    moves: bool,
    /// The last seconds have told something since the run began.
    has_judged: bool,
}

impl ChannelIdentifier {
    /// An identifier of the faults that `tree` names.
    ///
    /// # Errors
    /// [`IdentifierError`] if the model is of another robot, or the tree names a fault that the
    /// robot cannot have, or one twice.
    pub fn new(
        model: &Model,
        robot: &Description,
        tree: &FaultTree,
        (sensors, fault_rate_1_h): (Sensors, f64),
    ) -> Result<Self, IdentifierError> {
        model.check_robot(robot)?;
        let components = components(robot);
        let mut leaf = vec![None; components.len()];
        let mut leaves = LeafMap::of_tree(tree);
        for node in tree.leaves() {
            let named = &tree.nodes()[node];
            let fault = named.fault.as_deref().unwrap_or_default();
            let component = components.iter().position(|one| one.fault == fault);
            let Some(component) = component else {
                let known = components.iter().map(|one| one.fault.as_str());
                return Err(IdentifierError::Component {
                    leaf: named.name.clone(),
                    fault: fault.to_owned(),
                    known: known.collect::<Vec<_>>().join(", "),
                });
            };
            if let Some(other) = leaf[component].replace(node) {
                let other = tree.nodes()[other].name.clone();
                return Err(IdentifierError::Twice(other, named.name.clone()));
            }
            leaves.add(tree, node);
        }
        let monitor = Monitor::new(model, robot, sensors.into(), fault_rate_1_h);
        let monitor = monitor.ok_or_else(|| {
            IdentifierError::Build("the model has no law of the channels in use".to_owned())
        })?;
        Ok(Self {
            observer: Observer::new(robot),
            monitor,
            map: ChannelMap::new(robot),
            leaf,
            leaves,
            verdict: NO_VERDICT,
            posterior: TreeBelief::nominal(),
            reported: ReportedFault::default(),
            run_id: 0,
            t_ns: 0,
            moved_s: 0.0,
            alarm: DetectorAlarm::default(),
            sight: OnsetSight::default(),
            moves: false,
            has_judged: false,
        })
    }

    /// Takes one entry of the journal and fills the belief (headers and causes are the
    /// caller's); hypotheses it has none.
    pub fn step(
        &mut self,
        entry: Entry<Input<'_>>,
        belief: &mut FaultBelief,
        hypotheses: &mut ParticleBlock,
    ) {
        let mut predicted = self.posterior;
        match entry {
            Entry::Frame(input) => {
                let outcome = self.observer.push(input.frame);
                if outcome.new_run || input.frame.run_id != self.run_id {
                    self.run_id = input.frame.run_id;
                    self.begin_run();
                    predicted = self.posterior;
                }
                if outcome.complete {
                    let (history, orders) = (self.observer.history(), self.observer.orders());
                    self.monitor.step(history, orders);
                    if self.monitor.report().log_odds > TELLING_LOG_ODDS {
                        self.judge();
                    }
                }
                let t_ns = input.frame.header.t_capture_ns;
                let dt_s = t_ns.saturating_sub(self.t_ns) as f64 * 1e-9;
                if let Some((detection, _)) = input.detection {
                    self.take(detection, dt_s);
                }
                self.t_ns = t_ns;
            }
            Entry::Reset => {
                self.observer.reset();
                self.begin_run();
            }
            Entry::Missed(_) | Entry::Budget(_) => {}
        }
        hypotheses.count = 0;
        self.report(&predicted, belief);
        let leaves = self.leaf.iter().filter_map(|leaf| *leaf);
        invariants::fault_belief(belief, leaves);
    }

    fn begin_run(&mut self) {
        self.monitor.reset();
        self.verdict = NO_VERDICT;
        self.posterior = TreeBelief::nominal();
        self.reported.begin_run();
        self.t_ns = 0;
        // An alarm of this run stands on.
        self.alarm.begin_run(self.run_id);
        (self.sight, self.moves) = (OnsetSight::default(), false);
        if self.alarm.stands() {
            self.sight.take(true);
        }
        self.has_judged = false;
    }

    /// False while nothing is known of an alarm that stood before this identifier began.
    fn is_heard(&self) -> bool {
        self.has_judged && self.verdict.unknown < NAMED_ELSE || !self.sight.is_short()
    }

    /// What the last seconds say of the components.
    fn judge(&mut self) {
        let mut verdict = NO_VERDICT;
        let mut named = 0.0;
        // The two most probable leaves.
        let mut best = [(0.0, 0_usize); 2];
        let now_ns = self.observer.history().ago(0).map_or(0, |now| now.t_ns);
        for (belief, leaf) in self.monitor.beliefs().iter().zip(&self.leaf) {
            let Some(node) = *leaf else { continue };
            let ComponentBelief { p, age_s, .. } = *belief;
            verdict.leaves[node] = p;
            verdict.size[node] = belief.size;
            verdict.size_sd[node] = belief.size_sd;
            verdict.size_kind[node] = belief.size_kind as u32;
            named += p;
            if p > best[0].0 {
                best = [(p, node), best[0]];
                verdict.onset_ns = now_ns.saturating_sub((1e9 * age_s) as u64);
                verdict.likeliest = node;
            } else if p > best[1].0 {
                best[1] = (p, node);
            }
        }
        if let Some(PairBelief { p, components }) = self.monitor.pair()
            && let [Some(first), Some(second)] = components.map(|component| self.leaf[component])
        {
            let leaves = 1 << first | 1 << second;
            verdict.pair = FaultSet { leaves, p };
            named += p;
        }
        // The window shows the last seconds alone: a fault that stands began before.
        let before = &self.verdict;
        if self.alarm.stands() && before.likeliest == verdict.likeliest && before.onset_ns != 0 {
            verdict.onset_ns = verdict.onset_ns.min(before.onset_ns);
        }
        verdict.unknown = (1.0 - named).clamp(0.0, 1.0);
        // Probabilities that sum to a little more than one, by rounding, sum to one.
        let most = named.max(1.0);
        verdict.leaves.iter_mut().for_each(|p| *p /= most);
        verdict.pair.p /= most;
        verdict.runner_up = match best {
            [_, (p, node)] if p > verdict.unknown => node as u32,
            _ => MODE_UNKNOWN,
        };
        self.verdict = verdict;
        self.has_judged = true;
    }

    fn take(&mut self, detection: &DetectionBelief, dt_s: f64) {
        let moves = detection.readiness == Readiness::Armed as u32 && self.t_ns != 0;
        self.moved_s = if moves { dt_s } else { 0.0 };
        self.alarm.take(detection);
        if std::mem::replace(&mut self.moves, moves) {
            self.sight.pass(self.alarm.passed_s());
        }
        self.sight.take(self.alarm.stands());
        let mut belief = TreeBelief::watching(self.alarm.p_fault());
        let p_fault = belief.unknown;
        if !self.alarm.stands() || !self.is_heard() {
            self.posterior = belief;
            return;
        }
        belief.clear();
        let nominal = FaultSet {
            leaves: 0,
            p: 1.0 - p_fault,
        };
        belief.add(nominal, &self.leaves);
        for node in self.leaf.iter().filter_map(|leaf| *leaf) {
            let set = FaultSet {
                leaves: 1 << node,
                p: p_fault * self.verdict.leaves[node],
            };
            belief.add(set, &self.leaves);
        }
        let pair = self.verdict.pair;
        if pair.leaves != 0 {
            let p = p_fault * pair.p;
            belief.add(FaultSet { p, ..pair }, &self.leaves);
        }
        let leaves: f64 = self.verdict.leaves.iter().sum();
        let named = belief.nodes[0] + p_fault * (leaves + pair.p);
        belief.unknown = (1.0 - named).clamp(0.0, 1.0);
        belief.entropy += crate::identify::tree_belief::entropy(belief.unknown);
        self.posterior = belief;
    }

    /// Before the alarm the mode is nominal, whatever the odds are in passing. Its changes are
    /// counted where they are seen, by [`crate::identify::blind_override`].
    fn report(&mut self, predicted: &TreeBelief, belief: &mut FaultBelief) {
        let posterior = &self.posterior;
        let alarm = self.alarm.stands();
        let identifies = alarm && self.is_heard();
        let (mode, p_mode) = match identifies {
            true => posterior.mode(&self.leaves),
            false => (0, posterior.nodes[0]),
        };
        let moved_s = std::mem::take(&mut self.moved_s);
        self.reported
            .take(mode, p_mode, posterior, &self.leaves, moved_s);
        belief.run_id = self.run_id;
        posterior.write(&self.leaves, belief);
        belief.p_predicted = predicted.nodes;
        belief.p_unknown_predicted = predicted.unknown;
        belief.mode = mode;
        belief.reported = self.reported.name();
        belief.p_mode = p_mode;
        belief.alarm_t_capture_ns = if alarm { self.alarm.t_ns() } else { 0 };
        belief.identifying = u32::from(identifies);
        if identifies {
            let verdict = &self.verdict;
            belief.onset_t_capture_ns = verdict.onset_ns;
            (belief.size, belief.size_sd) = (verdict.size, verdict.size_sd);
            (belief.size_kind, belief.runner_up) = (verdict.size_kind, verdict.runner_up);
            let odds = &self.monitor.report().channels;
            belief.channel_evidence = self.map.to_evidence(&odds.map(|odds| odds.max(0.0)), 0.0);
        } else {
            belief.onset_t_capture_ns = 0;
            (belief.size, belief.size_sd) = ([0.0; FAULT_NODES], [0.0; FAULT_NODES]);
            (belief.size_kind, belief.runner_up) = ([0; FAULT_NODES], 0);
            belief.channel_evidence.fill(0.0);
        }
    }
}

//! The library's filters over single faults, by name.

use nalgebra::Vector3;
use vigil_blocks::{FaultSet, MODE_UNKNOWN, WHEELS, WeightedHypothesis};
use vigil_checkpoint::Checkpoint;
use vigil_inference::adaptive::Adaptive;
use vigil_inference::bootstrap::ParticleFilter;
use vigil_inference::filter::Filter;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hierarchical::Hierarchical;
use vigil_inference::hybrid::Modes;
use vigil_inference::look_ahead::LookAhead;
use vigil_inference::merged::Merged;
use vigil_inference::proposal::Proposal;
use vigil_inference::resample::Resampling;
use vigil_inference::track::TRACK_DIMENSION;
use vigil_robot::Description;
use vigil_robot::FaultTree;
use vigil_robot::learned::switching::{MODES_MAX, SwitchingObservation};
use vigil_robot::learned::{
    FaultRates, Healthy, Mover, NoiseScales, Observation, Switching, triangle,
};

use crate::identify::fault_rates::fault_rates;
use crate::identify::hypotheses::HypothesisList;
use crate::identify::leaf_map::{IdentifierError, LeafMap};
use crate::identify::models::Models;
use crate::identify::risk::risks;
use crate::identify::set_probabilities::FLOOR;
use crate::identify::settings::{IdentifierFilter, PARTICLES, Settings};
use crate::identify::tree_belief::{TreeBelief, entropy};

/// Share of the draws that leave a mode in the raised proposals. Chosen by hand: half at most
/// doubles a weight's spread; smaller finds a rare fault later.
const RAISED: f64 = 0.5;
/// Each particle of the look-ahead filter tries every mode, so that there are fewer of them: an
/// eighth costs about what the others do.
const LOOK_AHEAD_SHARE: usize = 8;
/// KLD-sampling (Fox 2003): largest distance between sampled and true belief, as in the paper.
const KLD_DISTANCE: f64 = 0.05;
/// It is kept with 99 %: that quantile of the standard normal.
const KLD_QUANTILE: f64 = 2.326;
/// Least number of particles: no fewer than the modes.
const PARTICLES_MIN: usize = 32;
/// A fault began when its probability was last below this. Chosen by hand: above what a prior alone
/// reaches, below the 0.5 at which the fault has a name.
const ONSET: f64 = 0.1;

/// A filter and its model.
#[derive(Debug, Clone, Checkpoint)]
enum LibraryFilter {
    Sampled(ParticleFilter<Switching>),
    Hierarchical(Hierarchical<Switching>),
    LookAhead(LookAhead<Switching, TRACK_DIMENSION>),
    Merged(Merged<Switching, TRACK_DIMENSION>),
}

/// The node of the tree that a mode of the model stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ModeNode {
    Node(usize),
    Unknown,
}

/// A filter over nominal, single faults and the unknown.
#[derive(Debug, Clone, Checkpoint)]
pub struct SingleFaultFilter {
    kind: LibraryFilter,
    #[checkpoint(fixed)]
    nodes_of_modes: Vec<ModeNode>,
    use_wheels: bool,
    seed: u64,
    limit: usize,
    /// Travel while the robot counted as standing, m.
    pending_m: f64,
    since_ns: [u64; MODES_MAX],
    degenerate_count: u32,
}

/// This filter holds one fault at a time: a particle with a wrong one gets the right one only by a
/// change of fault. So a change must not be as rare as a second fault is: it has the rate of a
/// first one.
fn rates(robot: &Description, leaves: &LeafMap, p_unknown: f64) -> FaultRates {
    FaultRates {
        further: 1.0,
        ..fault_rates(&robot.fault_prior, leaves, p_unknown)
    }
}

impl SingleFaultFilter {
    /// A filter over the leaves of a tree.
    ///
    /// # Errors
    /// [`IdentifierError`] if the models do not fit the filter.
    pub fn new(
        models: &Models<'_>,
        leaves: &LeafMap,
        settings: &Settings,
        use_wheels: bool,
        seed: u64,
    ) -> Result<Self, IdentifierError> {
        let encoders = use_wheels.then(|| leaves.encoder_wheels());
        let encoders = encoders.unwrap_or_default();
        let rates = rates(models.robot, leaves, settings.p_unknown);
        let (model, robot, stuck) = (models.model, models.robot, leaves.stuck_wheels());
        let switching = Switching::new(model, robot, stuck, encoders, &rates);
        let nodes_of_modes: Vec<ModeNode> = (0..switching.modes())
            .map(|mode| meaning(&switching, mode, leaves))
            .collect();
        let count = settings.particles.unwrap_or(PARTICLES);
        let refuse = |error: &dyn std::fmt::Display| IdentifierError::Build(error.to_string());
        let sampled = |proposal, model| {
            let filter = ParticleFilter::new(model, proposal, Resampling::default(), count, seed);
            filter.map_err(|e| refuse(&e))
        };
        let raised = |model: &Switching| Proposal::raised(model, RAISED).map_err(|e| refuse(&e));
        let kind = match settings.filter {
            IdentifierFilter::MultipleHypothesis => return Err(refuse(&"not one of these")),
            IdentifierFilter::Bootstrap => {
                let proposal = Proposal::prior(&switching).map_err(|e| refuse(&e))?;
                LibraryFilter::Sampled(sampled(proposal, switching)?)
            }
            IdentifierFilter::Raised => {
                LibraryFilter::Sampled(sampled(raised(&switching)?, switching)?)
            }
            IdentifierFilter::Adaptive => {
                let adaptive = Adaptive::new(KLD_DISTANCE, KLD_QUANTILE, PARTICLES_MIN, count);
                let filter = sampled(raised(&switching)?, switching)?;
                LibraryFilter::Sampled(filter.with_adaptive_count(adaptive))
            }
            IdentifierFilter::RiskSensitive => {
                let prior = rates.fault_1_s * settings.ring_s;
                let proposal = risk_raised(models, &switching, &nodes_of_modes, prior, count)?;
                LibraryFilter::Sampled(sampled(proposal, switching)?)
            }
            IdentifierFilter::Hierarchical => {
                let nodes = abstract_nodes(models.tree, leaves, &nodes_of_modes);
                let filter =
                    Hierarchical::new(switching, &nodes, Resampling::default(), count, seed);
                let filter = filter.map_err(|e| refuse(&e))?;
                LibraryFilter::Hierarchical(filter.with_raised_proposals(RAISED))
            }
            IdentifierFilter::LookAhead => {
                let count = count.div_ceil(LOOK_AHEAD_SHARE);
                let filter = LookAhead::new(switching, count, seed);
                LibraryFilter::LookAhead(filter.map_err(|e| refuse(&e))?)
            }
            IdentifierFilter::Imm => {
                LibraryFilter::Merged(Merged::new(switching).map_err(|e| refuse(&e))?)
            }
        };
        Ok(Self {
            kind,
            nodes_of_modes,
            use_wheels,
            seed,
            limit: count,
            pending_m: 0.0,
            since_ns: [0; MODES_MAX],
            degenerate_count: 0,
        })
    }

    /// Starts from the nominal mode, its pose known as the detector knew it at `t_ns`.
    pub fn restart(&mut self, healthy: &Healthy, t_ns: u64) {
        self.pending_m = 0.0;
        self.since_ns = [t_ns; MODES_MAX];
        self.model_mut().start_at(healthy.pose, healthy.covariance);
        match &mut self.kind {
            LibraryFilter::Sampled(filter) => filter.restart(self.seed),
            LibraryFilter::Hierarchical(filter) => filter.restart(self.seed),
            LibraryFilter::LookAhead(filter) => filter.restart(self.seed),
            LibraryFilter::Merged(filter) => filter.reset(),
        }
    }

    /// Most particles.
    #[must_use]
    pub const fn limit(&self) -> usize {
        self.limit
    }

    /// Particles at present, as [`Self::limit`] counts them.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.kind {
            LibraryFilter::Sampled(filter) => filter.count(),
            LibraryFilter::Hierarchical(filter) => filter.particles().count(),
            LibraryFilter::LookAhead(filter) => LOOK_AHEAD_SHARE * filter.particles().count(),
            LibraryFilter::Merged(_) => 0,
        }
    }

    /// From the next observation on at most `count` particles.
    pub fn set_limit(&mut self, count: usize) {
        self.limit = count;
        match &mut self.kind {
            LibraryFilter::Sampled(filter) => filter.limit(count),
            LibraryFilter::Hierarchical(filter) => filter.limit(count),
            LibraryFilter::LookAhead(filter) => filter.limit(count.div_ceil(LOOK_AHEAD_SHARE)),
            // One Gaussian a mode: nothing to save.
            LibraryFilter::Merged(_) => {}
        }
    }

    const fn model_mut(&mut self) -> &mut Switching {
        match &mut self.kind {
            LibraryFilter::Sampled(filter) => filter.model_mut(),
            LibraryFilter::Hierarchical(filter) => filter.model_mut(),
            LibraryFilter::LookAhead(filter) => filter.model_mut(),
            LibraryFilter::Merged(filter) => filter.model_mut(),
        }
    }

    fn filter(&self) -> &dyn Filter<Observation = SwitchingObservation> {
        match &self.kind {
            LibraryFilter::Sampled(filter) => filter,
            LibraryFilter::Hierarchical(filter) => filter,
            LibraryFilter::LookAhead(filter) => filter,
            LibraryFilter::Merged(filter) => filter,
        }
    }

    fn filter_mut(&mut self) -> &mut dyn Filter<Observation = SwitchingObservation> {
        match &mut self.kind {
            LibraryFilter::Sampled(filter) => filter,
            LibraryFilter::Hierarchical(filter) => filter,
            LibraryFilter::LookAhead(filter) => filter,
            LibraryFilter::Merged(filter) => filter,
        }
    }

    /// Observations that nothing explained, and were passed over.
    #[must_use]
    pub const fn degenerate_count(&self) -> u32 {
        self.degenerate_count
    }

    /// Takes one observation.
    pub fn step(&mut self, observation: &Observation, noise: NoiseScales) {
        let mut observation = *observation;
        observation.travel_m += std::mem::take(&mut self.pending_m);
        let is_useful = observation.moving || observation.anchor && observation.pose_frames > 0;
        if !is_useful {
            // A robot at rest tells nothing: no fault appears, fades or is named.
            self.pending_m = observation.travel_m;
            return;
        }
        let use_wheels = self.use_wheels;
        let scaled = self.model_mut().look(&observation, noise, use_wheels);
        let step = self.filter_mut().step(&scaled);
        if step.event.is_some() {
            self.degenerate_count = self.degenerate_count.saturating_add(1);
        }
        let mut since_ns = self.since_ns;
        for (since_ns, p) in since_ns.iter_mut().zip(self.filter().posterior()) {
            if *p < ONSET {
                *since_ns = observation.t_first_ns;
            }
        }
        self.since_ns = since_ns;
    }

    /// Fills the probabilities of nodes, sets and unknown.
    pub fn posterior(&self, leaves: &LeafMap, out: &mut TreeBelief) {
        let p = self.filter().posterior();
        let total: f64 = p.iter().map(|p| p.max(FLOOR)).sum();
        out.clear();
        for (meaning, p) in self.nodes_of_modes.iter().zip(p) {
            let p = p.max(FLOOR) / total;
            match *meaning {
                ModeNode::Unknown => out.unknown += p,
                ModeNode::Node(node) => {
                    let set = leaves_of(node);
                    out.add(FaultSet { leaves: set, p }, leaves);
                }
            }
        }
        out.entropy += entropy(out.unknown);
    }

    /// Onset of a leaf's fault, capture time ns; 0 if it is no leaf.
    #[must_use]
    pub fn onset(&self, node: usize) -> u64 {
        self.onset_of_mode(ModeNode::Node(node))
    }

    /// Onset of the unknown, capture time ns.
    #[must_use]
    pub fn onset_unknown(&self) -> u64 {
        self.onset_of_mode(ModeNode::Unknown)
    }

    fn onset_of_mode(&self, meaning: ModeNode) -> u64 {
        let p = self.filter().posterior();
        let modes =
            (0..self.nodes_of_modes.len()).filter(|&mode| self.nodes_of_modes[mode] == meaning);
        modes
            .max_by(|&a, &b| p[a].total_cmp(&p[b]))
            .map_or(0, |mode| self.since_ns[mode])
    }

    /// Adds the particles with their weights, or each mode's Gaussian.
    pub fn hypotheses(&self, out: &mut HypothesisList) {
        match &self.kind {
            LibraryFilter::Sampled(filter) => {
                let total: f64 = filter.particles().map(|(_, _, weight)| weight).sum();
                for (mode, state, weight) in filter.particles() {
                    self.push(out, state.pose, [0.0; 6], mode, weight / total);
                }
            }
            LibraryFilter::Hierarchical(filter) => {
                for (state, shares, weight) in filter.particles() {
                    for (mode, &share) in shares.iter().enumerate() {
                        self.push(out, state.pose, [0.0; 6], mode, weight * share);
                    }
                }
            }
            LibraryFilter::LookAhead(filter) => {
                let weight = 1.0 / filter.particles().count() as f64;
                for (mode, state) in filter.particles() {
                    let (pose, covariance) = pose(state);
                    self.push(out, pose, covariance, mode, weight);
                }
            }
            LibraryFilter::Merged(filter) => {
                let states = filter.states().iter().zip(filter.posterior());
                for (mode, (state, &weight)) in states.enumerate() {
                    let (pose, covariance) = pose(state);
                    self.push(out, pose, covariance, mode, weight);
                }
            }
        }
    }

    /// Adds one, unless it is impossible.
    fn push(
        &self,
        out: &mut HypothesisList,
        pose: Vector3<f64>,
        covariance: [f64; 6],
        mode: usize,
        weight: f64,
    ) {
        if weight.is_nan() || weight <= 0.0 {
            return;
        }
        let (leaves, index) = match self.nodes_of_modes[mode] {
            ModeNode::Node(node) => (leaves_of(node), node as u32),
            ModeNode::Unknown => (0, MODE_UNKNOWN),
        };
        out.push(WeightedHypothesis {
            leaves,
            onset_t_capture_ns: if index == 0 { 0 } else { self.since_ns[mode] },
            pose: pose.into(),
            pose_covariance: covariance,
            log_weight: weight.ln(),
            mode: index,
            ..WeightedHypothesis::default()
        });
    }
}

/// The set of faults, as bits, that a mode's node is; the nominal one is none.
const fn leaves_of(node: usize) -> u64 {
    if node == 0 { 0 } else { 1 << node }
}

/// Proposals raised by what it costs to lose track of each mode; `prior` is that of each fault.
fn risk_raised(
    models: &Models,
    switching: &Switching,
    nodes_of_modes: &[ModeNode],
    prior: f64,
    count: usize,
) -> Result<Proposal, IdentifierError> {
    let missing = || IdentifierError::Build("risk-sensitive needs a decision model".to_owned());
    let by_state = models.risks.ok_or_else(missing)?;
    let named = names(models.tree, nodes_of_modes, prior);
    let risks = risks(by_state, &named, count)?;
    Proposal::risk_raised(switching, RAISED, &risks)
        .map_err(|error| IdentifierError::Build(error.to_string()))
}

/// Of each mode the names of the states that it may belong to, and its prior probability.
fn names(tree: &FaultTree, nodes_of_modes: &[ModeNode], prior: f64) -> Vec<(Vec<String>, f64)> {
    let nominal = 1.0 - prior * nodes_of_modes.len().saturating_sub(1) as f64;
    let named = nodes_of_modes.iter().map(|meaning| match meaning {
        ModeNode::Node(0) => (vec![tree.nodes()[0].name.clone()], nominal),
        ModeNode::Node(node) => (tree.state_names(*node).collect(), prior),
        ModeNode::Unknown => (vec!["UNKNOWN".to_owned()], prior),
    });
    named.collect()
}

fn meaning(switching: &Switching, mode: usize, leaves: &LeafMap) -> ModeNode {
    let leaf = match switching.meaning(mode) {
        (Mover::Unknown | Mover::UnknownAny, _) => return ModeNode::Unknown,
        (_, Some(wheel)) => leaves.encoder[wheel],
        (moved, None) => (0..WHEELS)
            .find(|&wheel| moved.is_stuck(wheel))
            .and_then(|wheel| leaves.stuck[wheel]),
    };
    ModeNode::Node(leaf.unwrap_or(0))
}

/// Modes below each abstract node of a tree that has two or more of them; of nodes with the same
/// modes the first.
fn abstract_nodes(
    tree: &FaultTree,
    leaves: &LeafMap,
    nodes_of_modes: &[ModeNode],
) -> Vec<Vec<usize>> {
    let mut nodes: Vec<Vec<usize>> = Vec::new();
    for (index, node) in tree.nodes().iter().enumerate().skip(1) {
        let is_below = |meaning: &ModeNode| match meaning {
            ModeNode::Node(node) => leaves.below[index] >> node & 1 == 1,
            ModeNode::Unknown => false,
        };
        let modes = (1..nodes_of_modes.len()).filter(|&mode| is_below(&nodes_of_modes[mode]));
        let modes: Vec<usize> = modes.collect();
        if node.fault.is_none() && modes.len() > 1 && !nodes.contains(&modes) {
            nodes.push(modes);
        }
    }
    nodes
}

/// Moments of the pose of a track.
fn pose(state: &Gaussian<TRACK_DIMENSION>) -> (Vector3<f64>, [f64; 6]) {
    let covariance = state.covariance.fixed_view::<3, 3>(0, 0).into();
    (state.mean.fixed_rows::<3>(0).into(), triangle(&covariance))
}

//! The identifier over fault models: keeps a ring, identifies from it after an alarm, reports.

use nalgebra::Vector3;
use vigil_blocks::{
    CATCHING_UP, DetectionBelief, Entry, FaultBelief, HealthyBelief, MODE_UNKNOWN, ParticleBlock,
    SensorFrame,
};
use vigil_checkpoint::Checkpoint;
use vigil_robot::learned::{Healthy, Observer, motion_modes};
use vigil_robot::{FaultPrior, detector_alarm::are_named};

use crate::identify::channel_evidence::{ChannelEvidence, Drive};
use crate::identify::detection::Detection;
use crate::identify::engine::Engine;
use crate::identify::fault_rates::fault_rates;
use crate::identify::further_stage::FurtherStage;
use crate::identify::hypotheses::{HypothesisList, copy};
use crate::identify::leaf_map::{IdentifierError, LeafMap};
use crate::identify::models::Models;
use crate::identify::multiple_hypothesis::MultipleHypothesis;
use crate::identify::node_sizes::NodeSizes;
use crate::identify::phase::Phase;
use crate::identify::reported::ReportedFault;
use crate::identify::ring::{Ring, RingEntry};
use crate::identify::settings::{IdentifierFilter, Settings};
use crate::identify::single_fault::SingleFaultFilter;
use crate::identify::tree_belief::TreeBelief;
use crate::identify::trouble::believed;
use crate::invariants;
use crate::sensors::Sensors;

/// Why another filter is refused.
const FURTHER_NEED_HYPOTHESES: &str =
    "leaves steer, pose, torque, current and gyro need identifier.filter = \"multiple-hypothesis\"";

/// Observations that the evidence of a diagnosis is summed over at its start, at most. Chosen by
/// hand: a second of them; more would cost a cycle with a new name more than the filter does.
const EVIDENCE_MAX: usize = 20;

/// What the identifier takes each cycle.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// The sensor frame.
    pub frame: &'a SensorFrame,
    /// The detector's belief and hypotheses of the same frame, if they are known.
    pub detection: Option<(&'a DetectionBelief, &'a ParticleBlock)>,
}

/// The identification filter at frame rate.
///
/// Before an alarm it reports nominal with 1 - p(fault) and keeps a ring of observations, each
/// with what the detector believed after it. An alarm starts the filter from what it believed at
/// the beginning of the ring: the fault had not happened yet, and later beliefs of the robot as a
/// healthy one follow a nominal model that no longer holds. The ring is worked off within about
/// 0.1 s, a bounded number of observations per cycle; until then the report stays what it was. Then
/// every observation is one update; cycles between observations repeat the belief, with predicted
/// and present probability equal.
#[derive(Debug, Clone, Checkpoint)]
pub struct Identifier {
    #[checkpoint(fixed)]
    leaves: LeafMap,
    engine: Engine,
    observer: Observer,
    /// What is known of a healthy robot as long as the detector publishes nothing of it.
    unsure: Healthy,
    p_unknown: f64,
    #[checkpoint(fixed)]
    prior: FaultPrior,
    use_wheels: bool,
    /// Sensors are silent, or the robot moves though it should stand: nothing can be identified.
    in_trouble: bool,
    /// Most hypotheses or particles of the engine, without a budget.
    particles: usize,
    ranked: HypothesisList,
    /// The hypotheses after the last observation, as they were published.
    published: Box<ParticleBlock>,
    updated: bool,
    publishes_own: bool,
    ring: Ring,
    phase: Phase,
    /// Gyro and currents, where they take part: a filter, and what the ring's observations hold.
    #[checkpoint(each)]
    further: Option<Box<FurtherStage>>,
    detection: Detection,
    /// Enough is known to be reported, since an alarm stands.
    is_heard: bool,
    posterior: TreeBelief,
    predicted: TreeBelief,
    sizes: NodeSizes,
    evidence: ChannelEvidence,
    mode: u32,
    mode_changes: u32,
    reported: ReportedFault,
    /// Motion in the last observation, s, until it has been reported.
    moved_s: f64,
    run_id: u64,
}

impl Identifier {
    /// An identifier over the leaves of `tree`.
    ///
    /// # Errors
    /// [`IdentifierError`] if the model is of another robot or lacks a leaf's fault.
    pub fn new(
        models: &Models<'_>,
        settings: &Settings,
        sensors: Sensors,
        seed: u64,
    ) -> Result<Self, IdentifierError> {
        let Models {
            model, robot, tree, ..
        } = *models;
        model.check_robot(robot)?;
        let leaves = LeafMap::new(tree, model, robot, sensors)?;
        let use_wheels = sensors != Sensors::Pose;
        let (engine, modes) = match settings.filter {
            IdentifierFilter::MultipleHypothesis => {
                let rates = fault_rates(&robot.fault_prior, &leaves, settings.p_unknown);
                let mut filter = MultipleHypothesis::new(model, robot, &leaves, use_wheels, rates);
                filter.set_limit(settings.particles.unwrap_or(usize::MAX));
                let modes = filter.modes().to_vec();
                (Engine::MultipleHypothesis(Box::new(filter)), modes)
            }
            _ if leaves.need_hypotheses() => {
                return Err(IdentifierError::Build(FURTHER_NEED_HYPOTHESES.to_owned()));
            }
            _ => {
                let filter = SingleFaultFilter::new(models, &leaves, settings, use_wheels, seed)?;
                let modes = motion_modes(model, robot, leaves.stuck_wheels(), false, false);
                (Engine::SingleFault(Box::new(filter)), modes)
            }
        };
        let capacity = (settings.ring_s / model.interval_s).ceil().max(2.0) as usize;
        let mut observer = Observer::new(model, robot);
        let further = FurtherStage::new(models, &leaves, sensors, settings, capacity);
        if further.is_some() {
            observer = observer.with_further();
        }
        Ok(Self {
            particles: engine.limit(),
            engine,
            evidence: ChannelEvidence::new(model, robot, modes, use_wheels),
            observer,
            unsure: Healthy::unsure(model, robot),
            p_unknown: settings.p_unknown,
            prior: robot.fault_prior,
            use_wheels,
            in_trouble: false,
            ranked: HypothesisList::new(),
            published: Box::default(),
            updated: false,
            publishes_own: false,
            leaves,
            ring: Ring::new(capacity, model.interval_s),
            phase: Phase::Watching,
            further: further.map(Box::new),
            detection: Detection::default(),
            is_heard: false,
            posterior: TreeBelief::nominal(),
            predicted: TreeBelief::nominal(),
            sizes: NodeSizes::default(),
            mode: 0,
            mode_changes: 0,
            reported: ReportedFault::default(),
            moved_s: 0.0,
            run_id: 0,
        })
    }

    /// Most hypotheses of the default filter, or particles of a sampled one, without a budget.
    #[must_use]
    pub const fn particles(&self) -> u32 {
        self.particles as u32
    }

    /// Hypotheses or particles that an observation costs at present; 0 while nothing is identified.
    #[must_use]
    pub fn particles_in_use(&self) -> u32 {
        match self.phase {
            Phase::Watching => 0,
            Phase::Identifying(_) => self.engine.count() as u32,
        }
    }

    /// Takes an entry of the journal, and fills belief and hypotheses but for headers and causes.
    pub fn step(
        &mut self,
        entry: Entry<Input<'_>>,
        belief: &mut FaultBelief,
        hypotheses: &mut ParticleBlock,
    ) {
        self.predicted = self.posterior;
        self.updated = false;
        let is_frame = matches!(entry, Entry::Frame(_));
        let mut detected = None;
        match entry {
            Entry::Frame(input) => {
                detected = input.detection.map(|(_, block)| block);
                self.take(&input);
            }
            // The state stays at the last frame: what is published is its prediction.
            Entry::Missed(_) => {}
            Entry::Budget(count) => {
                self.engine
                    .set_limit((count as usize).clamp(1, self.particles));
            }
            Entry::Reset => {
                self.observer.reset();
                self.begin_run();
            }
        }
        self.report(belief);
        self.publish(detected, hypotheses);
        invariants::fault_belief(belief, self.leaves.all());
        invariants::onset(belief.onset_t_capture_ns, self.ring.newest_ns());
        if !is_frame {
            invariants::held(&belief.p_predicted, &belief.p);
        }
    }

    fn begin_run(&mut self) {
        self.ring.clear();
        self.published.count = 0;
        self.published.healthy = HealthyBelief::default();
        self.phase = Phase::Watching;
        self.in_trouble = false;
        self.detection.begin_run(self.run_id);
        self.posterior = TreeBelief::nominal();
        self.predicted = self.posterior;
        self.evidence.clear();
        self.reported.begin_run();
        if let Some(further) = &mut self.further {
            further.begin_run();
        }
    }

    fn take(&mut self, input: &Input<'_>) {
        self.observer.suspect(self.detection.alarm.stands());
        let intake = self.observer.push(input.frame);
        self.run_id = input.frame.run_id;
        if intake.new_run {
            self.begin_run();
        }
        if let Some((belief, _)) = input.detection {
            self.detection.take(belief, self.evidence.map());
        }
        if intake.complete {
            self.in_trouble = self.observer.observation().troubles.any(self.use_wheels);
            self.keep(input);
            let observation = self.observer.observation();
            self.moved_s += observation.moved_s();
            self.detection.pass(observation.moved_s());
        }
        if self.in_trouble {
            self.phase = Phase::Watching;
            let troubles = &self.observer.observation().troubles;
            (self.posterior, self.sizes) = believed(troubles, self.use_wheels, &self.leaves);
            self.evidence.clear();
            return;
        }
        if !self.detection.alarm.stands() {
            // The detector decides whether there is a fault: none is named without its alarm.
            self.phase = Phase::Watching;
        }
        match self.phase {
            Phase::Watching if self.detection.alarm.stands() => self.begin(),
            Phase::Watching => {
                self.posterior = TreeBelief::watching(self.detection.alarm.p_fault());
                self.evidence.clear();
            }
            Phase::Identifying(_) => {}
        }
        if let Phase::Identifying(next) = self.phase {
            self.identify(next, intake.complete);
            if !self.is_heard {
                self.posterior = TreeBelief::watching(self.detection.alarm.p_fault());
                self.evidence.clear();
            }
        }
    }

    /// Adds the last observation to the ring; the oldest gives way.
    fn keep(&mut self, input: &Input<'_>) {
        // A new detector may take an old fault for health: its belief counts after the first pose.
        let detection = input.detection.filter(|_| self.ring.has_pose());
        let healthy =
            detection.and_then(|(_, it)| Healthy::from_block(&it.healthy, self.unsure.wheels));
        if let (Some(stage), Some(read)) = (&mut self.further, self.observer.further()) {
            let healthy = healthy.as_ref().unwrap_or(&self.unsure);
            let suspects = self.detection.suspects;
            stage.keep(self.observer.observation(), read, healthy, suspects);
        }
        let gave_way = self.ring.push(RingEntry {
            run_id: self.run_id,
            observation: *self.observer.observation(),
            noise: self.detection.noise,
            healthy,
        });
        if let Phase::Identifying(next) = self.phase
            && gave_way
        {
            // An observation that nobody has taken is taken before it goes; see Ring::catch_up.
            self.phase = Phase::Identifying(next.saturating_sub(1));
        }
    }

    /// What the detector believed, or else that the pose is as it was measured.
    fn healthy(&self, kept: &RingEntry) -> Healthy {
        let pose = Vector3::from(kept.observation.pose);
        kept.healthy.unwrap_or(Healthy {
            pose,
            ..self.unsure
        })
    }

    /// Starts from the oldest kept observation whose pose is known.
    fn begin(&mut self) {
        let start = self.ring.start();
        let Some(kept) = self.ring.get(start) else {
            return;
        };
        let healthy = self.healthy(kept);
        self.engine.restart(&healthy, kept.observation.t_ns);
        if let Some(further) = &mut self.further {
            further.restart(self.detection.has_seen_quiet());
        }
        self.phase = Phase::Identifying(start + 1);
        self.sizes = NodeSizes::default();
        self.is_heard = self.detection.may_tell(false);
        // What was unknown so far is any of the faults, by their priors.
        self.predicted = self.predicted.divided(&self.leaves, self.p_unknown);
    }

    fn identify(&mut self, next: usize, complete: bool) {
        let behind = self.ring.len().saturating_sub(next);
        let was_behind = behind > usize::from(complete);
        let frame_s = self.observer.observation().frame_s;
        let allowed = self.ring.catch_up(frame_s, was_behind);
        let taken = behind.min(allowed);
        let mut moved_s = 0.0;
        for i in next..next + taken {
            let Some(kept) = self.ring.get(i) else { break };
            self.engine.step(&kept.observation, kept.noise);
            if let Some(further) = &mut self.further {
                further.step(i, &kept.observation);
            }
            moved_s += kept.observation.moved_s();
        }
        self.phase = Phase::Identifying(next + taken);
        if taken < behind {
            // The report stays what it was until the ring is worked off.
            self.posterior = self.predicted;
            return;
        }
        if taken == 0 {
            return;
        }
        // Rates of up to one a second and a ring of up to 30 s: more than certain is certain.
        let birth = (self.prior.suspected_1_s * moved_s).min(1.0);
        let death = (self.prior.mended_1_s * moved_s).min(1.0);
        self.predicted = self
            .predicted
            .predicted(&self.leaves, self.p_unknown, birth, death);
        let fusion = self.further.as_ref().map(|further| further.fusion());
        self.engine
            .posterior(&self.leaves, fusion.as_ref(), &mut self.posterior);
        let are_named = are_named(self.posterior.nodes[0], self.posterior.unknown);
        self.is_heard = self.detection.may_tell(are_named);
        self.sizes = self.engine.sizes(&self.leaves, &self.posterior);
        if self.is_heard {
            self.explain(next, next + taken);
        }
        self.updated = true;
    }

    /// Sums the evidence for the diagnosis against its rival over the observations `first..end`,
    /// which have just been taken; anew from the onset when the diagnosis has changed.
    fn explain(&mut self, first: usize, end: usize) {
        let (mode, _) = self.posterior.mode(&self.leaves);
        if mode == self.mode {
            self.follow(first, end);
            return;
        }
        self.evidence.clear();
        let onset_ns = match mode {
            0 => return,
            MODE_UNKNOWN => self.engine.onset_unknown(),
            _ => self.onset_of_leaf(),
        };
        // The last pose from before the onset, not too long ago: the work of a cycle is bounded.
        let end = end.min(self.ring.len());
        let earliest = end.saturating_sub(EVIDENCE_MAX);
        let start = self.ring.last_by(onset_ns, earliest, end);
        let Some(kept) = self.ring.get(start) else {
            return;
        };
        let healthy = self.healthy(kept);
        let (posterior, leaves) = (&self.posterior, &self.leaves);
        let at = &kept.observation;
        let drive = Drive {
            curvature_1_m: at.curvature,
            speed_m_s: at.speed,
            commanded_1_m: at.command[0],
        };
        self.evidence
            .begin(posterior, leaves, &healthy, drive, onset_ns);
        self.follow(start + 1, end);
    }

    fn follow(&mut self, first: usize, end: usize) {
        for i in first..end {
            let Some(kept) = self.ring.get(i) else { break };
            self.evidence.follow(&kept.observation, kept.noise);
        }
    }

    fn is_catching_up(&self) -> bool {
        matches!(self.phase, Phase::Identifying(next) if next < self.ring.len())
    }

    fn report(&mut self, belief: &mut FaultBelief) {
        self.posterior.write(&self.leaves, belief);
        match self.is_watching() && !self.in_trouble {
            true => NodeSizes::default().write(belief),
            false => self.sizes.write(belief),
        }
        belief.p_predicted = self.predicted.nodes;
        belief.p_unknown_predicted = self.predicted.unknown;
        belief.run_id = self.run_id;
        let (identifying, (mode, p_mode)) = match () {
            () if self.in_trouble => (1, self.posterior.mode(&self.leaves)),
            () if self.is_watching() => (0, (0, self.posterior.nodes[0])),
            () if self.is_catching_up() => (CATCHING_UP, (self.mode, belief.p[0])),
            () => (1, self.posterior.mode(&self.leaves)),
        };
        belief.identifying = identifying;
        if mode != self.mode {
            self.mode = mode;
            self.mode_changes = self.mode_changes.saturating_add(1);
        }
        let moved_s = std::mem::take(&mut self.moved_s);
        self.reported
            .take(mode, p_mode, &self.posterior, &self.leaves, moved_s);
        belief.reported = self.reported.name();
        belief.reported_change_count = self.reported.changes();
        belief.mode = mode;
        belief.p_mode = p_mode;
        belief.mode_change_count = self.mode_changes;
        let alarm = &self.detection.alarm;
        belief.alarm_t_capture_ns = if alarm.stands() { alarm.t_ns() } else { 0 };
        belief.onset_t_capture_ns = self.onset();
        belief.runner_up = self.evidence.runner_up();
        belief.channel_evidence = self.evidence.channel_evidence();
        belief.degenerate_count = self.engine.degenerate_count();
        belief.particle_limit = self.engine.limit() as u32;
        let is_identifying = self.phase != Phase::Watching && !self.is_catching_up();
        if let Some(further) = self.further.as_ref().filter(|_| is_identifying) {
            further.sizes(belief);
        }
    }

    /// Nothing is identified, or not enough is known of it.
    fn is_watching(&self) -> bool {
        self.phase == Phase::Watching || !self.is_heard
    }

    fn onset(&self) -> u64 {
        if self.is_watching() || self.is_catching_up() {
            return 0;
        }
        self.onset_of_leaf()
    }

    /// Onset of the most probable leaf; 0 of those of gyro and currents, which know none.
    fn onset_of_leaf(&self) -> u64 {
        let p = &self.posterior.nodes;
        let most = self.leaves.all().max_by(|&a, &b| p[a].total_cmp(&p[b]));
        most.map_or(0, |node| self.engine.onset(node))
    }

    /// Without an identification, in troubles too, the detector's hypotheses are repeated.
    fn publish(&mut self, detected: Option<&ParticleBlock>, out: &mut ParticleBlock) {
        if self.phase == Phase::Watching || self.is_catching_up() {
            if let Some(block) = detected {
                copy(block, &mut self.published);
            } else if self.publishes_own {
                self.published.count = 0;
            }
            self.publishes_own = false;
        } else if self.updated {
            self.engine.hypotheses(&self.leaves, &mut self.ranked);
            self.ranked.drain(&mut self.published);
            self.publishes_own = true;
        }
        copy(&self.published, out);
    }
}

#[cfg(test)]
mod tests;

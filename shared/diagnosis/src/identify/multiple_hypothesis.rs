//! Bayes over sets of faults and the unknown: a multiple-hypothesis filter, without sampling.
//!
//! Encoders are weighed exactly, given the motion. Not every hypothesis about the motion is held:
//! new ones start from the most probable one of each number of stuck wheels, several wheels at once
//! only where they read so, and the least probable are dropped.
//!
//! The motion tells stuck wheels apart: one track per (motion mode, onset), a motion mode being
//! nominal, any set of stuck wheels, or unknown. Broken encoders do not move the robot: given the
//! motion, a small hidden Markov model per wheel says what its encoder does, any number of them at
//! once. A stuck wheel's encoder reads zero with the sensor's noise. The unknown is nominal motion
//! with a large constant deviation, and wheels that may do anything.

mod changes;

use vigil_blocks::WHEELS;
use vigil_checkpoint::Checkpoint;
use vigil_inference::bank::{Bank, Hypothesis};
use vigil_inference::outlier::{Trust, unvouched};
use vigil_inference::track::Context;
use vigil_robot::Description;
use vigil_robot::learned::{
    FaultRates, Healthy, Model, MotionMode, Mover, NoiseScales, Observation, WheelContext,
    WheelEvidence, motion_modes, steer_modes,
};

use crate::identify::angles::Angles;
use crate::identify::encoders::{BIRTH_MAX, Encoders};
use crate::identify::further::Fusion;
use crate::identify::hypothesis_state::HypothesisState;
use crate::identify::leaf_map::LeafMap;
use crate::identify::rate_offsets::RateOffsets;
use crate::identify::servo_fault::ServoPrior;
use crate::identify::set_probabilities::SetProbabilities;
use crate::identify::sizes::{SizeInput, Sizes};
use crate::identify::tree_belief::TreeBelief;
use crate::identify::wheel_update::{WheelTerms, WheelUpdate, is_new};
use crate::invariants;

/// Index of the nominal motion among the modes.
const NOMINAL: usize = 0;
/// Onset hypotheses kept per mode, one an observation. Chosen by hand: the last 1.6 s of 50 ms;
/// fewer lose the onset of a fault that shows late, more cost time.
const PER_MODE: usize = 32;
/// The same of several stuck wheels and of other ground, as there are many such modes: 0.4 s.
const PER_RARE: usize = 8;
/// Hypotheses less probable than this are dropped (natural logarithm): 1e-13, as
/// `set_probabilities::NEGLIGIBLE`.
const FLOOR: f64 = -30.0;

/// The filter.
#[derive(Debug, Clone, Checkpoint)]
pub struct MultipleHypothesis {
    #[checkpoint(fixed)]
    model: Model,
    #[checkpoint(fixed)]
    robot: Description,
    #[checkpoint(fixed)]
    leaves: LeafMap,
    use_wheels: bool,
    #[checkpoint(fixed)]
    modes: Vec<MotionMode>,
    #[checkpoint(fixed)]
    rates: FaultRates,
    /// Of each wheel's encoder.
    births_1_s: [f64; WHEELS],
    bank: Bank<HypothesisState>,
    /// Of the healthy robot, from before the faults; it fades as the robot drives on.
    context: Context,
    wheels: WheelContext,
    sizes: Sizes,
    #[checkpoint(fixed)]
    servo: ServoPrior,
    trust: Trust,
    /// Of each mode that a hypothesis is in: the log-likelihoods of the last observation's wheels.
    terms: Vec<Option<WheelTerms>>,
    sets: SetProbabilities,
    degenerate_count: u32,
}

impl MultipleHypothesis {
    /// A filter over the leaves of a tree, whose faults come and go with these rates.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        leaves: &LeafMap,
        use_wheels: bool,
        rates: FaultRates,
    ) -> Self {
        // A pose alone cannot tell two stuck wheels from one on another soil.
        let mut modes = motion_modes(model, robot, leaves.stuck_wheels(), true, use_wheels);
        modes.extend(steer_modes(model, leaves.steered_wheels()));
        for mode in modes.iter_mut().filter(|mode| mode.jump != [0.0; 3]) {
            if leaves.pose.is_some() {
                (mode.moved, mode.share, mode.p_unknown) = (Mover::Pose, 1.0, 0.0);
            }
        }
        let mut unknown = modes.iter_mut().filter(|mode| mode.moved == Mover::Unknown);
        if let (Some(alone), None) = (unknown.next(), unknown.next()) {
            alone.share = 1.0;
        }
        let on_any_ground = |mode: MotionMode| {
            // That of several wheels holds every soil already.
            let is_several = mode.moved.stuck().count_ones() > 1;
            let noise = match mode.is_nominal_motion() {
                true => model.nominal_noise(robot),
                false if is_several => mode.noise,
                false => robot.with_ground_drift(mode.noise),
            };
            MotionMode { noise, ..mode }
        };
        let modes: Vec<MotionMode> = modes.into_iter().map(on_any_ground).collect();
        let is_leaf = leaves.encoder.map(|leaf| leaf.is_some());
        let capacities: Vec<usize> = modes
            .iter()
            .map(|mode| {
                let is_rare = mode.moved.stuck().count_ones() > 1 || mode.ground.mean != 1.0;
                if is_rare { PER_RARE } else { PER_MODE }
            })
            .collect();
        Self {
            model: model.clone(),
            robot: robot.clone(),
            leaves: leaves.clone(),
            use_wheels,
            terms: vec![None; modes.len()],
            sets: SetProbabilities::new(&modes, leaves, robot.wheels.len().min(WHEELS)),
            modes,
            rates,
            births_1_s: is_leaf.map(|leaf| if leaf { rates.fault_1_s } else { 0.0 }),
            bank: Bank::new(&capacities),
            context: Context::default(),
            wheels: WheelContext::default(),
            sizes: Sizes::new(robot),
            servo: ServoPrior::new(robot),
            trust: Trust::default(),
            degenerate_count: 0,
        }
    }

    /// Most hypotheses kept.
    #[must_use]
    pub fn limit(&self) -> usize {
        self.bank.limit()
    }

    /// From the next observation on at most `count` hypotheses, the most probable: fewer cost less.
    pub fn set_limit(&mut self, count: usize) {
        self.bank.set_limit(count);
    }

    /// Starts from the nominal mode, as the detector knew it at `t_ns`.
    pub fn restart(&mut self, healthy: &Healthy, t_ns: u64) {
        (self.context, self.wheels) = (healthy.context, healthy.wheels);
        self.sizes.clear();
        self.trust = Trust::default();
        let state = HypothesisState {
            track: healthy.track(&self.modes[NOMINAL].noise),
            encoders: Encoders::healthy(t_ns),
            offsets: RateOffsets::default(),
            angles: Angles::default(),
            servo: None,
            jump_m: None,
            log_material: 0.0,
            was_thrown: false,
            fresh: 0,
        };
        self.bank.restart(NOMINAL, t_ns, state);
        invariants::start(healthy.pose.into(), state.track.pose().into());
    }

    /// Observations that were impossible under every hypothesis, and were passed over.
    #[must_use]
    pub const fn degenerate_count(&self) -> u32 {
        self.degenerate_count
    }

    /// The ways in which the robot may move.
    #[must_use]
    pub fn modes(&self) -> &[MotionMode] {
        &self.modes
    }

    /// Sizes of encoders' faults.
    #[must_use]
    pub const fn sizes(&self) -> &Sizes {
        &self.sizes
    }

    /// The hypotheses, and how the robot moves under each.
    pub fn hypotheses(
        &self,
    ) -> impl ExactSizeIterator<Item = (&MotionMode, &Hypothesis<HypothesisState>)> {
        let all = self.bank.hypotheses().iter();
        all.map(|hypothesis| (&self.modes[hypothesis.mode], hypothesis))
    }

    /// Takes one observation.
    pub fn step(&mut self, observation: &Observation, noise: NoiseScales) {
        let variance = observation.pose_variance(&self.model, noise.pose);
        if observation.anchor {
            if observation.pose_frames > 0 {
                for hypothesis in self.bank.hypotheses_mut() {
                    let track = &mut hypothesis.state.track;
                    track.anchor(observation.pose, unvouched(variance));
                }
            }
            return;
        }
        self.context
            .fade(observation.travel_m, &self.modes[NOMINAL].noise);
        self.wheels.fade(observation.travel_m);
        let (model, robot) = (&self.model, &self.robot);
        let evidence = (self.use_wheels && observation.moving)
            .then(|| WheelEvidence::new(model, robot, observation, noise, &self.wheels));
        if observation.moving {
            self.spawn(observation, evidence.as_ref());
        }
        self.predict(observation);
        // A robot at rest tells nothing: no fault appears, fades or is named.
        if !observation.moving {
            self.sizes.rest(observation);
            return;
        }
        if let Some(evidence) = &evidence {
            self.weigh_wheels(observation, evidence);
        }
        let mut failed = false;
        if observation.pose_frames > 0 {
            failed = self.weigh_pose(observation, variance, noise);
            self.cut_off();
        }
        let evidence = self.bank.normalise(FLOOR);
        if evidence.is_none() || failed {
            self.degenerate_count = self.degenerate_count.saturating_add(1);
        }
        if evidence.is_some() {
            let all = self.bank.hypotheses();
            invariants::within_capacity(all.len(), self.bank.limit());
            invariants::hypothesis_weights(all.iter().map(|hypothesis| hypothesis.log_weight));
        }
    }

    /// Weighs by a measured pose; true if a hypothesis could not take it.
    fn weigh_pose(
        &mut self,
        observation: &Observation,
        variance: [f64; 3],
        noise: NoiseScales,
    ) -> bool {
        let modes = &self.modes;
        // A jump that begins with this pose, its first, explains whatever it reads, as an outlier
        // does: the next pose tells which it was.
        let begins = |hypothesis: &Hypothesis<HypothesisState>| {
            let jumps = modes[hypothesis.mode].jump != [0.0; 3];
            jumps && hypothesis.state.jump_m.is_none()
        };
        let all = self.bank.hypotheses().iter().filter(|h| !begins(h));
        let tracks = all.map(|h| (&h.state.track, h.log_weight));
        let rates = noise.outliers.pose;
        let trusted = self
            .trust
            .variance(tracks, observation.pose, variance, rates);
        let mut failed = false;
        for hypothesis in self.bank.hypotheses_mut() {
            let begins = begins(hypothesis);
            let is_thrown = modes[hypothesis.mode].is_thrown;
            let state = &mut hypothesis.state;
            let before = state.track;
            let mut gained = state.take_pose(observation.pose, trusted, is_thrown);
            if begins && gained.is_some() {
                // Where it has jumped to it is as good as any.
                state.track = before;
                let taken = state.track.update(observation.pose, variance);
                gained = gained.filter(|_| taken.is_some());
                let jump_m = (state.track.pose() - before.pose()).xy().norm();
                state.jump_m = Some((jump_m, (variance[0] + variance[1]).sqrt()));
            }
            // Those that cannot take it are dropped, unless none can: then nothing changes.
            failed |= gained.is_none();
            hypothesis.log_weight += gained.unwrap_or(2.0 * FLOOR);
        }
        failed
    }

    /// Holds healthy motion within the tolerance, and unknown motion beyond it.
    fn cut_off(&mut self) {
        let bound = self.modes[NOMINAL].noise.bound;
        if !self.modes[NOMINAL].noise.is_bounded() {
            return;
        }
        for hypothesis in self.bank.hypotheses_mut() {
            let mode = &self.modes[hypothesis.mode];
            // Wheels that do anything are unknown however the robot moves.
            let is_material = match mode.moved {
                Mover::Unknown => !mode.is_nominal_motion(),
                Mover::UnknownAny => !self.use_wheels,
                _ => false,
            };
            let state = &mut hypothesis.state;
            if mode.noise.is_bounded() {
                state.track.saturate(&bound);
            } else if is_material {
                let log_material = state.track.log_material(&bound);
                hypothesis.log_weight += log_material - state.log_material;
                state.log_material = log_material;
            }
        }
    }

    fn predict(&mut self, observation: &Observation) {
        for hypothesis in self.bank.hypotheses_mut() {
            let mode = &self.modes[hypothesis.mode];
            let step = observation.displacement(&self.model, &mode.motion);
            hypothesis.state.track.predict(&step, &mode.noise);
        }
    }

    /// Weighs by the wheels' readings.
    fn weigh_wheels(&mut self, observation: &Observation, evidence: &WheelEvidence) {
        let death = self.rates.death_1_s * observation.dt_s;
        let update = WheelUpdate {
            model: &self.model,
            robot: &self.robot,
            observation,
            evidence,
        };
        let (rates, births_1_s) = (self.rates, self.births_1_s);
        let births = |moved: Mover, encoders: &Encoders| {
            let p_other = encoders.p_other_broken();
            let factor = |wheel: usize| rates.factor(moved, p_other[wheel]);
            let born = |wheel: usize| births_1_s[wheel] * observation.dt_s * factor(wheel);
            std::array::from_fn(|wheel| born(wheel).min(BIRTH_MAX))
        };
        let modes = &self.modes;
        let named = self.bank.best(|mode| !modes[mode].moved.is_unknown());
        let (mode, encoders) = match named {
            Some(best) => (best.mode, best.state.encoders),
            None => (NOMINAL, Encoders::healthy(observation.t_ns)),
        };
        let input = SizeInput {
            model: &self.model,
            observation,
            evidence,
            mode: &modes[mode],
            encoders: &encoders,
            births: &births(modes[mode].moved, &encoders),
        };
        let sized = self.sizes.take(&input, self.robot.wheels.len().min(WHEELS));
        self.terms.fill(None);
        for hypothesis in self.bank.hypotheses_mut() {
            let index = hypothesis.mode;
            let compute = || update.terms(&self.modes[index], &sized);
            let terms = self.terms[index].get_or_insert_with(compute);
            let births = births(modes[index].moved, &hypothesis.state.encoders);
            let HypothesisState {
                encoders,
                offsets,
                angles,
                servo,
                fresh,
                ..
            } = &mut hypothesis.state;
            if !is_new(observation.t_ns, hypothesis.onset) {
                *fresh = 0;
            }
            let gained = update.weigh(terms, &births, death, *fresh, encoders, offsets);
            hypothesis.log_weight += gained;
            if self.modes[index].moved == Mover::UnknownAny {
                let changes = rates.fault_1_s * observation.dt_s;
                hypothesis.log_weight += angles.step(&evidence.steer, changes);
            }
            if let (Mover::Steer(wheel), Some(servo)) = (self.modes[index].moved, servo)
                && let Some(reading) = &evidence.steer[wheel]
            {
                hypothesis.log_weight += servo.step(&self.servo, reading);
            }
        }
        self.learn_context(observation, evidence);
    }

    /// Learns the wheels' context from those that turn in the most probable hypothesis: what a
    /// fault does to them is none.
    fn learn_context(&mut self, observation: &Observation, evidence: &WheelEvidence) {
        let Some(best) = self.bank.best(|_| true) else {
            return;
        };
        for wheel in 0..WHEELS {
            invariants::sums_to_one(best.state.encoders.states(wheel).iter().copied());
        }
        let moved = self.modes[best.mode].moved;
        let is_settled = !is_new(observation.t_ns, best.onset);
        let is_off = matches!(moved, Mover::UnknownAny | Mover::Steer(_));
        if is_off || moved.stuck().count_ones() > 1 || !is_settled {
            return;
        }
        let mut beside = [None; WHEELS];
        for (wheel, beside) in beside.iter_mut().enumerate().take(self.robot.wheels.len()) {
            let is_whole = best.state.encoders.p_broken(wheel) < 0.5 && !moved.is_stuck(wheel);
            if is_whole {
                let mode = &self.modes[best.mode];
                *beside = evidence.beside(&self.model, observation, mode, wheel);
            }
        }
        self.wheels.learn(&beside);
    }

    /// Fills the probabilities of nodes, sets and unknown, by what further channels say too where
    /// there are any.
    pub fn posterior(&mut self, fusion: Option<&Fusion>, out: &mut TreeBelief) {
        self.sets.clear();
        for hypothesis in self.bank.hypotheses() {
            let (p, encoders) = (hypothesis.log_weight.exp(), &hypothesis.state.encoders);
            self.sets
                .add(hypothesis.mode, p, |wheel| encoders.p_broken(wheel));
        }
        self.sets.posterior(&self.leaves, fusion, out);
    }

    /// The most probable hypothesis under which the robot is moved so.
    #[must_use]
    pub fn best(&self, moved: Mover) -> Option<&Hypothesis<HypothesisState>> {
        self.bank.best(|mode| self.modes[mode].moved == moved)
    }

    /// Most probable onset of the unknown, capture time ns; 0 if it was never supposed.
    #[must_use]
    pub fn onset_unknown(&self) -> u64 {
        let best = self.bank.best(|mode| self.modes[mode].moved.is_unknown());
        best.map_or(0, |best| best.onset)
    }

    /// Most probable onset of a leaf's fault, capture time ns; 0 if it is no leaf.
    #[must_use]
    pub fn onset(&self, node: usize) -> u64 {
        let wheel = |leaves: &[Option<usize>]| leaves.iter().position(|&leaf| leaf == Some(node));
        if let Some(wheel) = wheel(&self.leaves.stuck) {
            let best = self
                .bank
                .best(|mode| self.modes[mode].moved.is_stuck(wheel));
            return best.map_or(0, |best| best.onset);
        }
        if let Some(wheel) = wheel(&self.leaves.steer) {
            let best = self.best(Mover::Steer(wheel));
            return best.map_or(0, |best| best.onset);
        }
        if self.leaves.pose == Some(node) {
            return self.best(Mover::Pose).map_or(0, |best| best.onset);
        }
        if let Some(wheel) = wheel(&self.leaves.encoder) {
            let known = self.bank.hypotheses().iter();
            let known = known.filter(|h| !self.modes[h.mode].moved.is_unknown());
            let p = |h: &Hypothesis<HypothesisState>| {
                h.log_weight + h.state.encoders.p_broken(wheel).ln()
            };
            let best = known.max_by(|a, b| p(a).total_cmp(&p(b)));
            return best.map_or(0, |best| best.state.encoders.onset(wheel));
        }
        0
    }
}

#[cfg(test)]
mod tests;

//! What gyro and currents say of faults: a hidden Markov model over single ones.
//!
//! Its states are a whole robot, a motor that has lost a share of its torque, a current sensor that
//! is dead, scaled, noisy or off, a gyro that is too, a stuck wheel, and what nobody knows. A size
//! is a grid. Given the fault these channels depend neither on the pose nor on the encoders, which
//! the other filter weighs ([`super::multiple_hypothesis`]): probabilities of both are multiplied,
//! over the prior that both contain. So hypotheses that say the same of a channel have one
//! likelihood of it, and a broken encoder, a stuck wheel and a weak motor are told apart by what
//! each makes of the currents.

use vigil_blocks::{FaultBelief, SizeKind, WHEELS};
use vigil_checkpoint::Checkpoint;
use vigil_inference::logspace::log_add;
use vigil_robot::learned::current_effects::{CurrentEffects, SHARES, STUCK};
use vigil_robot::learned::further_watch::{FurtherWatch, Residual, Residuals, Turn};
use vigil_robot::learned::wheel_evidence::DRAG_SD;
use vigil_robot::learned::{Further, Healthy, Model, Observation};
use vigil_robot::{Description, FaultPrior, Suspects};

use crate::identify::further_likelihood::{
    Currents, dead, noisy, noisy_current, shifted, together, without_common,
};
use crate::identify::further_state::FurtherState;
use crate::identify::leaf_map::LeafMap;
use crate::identify::tree_belief::SIZE_P_MIN;
use crate::invariants;

/// Offsets of a broken current sensor, in deviations of its noise. Each is twice the one before,
/// as a size is told to a factor; the largest is 2.5 times, to reach further with one state.
/// Chosen: the least, 0.05 A of the rover, lies within what a slope does to one wheel. An offset
/// beyond the largest, 2 A, still fits that better than none.
const OFFSETS: [f64; 12] = [
    -40.0, -16.0, -8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0, 16.0, 40.0,
];
/// Factors of a broken current sensor or gyro: reversed, none, half, double. What lies between is
/// told to a factor of two.
const GAINS: [f64; 4] = [-1.0, 0.0, 0.5, 2.0];
/// Factors of its noise, beyond what is followed: that of a healthy sensor, up to five times. Each
/// stands for two octaves around it.
const NOISES: [f64; 2] = [8.0, 32.0];
/// Biases of a broken gyro, in deviations of its noise, in steps as of [`OFFSETS`]. Chosen: the
/// least is two tolerances of the rover; the largest, 0.4 rad/s, is beyond its tightest
/// turn at 0.3 m/s.
const BIASES: [f64; 10] = [-40.0, -16.0, -8.0, -4.0, -2.0, 2.0, 4.0, 8.0, 16.0, 40.0];
/// Least deviation of a stuck wheel's effect on a current, in deviations of the sensor's noise: as
/// far as a healthy reading goes. An effect that is known to be small is no better known.
const STUCK_SD_MIN: f64 = 4.0;
/// Deviation of a current in the unknown, in those of its sensor's noise: beyond what slopes add.
/// Chosen: at 0.05 A of the rover's noise, a quarter of the largest offset.
const UNKNOWN_CURRENT: f64 = 10.0;
/// That of the yaw rate, as a share of the fastest turn that may be commanded: two deviations are
/// any turn that the robot can make.
const UNKNOWN_TURN: f64 = 0.5;
/// Share of channels that have one: two of seven, as what is unknown moves some and not all.
const ANYTHING: f64 = 0.3;
/// One observation speaks against a state, beside the one that it speaks for most, by this much at
/// most (natural logarithm). Less than the e^32 of [`FLOOR`]: no single one lifts a state from
/// nothing.
const LOG_MAX: f64 = 30.0;
/// These channels change odds by this factor at most: what nominal motion makes impossible they do
/// not make likely. Times `set_probabilities::FLOOR` it is 1e-3.
const RATIO_MAX: f64 = 1e9;
/// No state is less probable: what can return must not be impossible.
const FLOOR: f64 = 1e-14;

/// How the probabilities of sets of faults change by these channels, and what they add.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fusion {
    /// Factor of sets in which this wheel is stuck.
    pub stuck: [f64; WHEELS],
    /// Factor of sets in which a servo is off: its wheel may load any motor by any amount, as
    /// likely as any fault of a motor or its sensor does, or by nothing that shows.
    pub askew: f64,
    /// Factor of the unknown, and its probability over that of none where the motion is nominal.
    pub unknown: (f64, f64),
    /// Nodes that only these channels tell, and their probability over that of none.
    pub nodes: [(usize, f64); 2 * WHEELS + 1],
    /// How many.
    pub count: usize,
}

/// Deviations of what is known badly.
#[derive(Debug, Clone, Copy)]
struct Wide {
    /// Currents beside a stuck wheel, A.
    stuck_a: f64,
    /// Currents in the unknown, A.
    current_a: f64,
    /// Yaw rate in the unknown, rad/s.
    turn_rad_s: f64,
}

impl Wide {
    fn new(robot: &Description) -> Self {
        let (noise, limits) = (&robot.noise, &robot.limits);
        Self {
            stuck_a: STUCK_SD_MIN * noise.current_a,
            current_a: UNKNOWN_CURRENT * noise.current_a,
            turn_rad_s: UNKNOWN_TURN * limits.curvature_1_m * limits.speed_m_s,
        }
    }
}

/// The filter.
#[derive(Debug, Clone, Checkpoint)]
pub struct FurtherFilter {
    watch: FurtherWatch,
    #[checkpoint(fixed)]
    rates: FaultPrior,
    #[checkpoint(fixed)]
    wide: Wide,
    #[checkpoint(fixed)]
    effects: Option<CurrentEffects>,
    states: Vec<FurtherState>,
    /// Share of the births that each state has.
    shares: Vec<f64>,
    /// Leaf of each state, if it is one of these channels'.
    nodes: Vec<Option<usize>>,
    p: Vec<f64>,
    /// The same without any evidence.
    prior: Vec<f64>,
    logs: Vec<f64>,
}

impl FurtherFilter {
    /// A filter over the leaves of a tree; None if the model knows none of these channels.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        leaves: &LeafMap,
        p_unknown: f64,
    ) -> Option<Self> {
        let watch = FurtherWatch::new(model, robot)?;
        let mut groups: Vec<(Vec<FurtherState>, Option<usize>)> = Vec::new();
        for wheel in 0..watch.wheels() {
            if let Some(node) = leaves.torque[wheel] {
                let all = (0..SHARES.len()).map(|share| FurtherState::Torque(wheel, share));
                groups.push((all.collect(), Some(node)));
            }
            if let Some(node) = leaves.current[wheel] {
                let offset =
                    |by: f64| FurtherState::CurrentOffset(wheel, by * robot.noise.current_a);
                let offsets = OFFSETS.map(offset);
                let gains = GAINS.map(|gain| FurtherState::CurrentGain(wheel, gain));
                let dead = std::iter::once(FurtherState::CurrentDead(wheel));
                let noises = NOISES.map(|factor| FurtherState::CurrentNoise(wheel, factor));
                let ways = dead.chain(offsets).chain(gains).chain(noises);
                groups.push((ways.collect(), Some(node)));
            }
            if leaves.stuck[wheel].is_some() {
                groups.push((vec![FurtherState::Stuck(wheel)], None));
            }
        }
        if let Some(node) = leaves.gyro {
            let all = std::iter::once(FurtherState::GyroDead);
            let bias = |by: f64| FurtherState::GyroBias(by * robot.noise.yaw_rate_rad_s);
            let biases = BIASES.map(bias);
            let (gains, noises) = (
                GAINS.map(FurtherState::GyroGain),
                NOISES.map(FurtherState::GyroNoise),
            );
            let ways = all.chain(biases).chain(gains).chain(noises);
            groups.push((ways.collect(), Some(node)));
        }
        let mut filter = Self {
            watch,
            rates: robot.fault_prior,
            wide: Wide::new(robot),
            effects: CurrentEffects::new(model, robot),
            states: vec![FurtherState::Whole, FurtherState::Unknown],
            shares: vec![0.0, p_unknown],
            nodes: vec![None, None],
            p: Vec::new(),
            prior: Vec::new(),
            logs: Vec::new(),
        };
        let of_leaf = (1.0 - p_unknown) / leaves.count.max(1) as f64;
        for (states, node) in groups {
            let share = of_leaf / states.len().max(1) as f64;
            for state in states {
                filter.states.push(state);
                filter.shares.push(share);
                filter.nodes.push(node);
            }
        }
        let count = filter.states.len();
        (filter.p, filter.prior) = (vec![0.0; count], vec![0.0; count]);
        filter.logs = vec![0.0; count];
        filter.restart();
        Some(filter)
    }

    /// A new run begins: everything is forgotten.
    pub fn begin_run(&mut self, robot: &Description) {
        self.watch.reset(robot);
        self.restart();
    }

    /// Starts from a whole robot; the context stays.
    pub fn restart(&mut self) {
        for p in [&mut self.p, &mut self.prior] {
            p.fill(0.0);
            p[0] = 1.0;
        }
    }

    /// What an observation holds beside what is expected of a healthy robot; what `suspects` read
    /// teaches nothing. None at rest.
    pub fn look(
        &mut self,
        model: &Model,
        robot: &Description,
        seen: (&Observation, &Further),
        healthy: &Healthy,
        suspects: Suspects,
    ) -> Option<Residuals> {
        let turn = Turn::expected(model, seen.0, |step| {
            (step.per_metre[0] + healthy.context.mean[0]) * step.travel_m
        });
        self.watch.take(model, robot, seen, turn, suspects)
    }

    /// Takes an observation: the faults come and go, and its readings weigh them.
    pub fn step(&mut self, observation: &Observation, further: &Further, residuals: &Residuals) {
        let (birth, death) = (
            self.rates.suspected_1_s * observation.dt_s,
            self.rates.mended_1_s * observation.dt_s,
        );
        for p in [&mut self.p, &mut self.prior] {
            let (whole, mut changed) = (p[0], 0.0);
            let faults = p.iter_mut().zip(&self.shares).zip(&self.states).skip(1);
            // What nothing shows does not change.
            for ((p, share), _) in faults.filter(|(_, state)| state.is_read(further)) {
                let gained = whole * birth * share - *p * death;
                *p += gained;
                changed += gained;
            }
            p[0] -= changed;
        }
        let mut largest = f64::NEG_INFINITY;
        let beside = without_common(&residuals.currents);
        for at in 0..self.states.len() {
            let log = self.log_ratio(self.states[at], observation, further, residuals, &beside);
            self.logs[at] = if log.is_finite() { log } else { 0.0 };
            largest = largest.max(self.logs[at]);
        }
        let mut total = 0.0;
        for (p, log) in self.p.iter_mut().zip(&self.logs) {
            *p = (*p * (log - largest).max(-LOG_MAX).exp()).max(FLOOR);
            total += *p;
        }
        for p in &mut self.p {
            *p /= total;
        }
        invariants::sums_to_one(self.p.iter().copied());
    }

    /// Log-likelihood of the readings in a state, over that of a whole robot; `beside` are the
    /// currents without what they have in common.
    fn log_ratio(
        &self,
        state: FurtherState,
        observation: &Observation,
        further: &Further,
        residuals: &Residuals,
        beside: &Currents,
    ) -> f64 {
        let currents = &residuals.currents;
        let alone = |wheel: usize, by: f64| {
            let mut all = [0.0; WHEELS];
            all[wheel] = by;
            together(beside, &all, |_| 0.0)
        };
        let gyro = |log_ratio: &dyn Fn(&Residual) -> f64| {
            residuals.yaw_rate.as_ref().map_or(0.0, log_ratio)
        };
        let expected = |wheel: usize| currents[wheel].map_or(0.0, |residual| residual.expected);
        match state {
            FurtherState::Whole => 0.0,
            FurtherState::Torque(wheel, share) => {
                let by = self.effect(share, wheel, observation, expected(wheel));
                together(beside, &by, |_| 0.0)
            }
            FurtherState::Stuck(wheel) => {
                let by = self.effect(STUCK, wheel, observation, expected(wheel));
                // How a robot turns on a stuck wheel the pose says.
                let turns = gyro(&|residual| {
                    let wide = residual.variance + self.wide.turn_rad_s * self.wide.turn_rad_s;
                    log_add(0.0, shifted(residual, 0.0, wide)) - std::f64::consts::LN_2
                });
                let sd = |by: f64| (DRAG_SD * by).abs().max(self.wide.stuck_a);
                turns + together(beside, &by, sd)
            }
            FurtherState::CurrentOffset(wheel, offset) => alone(wheel, offset),
            FurtherState::CurrentGain(wheel, gain) => alone(wheel, (gain - 1.0) * expected(wheel)),
            FurtherState::CurrentDead(wheel) => {
                let learned = self.watch.model().currents.as_ref();
                let healthy = learned.map_or(0.5, |learned| learned.repeat_rate);
                dead(&further.currents[wheel], currents[wheel], healthy)
            }
            FurtherState::GyroDead => {
                let learned = self.watch.model().yaw_rate;
                let healthy = learned.map_or(0.5, |learned| learned.repeat_rate);
                dead(&further.yaw_rate, residuals.yaw_rate, healthy)
            }
            FurtherState::CurrentNoise(wheel, factor) => noisy_current(beside, wheel, factor),
            FurtherState::GyroBias(bias) => {
                gyro(&|residual| shifted(residual, bias, residual.variance))
            }
            FurtherState::GyroGain(gain) => gyro(&|residual| {
                shifted(
                    residual,
                    (gain - 1.0) * residual.expected,
                    residual.variance,
                )
            }),
            FurtherState::GyroNoise(factor) => gyro(&|residual| noisy(residual, factor)),
            FurtherState::Unknown => self.log_ratio_unknown(residuals, beside),
        }
    }

    /// The same in the unknown: each channel may read anything.
    fn log_ratio_unknown(&self, residuals: &Residuals, beside: &Currents) -> f64 {
        let gyro = residuals
            .yaw_rate
            .map(|residual| (residual, self.wide.turn_rad_s));
        let currents = beside.iter().flatten();
        let currents = currents.map(|residual| (*residual, self.wide.current_a));
        let anything = |(residual, sd): (Residual, f64)| {
            let wide = shifted(&residual, 0.0, residual.variance + sd * sd);
            log_add((1.0 - ANYTHING).ln(), ANYTHING.ln() + wide)
        };
        currents.chain(gyro).map(anything).sum()
    }

    /// What a fault of a wheel makes of all currents, A, where it would carry `expected_a`.
    fn effect(
        &self,
        kind: usize,
        wheel: usize,
        observation: &Observation,
        expected_a: f64,
    ) -> [f64; WHEELS] {
        let [curvature, speed] = observation.command;
        let effects = self.effects.as_ref();
        let relative = effects.map(|effects| effects.at(kind, wheel, curvature, speed));
        relative.map_or([0.0; WHEELS], |effect| effect.map(|it| it * expected_a))
    }

    /// Writes of each leaf of these channels in which way it is most probably broken, and how
    /// large the fault is then.
    pub fn sizes(&self, belief: &mut FaultBelief) {
        let is_probable = belief.p.map(|p| p >= SIZE_P_MIN);
        let mut begin = 0;
        for group in self.nodes.chunk_by(|a, b| a == b) {
            let states = begin..begin + group.len();
            begin = states.end;
            let Some(node) = group[0].filter(|&node| is_probable[node]) else {
                continue;
            };
            let most = |kind: SizeKind| {
                let its = states
                    .clone()
                    .filter(|&at| self.states[at].size().0 == kind);
                its.fold([0.0; 3], |[p, first, second], at| {
                    let (more, size) = (self.p[at], self.states[at].size().1);
                    [p + more, first + more * size, second + more * size * size]
                })
            };
            let kinds = states.clone().map(|at| self.states[at].size().0);
            let Some(kind) = kinds.max_by(|a, b| most(*a)[0].total_cmp(&most(*b)[0])) else {
                continue;
            };
            let [p, first, second] = most(kind);
            let mean = first / p;
            if !mean.is_finite() {
                continue;
            }
            // Sizes are tried on a grid: within a cell any is as good.
            let cell = cell(kind, mean);
            let variance = (second / p - mean * mean).max(0.0) + cell * cell / 12.0;
            belief.size_kind[node] = kind as u32;
            belief.size[node] = mean;
            belief.size_sd[node] = variance.sqrt();
        }
    }

    /// How probabilities of sets of faults change by these channels.
    #[must_use]
    pub fn fusion(&self) -> Fusion {
        let bounded = |ratio: f64| ratio.clamp(1.0 / RATIO_MAX, RATIO_MAX);
        let mut fusion = Fusion::neutral();
        // Prior, and the same times what these channels say.
        let mut loads = [0.0; 2];
        for (at, state) in self.states.iter().enumerate().skip(1) {
            let odds = (self.p[at] / self.p[0]).min(RATIO_MAX);
            let prior = self.prior[at] / self.prior[0];
            let ratio = match prior > 0.0 {
                true => bounded(odds / prior),
                false => 1.0,
            };
            let is_load = matches!(
                state,
                FurtherState::Torque(..) | FurtherState::CurrentOffset(..)
            );
            if is_load {
                loads = [loads[0] + prior, loads[1] + prior * ratio];
            }
            match (state, self.nodes[at]) {
                (FurtherState::Stuck(wheel), _) => fusion.stuck[*wheel] = ratio,
                (FurtherState::Unknown, _) => fusion.unknown = (0.5 + 0.5 * ratio, odds),
                (_, Some(node)) => fusion.add(node, odds),
                _ => {}
            }
        }
        if loads[0] > 0.0 {
            fusion.askew = 0.5 + 0.5 * loads[1] / loads[0];
        }
        fusion
    }
}

/// Distance between the sizes that are tried about this one.
fn cell(kind: SizeKind, size: f64) -> f64 {
    match kind {
        // Mean spacing of the shares.
        SizeKind::TorqueShareLost => 0.17,
        // The smallest spacing of [`GAINS`].
        SizeKind::Gain => 0.5,
        // Each is about twice the one before: sqrt 2 - 1 / sqrt 2.
        SizeKind::CurrentOffsetA | SizeKind::RateBiasRadS => 0.7 * size.abs(),
        _ => 0.0,
    }
}

impl Fusion {
    /// Changes nothing.
    pub(crate) const fn neutral() -> Self {
        Self {
            stuck: [1.0; WHEELS],
            askew: 1.0,
            unknown: (1.0, 0.0),
            nodes: [(0, 0.0); 2 * WHEELS + 1],
            count: 0,
        }
    }

    fn add(&mut self, node: usize, p: f64) {
        let known = self.nodes[..self.count].iter().position(|it| it.0 == node);
        let at = known.unwrap_or(self.count);
        let Some(place) = self.nodes.get_mut(at) else {
            return;
        };
        *place = (node, if known.is_some() { place.1 } else { 0.0 } + p);
        self.count = self.count.max(at + 1);
    }
}

#[cfg(test)]
mod tests;

//! The identifier's soft evidence for two states of the decision model: the one of hardware faults,
//! and the one of a robot that is lost.
//!
//! The identifier has three explanations of its observations: nothing is wrong, a fault of its
//! tree, or something unknown. A state's likelihood is the identifier's probability of the
//! explanations that fit it, divided by what it predicted for them before the cycle's data:
//!
//! - hardware: a fault of the tree, or unknown. Something is wrong, and a fault that nobody has
//!   modelled is a fault;
//! - lost: nothing, or unknown. A pose that jumps moves as no model of the robot does; a robot
//!   that lost its way little by little moves as any;
//! - every other state: nothing.
//!
//! Quotients are summed, as logarithms, over an epoch. While the identifier watches, it says
//! nothing about faults, and there is no evidence. When it begins to identify, returns to watching
//! or names another mode, quotients mean little and its probabilities are taken over: of a fault of
//! the tree by the hardware state, of unknown by both, as they were believed before, of nothing by
//! all but hardware. The model's start belief in the hardware state is the least that is taken
//! over. Probabilities that the identifier holds against a tracked belief that expects them to have
//! been mended are taken over too: clearing needs evidence.
//!
//! A robot that has sought its place, and found it or not, has done what it can about a lost place:
//! what is unknown then is the hardware's, until an epoch of following the path was quiet and the
//! identifier saw nothing. (A robot that finds itself elsewhere begins a new run.)
//!
//! While the identifier reports that something is wrong, only actions that may mend the hardware
//! are allowed, and once those that may find a lost robot's place. Looking at what blocks the way
//! does not change the identifier's belief, and a policy that expects to know more after any step
//! (Q-MDP does) would look for ever.
//!
//! Without the identifier, an alarm of the detector is something unknown, with its probability.

use vigil_blocks::{DetectionBelief, FaultBelief};
use vigil_pomdp::Pomdp;

use crate::state_belief::P_TOLERANCE;

/// One cycle can change the odds of a state by this factor at most, as a logarithm. Chosen by hand:
/// e^20 is beyond any odds that a decision turns on, and one wild cycle cannot outweigh an epoch.
const LOG_RATIO_MAX: f64 = 20.0;
/// An epoch can change them by this factor at most. e^-300 is 5e-131: times a belief it is still a
/// normal double, the least of which is 2e-308.
const LOG_EPOCH_MAX: f64 = 300.0;
/// The tracked belief may differ from the identifier's by this much (half the sum of absolute
/// differences); beyond it, it is taken over. Chosen by hand: it changes no value by more than a
/// twentieth of its range. Smaller discards what the decision model knows about mending; larger
/// lets a fault fade that the identifier still holds.
const DRIFT_MAX: f64 = 0.05;
/// Something is wrong above this probability: more likely than not, as for every name.
const WRONG_MIN: f64 = 0.5;
/// An action mends a state if it leads out of it by this much more than the least that any does.
/// Chosen by hand between rounding (1e-15) and any probability that a model would name.
const MENDS_MIN: f64 = 1e-6;
/// No probability that is taken over is nearer to 1. Chosen by hand: soft evidence multiplies, and
/// could never lead out of a belief of exactly 1.
const P_MAX: f64 = 1.0 - 1e-6;

/// Probabilities of the explanations; what is left is that nothing is wrong.
#[derive(Debug, Clone, Copy, Default)]
struct Explanations {
    modelled: f64,
    unknown: f64,
}

impl Explanations {
    fn new(p_nominal: f64, p_unknown: f64) -> Self {
        let unknown = p_unknown.clamp(0.0, 1.0);
        Self {
            modelled: (1.0 - p_nominal - unknown).clamp(0.0, 1.0),
            unknown,
        }
    }

    fn any(self) -> f64 {
        (self.modelled + self.unknown).min(1.0)
    }
}

/// Who reports, of which start, in which mode. Quotients mean something while this stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Context {
    /// The identifier, not the detector in its place.
    is_identifier: bool,
    writer_epoch: u64,
    /// Whether it identifies; of the detector, whether its alarm stands.
    mode: u32,
    changes: u32,
}

/// The states, and the evidence of the present epoch.
#[derive(Debug, Clone)]
pub(crate) struct HardwareEvidence {
    state: usize,
    lost: Option<usize>,
    p_start: f64,
    tree_hash: u64,
    log: LogLikelihoods,
    before: Option<Context>,
    p: Explanations,
    identifies: bool,
    /// The robot has sought its place.
    has_sought: bool,
    mends: Vec<Remedy>,
}

/// Sums of log-likelihoods over an epoch.
#[derive(Debug, Clone, Copy, Default)]
struct LogLikelihoods {
    hardware: f64,
    lost: f64,
    others: f64,
}

/// What an action is good for.
#[derive(Debug, Clone, Copy)]
struct Remedy {
    /// It mends the hardware.
    hardware: bool,
    /// It finds the place of a lost robot.
    place: bool,
}

impl HardwareEvidence {
    pub(crate) fn new(model: &Pomdp, state: usize, lost: Option<usize>, tree_hash: u64) -> Self {
        let leaves = |state: usize, action: usize| -> f64 {
            let elsewhere = model.successors(state, action).iter();
            elsewhere
                .filter(|(to, _)| *to != state)
                .map(|(_, p)| p)
                .sum()
        };
        let actions = 0..model.actions().len();
        let least = |state| {
            actions
                .clone()
                .map(|a| leaves(state, a))
                .fold(1.0, f64::min)
        };
        let mends = |state: usize, action| leaves(state, action) > least(state) + MENDS_MIN;
        let remedy = |action| Remedy {
            hardware: mends(state, action),
            place: lost.is_some_and(|lost| mends(lost, action)),
        };
        Self {
            mends: actions.clone().map(remedy).collect(),
            state,
            lost,
            p_start: model.start().get(state).copied().unwrap_or(0.0),
            tree_hash,
            log: LogLikelihoods::default(),
            before: None,
            p: Explanations::default(),
            identifies: false,
            has_sought: false,
        }
    }

    /// True if a diagnosis speaks of this tree and its probabilities are some.
    pub(crate) fn is_sound(&self, diagnosis: &FaultBelief) -> bool {
        let p = [
            diagnosis.p[0],
            diagnosis.p_unknown,
            diagnosis.p_predicted[0],
            diagnosis.p_unknown_predicted,
        ];
        let is_probability = |p: &f64| (0.0..=1.0 + P_TOLERANCE).contains(p);
        p.iter().all(is_probability) && diagnosis.tree_hash == self.tree_hash
    }

    /// Takes a diagnosis; true if the identifier's probabilities are to be taken over.
    pub(crate) fn add(&mut self, diagnosis: &FaultBelief) -> bool {
        let identifies = diagnosis.identifying != 0;
        let now = Context {
            is_identifier: true,
            writer_epoch: diagnosis.header.epoch,
            mode: diagnosis.identifying,
            changes: diagnosis.mode_change_count,
        };
        let p = Explanations::new(diagnosis.p[0], diagnosis.p_unknown);
        if self.enter(now, identifies, p) {
            return true;
        }
        if self.identifies {
            let predicted =
                Explanations::new(diagnosis.p_predicted[0], diagnosis.p_unknown_predicted);
            let add = |sum: &mut f64, p: f64, predicted: f64| {
                *sum = (*sum + log(p / predicted)).clamp(-LOG_EPOCH_MAX, LOG_EPOCH_MAX);
            };
            add(&mut self.log.hardware, p.any(), predicted.any());
            add(
                &mut self.log.lost,
                1.0 - p.modelled,
                1.0 - predicted.modelled,
            );
            add(&mut self.log.others, 1.0 - p.any(), 1.0 - predicted.any());
        }
        false
    }

    /// Takes a detection in the identifier's place; true if its probability is to be taken over.
    pub(crate) fn add_alarm(&mut self, detection: &DetectionBelief) -> bool {
        let DetectionBelief { alarm, p_fault, .. } = *detection;
        let now = Context {
            is_identifier: false,
            writer_epoch: detection.header.epoch,
            mode: alarm,
            changes: detection.alarm_count,
        };
        let p = Explanations::new(1.0 - p_fault, p_fault);
        self.enter(now, alarm != 0, p)
    }

    /// True if the context has changed and what is said now, or was said before, is a fault.
    fn enter(&mut self, now: Context, identifies: bool, p: Explanations) -> bool {
        let before = self.before.replace(now);
        let identified = std::mem::replace(&mut self.identifies, identifies);
        self.p = match identifies {
            true => p,
            false => Explanations::default(),
        };
        let is_new = before != Some(now);
        if is_new {
            self.clear();
        }
        is_new && (identifies || identified)
    }

    /// Writes the likelihood of every state, the larger being 1, and begins anew.
    pub(crate) fn take(&mut self, likelihood: &mut [f64]) {
        let LogLikelihoods {
            hardware,
            lost,
            others,
        } = self.log;
        let lost = self.lost.map(|index| (index, lost));
        let max = lost.map_or(hardware, |(_, lost)| hardware.max(lost));
        let max = max.max(others);
        likelihood.fill((others - max).exp());
        for (index, log) in lost.into_iter().chain([(self.state, hardware)]) {
            if let Some(l) = likelihood.get_mut(index) {
                *l = (log - max).exp();
            }
        }
        self.clear();
    }

    /// True if `belief` expects a fault to be mended that the identifier still sees.
    pub(crate) fn has_drifted(&self, belief: &[f64]) -> bool {
        let of = |state: usize| belief.get(state).copied().unwrap_or(0.0);
        let hardware = of(self.state);
        let either = hardware + self.lost.map_or(0.0, of);
        let explained = if self.has_sought { hardware } else { either };
        self.identifies
            && (hardware < self.p.modelled - DRIFT_MAX || explained < self.p.any() - DRIFT_MAX)
    }

    /// Writes `belief` with the identifier's probabilities of the states into `weights`.
    pub(crate) fn anchored(&self, belief: &[f64], start: &[f64], weights: &mut [f64]) {
        let Explanations { modelled, unknown } = self.p;
        let share = [belief, start].into_iter().find_map(|of| self.share(of));
        let share = share.unwrap_or(1.0);
        let p = (modelled + unknown * share).clamp(self.p_start, P_MAX);
        let lost = unknown * (1.0 - share);
        let nothing = (1.0 - modelled - unknown).max(1.0 - P_MAX);
        let rest = |of: &[f64]| -> f64 {
            let others = of.iter().enumerate().filter(|(s, _)| *s != self.state);
            others.map(|(_, b)| b).sum()
        };
        // A belief in nothing else falls back to the start's.
        let of = if rest(belief) > 0.0 { belief } else { start };
        let others = rest(of);
        for (s, (weight, b)) in weights.iter_mut().zip(of).enumerate() {
            let extra = if self.lost == Some(s) { lost } else { 0.0 };
            *weight = if s == self.state {
                p
            } else {
                (1.0 - p) * (extra + nothing * b / others) / (lost + nothing)
            };
        }
    }

    /// The robot has sought its place.
    pub(crate) const fn sought(&mut self) {
        self.has_sought = true;
    }

    /// An epoch of following the path was quiet.
    pub(crate) const fn quiet(&mut self) {
        self.has_sought &= self.identifies;
    }

    /// True if an action may be taken now.
    pub(crate) fn allows(&self, action: usize) -> bool {
        let may_mend = |remedy: &Remedy| remedy.hardware || (remedy.place && !self.has_sought);
        let is_wrong = self.identifies && self.p.any() > WRONG_MIN;
        !is_wrong
            || self.mends.get(action).is_some_and(may_mend)
            || !self.mends.iter().any(may_mend)
    }

    /// The hardware's share of what is believed of both states; `None` if neither is.
    fn share(&self, belief: &[f64]) -> Option<f64> {
        if self.has_sought {
            return Some(1.0);
        }
        let of = |state: usize| belief.get(state).copied().unwrap_or(0.0);
        let (hardware, lost) = (of(self.state), self.lost.map_or(0.0, of));
        let both = hardware + lost;
        (both > 0.0).then(|| hardware / both)
    }

    /// Diagnoses were lost: the next is taken over, if it or the last speaks of a fault.
    pub(crate) fn forget(&mut self) {
        self.before = None;
        self.clear();
    }

    /// Nothing has been said.
    pub(crate) fn reset(&mut self) {
        self.forget();
        (self.identifies, self.p) = (false, Explanations::default());
        self.has_sought = false;
    }

    fn clear(&mut self) {
        self.log = LogLikelihoods::default();
    }
}

/// Bounded; no evidence where the quotient has no meaning.
fn log(ratio: f64) -> f64 {
    if ratio.is_finite() && ratio >= 0.0 {
        ratio.ln().clamp(-LOG_RATIO_MAX, LOG_RATIO_MAX)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests;

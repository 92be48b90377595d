//! Why one explanation is preferred to another: the evidence of each channel.
//!
//! When a diagnosis is made, it and the next best explanation are both followed from the onset on,
//! each as if it alone were true, and the log-likelihoods of their readings are summed by channel.
//! The filter's own hypotheses cannot say this: the next best of them has usually become it a moment
//! ago, and owes its past to the best.

use nalgebra::{Matrix3, Vector3};
use vigil_blocks::{CHANNELS, Channel, MODE_MULTIPLE, MODE_UNKNOWN, WHEELS};
use vigil_inference::track::Track;
use vigil_robot::learned::{Moved, Observation, WheelEvidence};

use crate::exact::{Exact, is_new};
use crate::modes::Leaves;
use crate::posterior::Posterior;

/// What a diagnosis may say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Explanation {
    /// Exactly this set of leaves.
    Leaves(u64),
    /// No modelled fault.
    Unknown,
}

/// An explanation that is taken to be true since the onset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lineage {
    /// What moves the robot.
    pub moved: Moved,
    /// Wheels whose encoders are broken, as bits.
    pub broken: u32,
    /// Pose and deviations.
    pub track: Track,
    /// Log-likelihood of the readings, by channel.
    pub heard: [f64; CHANNELS],
}

/// The diagnosis and its rival.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reasons {
    followed: Option<[Lineage; 2]>,
    onset_ns: u64,
    /// The next best when the diagnosis was made: a node, unknown or multiple, as
    /// `FaultBelief::mode`.
    pub runner_up: u32,
}

impl Reasons {
    /// Begins to follow the diagnosis of `posterior` and its rival from a pose at `onset_ns`.
    pub fn begin(
        &mut self,
        posterior: &Posterior,
        exact: &Exact,
        leaves: &Leaves,
        pose: (Vector3<f64>, Matrix3<f64>),
        onset_ns: u64,
    ) {
        let (named, rival) = contenders(posterior);
        self.runner_up = match rival {
            Explanation::Unknown => MODE_UNKNOWN,
            Explanation::Leaves(0) => 0,
            Explanation::Leaves(set) if set.count_ones() > 1 => MODE_MULTIPLE,
            Explanation::Leaves(set) => set.trailing_zeros(),
        };
        self.onset_ns = onset_ns;
        let lineage = |explanation| {
            let (moved, broken) = match explanation {
                Explanation::Unknown => (Moved::UnknownAny, 0),
                Explanation::Leaves(set) => match wheels(&leaves.stuck, set) {
                    0 => (Moved::Nominal, wheels(&leaves.encoder, set)),
                    stuck => (Moved::Stuck(stuck), wheels(&leaves.encoder, set)),
                },
            };
            exact.lineage(moved, broken, pose)
        };
        self.followed = lineage(named).zip(lineage(rival)).map(<[_; 2]>::from);
    }

    /// Takes the next observation.
    pub fn follow(&mut self, exact: &Exact, observation: &Observation, noise_scale: f64) {
        let Some(followed) = &mut self.followed else {
            return;
        };
        let is_new = is_new(observation.t_ns, self.onset_ns);
        for lineage in followed {
            exact.follow(lineage, observation, noise_scale, is_new);
        }
    }

    /// By channel: how much more the readings since the onset are expected under the diagnosis than
    /// under its rival, natural log-likelihood.
    #[must_use]
    pub fn channel_evidence(&self) -> [f64; CHANNELS] {
        self.followed.map_or([0.0; CHANNELS], |[named, rival]| {
            std::array::from_fn(|i| {
                let apart = named.heard[i] - rival.heard[i];
                if apart.is_finite() { apart } else { 0.0 }
            })
        })
    }
}

impl Lineage {
    /// Adds one observation's wheels and steering angles; the latter, which are weighed together,
    /// stand at the first wheel's.
    pub fn hear(&mut self, evidence: &WheelEvidence, whole: impl Fn(usize) -> f64, count: usize) {
        for wheel in 0..count {
            let is_broken = self.broken >> wheel & 1 == 1;
            self.heard[Channel::wheel_rate(wheel)] += if is_broken {
                evidence.broken_anyhow(wheel)
            } else {
                whole(wheel)
            };
        }
        if self.moved == Moved::UnknownAny {
            self.heard[Channel::steer(0)] += evidence.steering;
        }
    }
}

/// The best explanation and the next best that is not the same faults and one more: those explain
/// nothing else.
fn contenders(posterior: &Posterior) -> (Explanation, Explanation) {
    let named = posterior.sets[0].leaves;
    let others = posterior.sets[1..posterior.set_count.max(1)].iter();
    let mut others = others.filter(|set| named == 0 || set.leaves & named != named);
    let rival = others.next().copied().unwrap_or_default();
    if posterior.unknown > 0.5 {
        (Explanation::Unknown, Explanation::Leaves(named))
    } else if posterior.unknown > rival.p {
        (Explanation::Leaves(named), Explanation::Unknown)
    } else {
        (
            Explanation::Leaves(named),
            Explanation::Leaves(rival.leaves),
        )
    }
}

/// Wheels whose node is in a set, as bits.
fn wheels(nodes: &[Option<usize>; WHEELS], set: u64) -> u32 {
    let is_in = |node: &Option<usize>| node.is_some_and(|node| set >> node & 1 == 1);
    let wheels = nodes.iter().enumerate();
    wheels.fold(0, |bits, (wheel, node)| {
        bits | u32::from(is_in(node)) << wheel
    })
}

//! Scores long runs as a user lives through them: what is said at every instant, not only at a few.
//!
//! A run is a series of verdicts ([`super::Verdict`]) against the truth, a series of [`Stretch`]es.
//! Definitions:
//!
//! - *onset*: the truth changes to a fault, or to another fault; it is judged until the truth
//!   changes again. From healthy, the *delay* runs to the next rise of the alarm; an alarm that
//!   stands already announces nothing. During another fault, to that or the next change of `mode`;
//! - *right leaf*: `mode` is the leaf that is true; for several faults `MULTIPLE` with exactly the
//!   true set; for what no model describes `UNKNOWN`, or its own leaf if it has one; without a
//!   fault the nominal mode;
//! - *right side*: the right leaf, or a node of the true side; for what no model describes also
//!   every abstract node;
//! - *right size*: the right leaf, and the way in which it is said to be broken is the true one,
//!   with a size within 20 % of the true one; where a fault has a size;
//! - *standing*: an alarm is up, from 10 s on, while a fault persists;
//! - *from h seconds on*: driven time at least h after the last onset, while the fault persists;
//! - *changes*: of `mode` and of the reported name; *settled* ones come 2 s after an onset or
//!   later, while the fault persists, where there should be none;
//! - *time to clear*: driven time from the end of all faults until the alarm is down, and until
//!   `mode` and the reported name are nominal, and have been for 2 s; what does not happen before
//!   the next fault or the end is missing;
//! - *false alarm*: a rise while nothing is wrong; *action*: each entry into anything but going on,
//!   but for stops by rule while no belief is usable, which are counted apart;
//! - *latched*: a call for help that stands when a run ends without a fault;
//! - *claim*: the most probable of nominal mode, leaves and unknown ([`Belief`]), and whether it is
//!   true: one of the true leaves, or for what no model describes the unknown or its own leaf. Of
//!   every run at [`CLAIMED_S`] after its first onset, while that fault persists, and at as many
//!   instants before it (of a run without a fault: of all of it), drawn by the run's seed. Claims
//!   make the expected calibration error;
//! - *log score*: -ln p(what is true) 2 s after the first onset, no more than 13.8; several faults
//!   at once have none, as no probability of just them is published;
//! - *told*: a fault that became active in the life that an operator sees; *activation*: each time
//!   that one did;
//! - *contradiction*: an alarm while the nominal mode has more than one half, or a reported fault
//!   without alarm.
//!
//! All runs count; what is not seen is missed. While nothing valid comes in, `BLIND` is neither
//! right nor wrong, and claims nothing.

#[cfg(test)]
mod cases;
mod claims;
mod figures;
mod recorded;
mod run;

pub use claims::{CLAIMED_S, Claim};
pub use figures::{Figure, Worst, figures};
pub use recorded::{Figures, SAFE_STOP, of_cases};
pub use run::{Actions, Changes, End, JudgedTime, Onset, Run, Scorer, ToldChange};

use vigil_blocks::SizeKind;

use super::{Belief, Taxonomy};

/// Reported without valid input.
pub const BLIND: &str = "BLIND";
/// Times after an onset at which the name is judged, s.
pub const JUDGED_S: [f64; 3] = [2.0, 5.0, 10.0];
/// Time after an onset at which the size is judged, s.
pub const SIZED_S: f64 = 3.0;
/// A size is right within this share of the true one.
const SIZE_SHARE: f64 = 0.2;
/// So long an alarm must be down, or a name be nominal, to have cleared, s.
const HELD_S: f64 = 2.0;
/// Probability above which a wrong name counts as confident.
const CONFIDENT: f64 = 0.9;

/// What is true.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Truth {
    /// Nothing is wrong.
    Healthy,
    /// These leaves of the fault tree, at least one.
    Faults(Vec<String>),
    /// Something that no model describes; naming `own` is right too.
    Unmodelled {
        /// The leaf that is about the same component, if there is one.
        own: Option<String>,
    },
}

/// What is true from an instant on.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Since when, s.
    pub from_s: f64,
    /// What.
    pub truth: Truth,
    /// How large it is, if it is one fault with a size.
    pub size: Option<Size>,
}

impl Stretch {
    /// A run that is healthy until `onset_s`, if there is an onset; then `mode` is true.
    #[must_use]
    pub fn of_label(mode: &str, onset_s: Option<f64>, taxonomy: &Taxonomy) -> Vec<Self> {
        let stretch = |from_s, truth| Self {
            from_s,
            truth,
            size: None,
        };
        let fault = || match taxonomy.index(mode) {
            Some(_) => Truth::Faults(vec![mode.to_owned()]),
            None => Truth::Unmodelled { own: None },
        };
        let begins = stretch(f64::NEG_INFINITY, Truth::Healthy);
        let breaks = onset_s.map(|from_s| stretch(from_s, fault()));
        std::iter::once(begins).chain(breaks).collect()
    }
}

/// In which way something is broken, and by how much.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Size {
    /// The way.
    pub kind: SizeKind,
    /// The size, in its unit; 0 if the way has none.
    pub value: f64,
}

impl Size {
    /// True if `found` says the same, within 20 %.
    #[must_use]
    pub fn is(&self, found: &Self) -> bool {
        let apart = (found.value - self.value).abs();
        found.kind == self.kind && apart <= SIZE_SHARE * self.value.abs()
    }
}

/// What the action orders the robot to do, as far as it is scored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RobotOrder {
    /// As planned.
    #[default]
    GoOn,
    /// Slower.
    Slow,
    /// Stop.
    Stop,
    /// Stop by rule, because no usable belief is left.
    Blind,
    /// Stop and call for help.
    Help,
    /// Anything else: a remedy for one component, another path.
    Other,
}

impl Truth {
    /// True if nothing is wrong.
    #[must_use]
    pub const fn is_healthy(&self) -> bool {
        matches!(self, Self::Healthy)
    }

    /// Probability of what is true; `None` of several faults at once.
    fn p(&self, belief: &Belief<'_>, taxonomy: &Taxonomy) -> Option<f64> {
        let of = |leaf: &String| Some(belief.node(taxonomy.index(leaf)?, taxonomy));
        match self {
            Self::Healthy => Some(belief.node(0, taxonomy)),
            Self::Faults(leaves) => match leaves.as_slice() {
                [leaf] => Some(of(leaf).unwrap_or(0.0)),
                _ => None,
            },
            // Either is right, and they exclude each other.
            Self::Unmodelled { own } => {
                let own = own.as_ref().and_then(of).unwrap_or(0.0);
                Some(belief.unknown(taxonomy) + own)
            }
        }
    }

    /// The most probable mode as a claim.
    fn claim(&self, belief: &Belief<'_>, taxonomy: &Taxonomy) -> Claim {
        let (top, p) = belief.top(taxonomy);
        let name = top.and_then(|node| taxonomy.name(node));
        let is = |leaf: &String| name == Some(leaf.as_str());
        let is_true = match self {
            Self::Healthy => top == Some(0),
            Self::Faults(leaves) => leaves.iter().any(is),
            Self::Unmodelled { own } => top.is_none() || own.as_ref().is_some_and(is),
        };
        Claim { p, is_true }
    }

    /// True if the name, with `set` where it is `MULTIPLE`, is the one to say.
    fn is_leaf(&self, name: &str, set: &str, taxonomy: &Taxonomy) -> bool {
        match self {
            Self::Healthy => taxonomy.name(0) == Some(name),
            Self::Unmodelled { own } => name == super::UNKNOWN || own.as_deref() == Some(name),
            Self::Faults(leaves) => match leaves.as_slice() {
                [leaf] => name == leaf,
                several => {
                    let found = set.split('+').count();
                    let has = |leaf: &String| set.split('+').any(|part| part == leaf);
                    name == super::MULTIPLE && found == several.len() && several.iter().all(has)
                }
            },
        }
    }

    /// True if the name is right, or of the true side.
    fn is_side(&self, name: &str, set: &str, taxonomy: &Taxonomy) -> bool {
        if self.is_leaf(name, set, taxonomy) {
            return true;
        }
        match self {
            Self::Healthy => false,
            Self::Unmodelled { .. } => taxonomy.is_abstract(name),
            Self::Faults(leaves) => {
                let side = leaves.first().and_then(|leaf| taxonomy.side(leaf));
                let common = leaves.iter().all(|leaf| taxonomy.side(leaf) == side);
                side.is_some() && common && taxonomy.side(name) == side
            }
        }
    }

    /// True if the name is a leaf that is not true.
    fn is_wrong_leaf(&self, name: &str, set: &str, taxonomy: &Taxonomy) -> bool {
        let is_leaf = taxonomy.index(name).is_some_and(|index| index > 0);
        is_leaf && !self.is_leaf(name, set, taxonomy)
    }
}

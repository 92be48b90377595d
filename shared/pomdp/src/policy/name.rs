//! Names of policies, as configuration and command line know them.

use std::fmt;
use std::str::FromStr;

use super::{
    ActionVoting, Decider, Despot, DespotError, DespotOptions, Dual, DualControl, DualError,
    FastInformed, Information, MostLikelyState, PointBased, Policy, QMdp,
};
use crate::bounds::mdp::Solution;
use crate::bounds::{SolveError, fib};
use crate::budget::Budget;
use crate::model::Pomdp;

/// X: a policy without dual control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// `mls`.
    MostLikelyState,
    /// `av`.
    ActionVoting,
    /// `qmdp`.
    QMdp,
    /// `fib`.
    FastInformed,
}

impl Base {
    /// All of them, with their names.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::MostLikelyState, "mls"),
        (Self::ActionVoting, "av"),
        (Self::QMdp, "qmdp"),
        (Self::FastInformed, "fib"),
    ];

    /// The policy for a model, of which `solution` is the fully observable relaxation.
    ///
    /// # Errors
    /// [`SolveError`] if the values of `fib` cannot be found; the others have theirs.
    pub fn build(self, model: &Pomdp, solution: &Solution) -> Result<Box<dyn Policy>, SolveError> {
        Ok(match self {
            Self::MostLikelyState => Box::new(MostLikelyState::new(solution)),
            Self::ActionVoting => Box::new(ActionVoting::new(solution)),
            Self::QMdp => Box::new(QMdp::new(solution.clone())),
            Self::FastInformed => {
                let q = fib::solve_from(model, solution, &mut Budget::new(&mut || false))?;
                Box::new(FastInformed::new(q))
            }
        })
    }
}

/// A policy by name: `X`, `dm-X` or `adm-X`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PolicyName {
    /// X.
    pub base: Base,
    /// With dual control: whose entropy it lowers.
    pub information: Option<Information>,
}

/// A name that no policy has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("policy '{0}' is not known: allowed are mls, av, qmdp, fib, and dm-X and adm-X of each")]
pub struct NameError(pub String);

/// Why a policy cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// The settings of dual control are refused.
    #[error(transparent)]
    Dual(#[from] DualError),
    /// The settings of a search are refused.
    #[error(transparent)]
    Despot(#[from] DespotError),
    /// Its values cannot be found.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// No solved policy is at hand.
    #[error("{POINT_BASED} needs a policy that was solved beforehand, in a file")]
    Unsolved,
}

/// The name of a policy that was solved beforehand.
const POINT_BASED: &str = "point-based";
/// The name of a policy that plans while it decides.
const DESPOT: &str = "despot";

/// Any policy by name: a heuristic, which follows from the model, one solved beforehand, or one
/// that plans while it decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PolicyKind {
    /// `X`, `dm-X` or `adm-X`.
    Heuristic(PolicyName),
    /// `point-based`.
    PointBased,
    /// `despot`.
    Despot,
}

/// A name that no policy has, solved ones included.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}, {DESPOT}, and {POINT_BASED}")]
pub struct KindError(NameError);

impl PolicyKind {
    /// The decider for a model: as [`PolicyName::build`], around `solved`, or a search by `options`
    /// that may end with what is `solved`.
    ///
    /// # Errors
    /// [`BuildError`].
    pub fn build(
        self,
        model: &Pomdp,
        solution: &Solution,
        settings: impl FnOnce(Information) -> Dual,
        solved: Option<&PointBased>,
        options: &DespotOptions,
    ) -> Result<Decider, BuildError> {
        match self {
            Self::Despot => {
                let policy = Despot::new(model, solution, solved, options)?;
                Ok(Decider::new(Box::new(policy), model, solution))
            }
            Self::Heuristic(name) => name.build(model, solution, settings),
            Self::PointBased => {
                let policy = solved.ok_or(BuildError::Unsolved)?.clone();
                Ok(Decider::new(Box::new(policy), model, solution))
            }
        }
    }

    /// True if it gathers information by dual control.
    #[must_use]
    pub const fn is_dual(self) -> bool {
        matches!(self, Self::Heuristic(name) if name.information.is_some())
    }
}

impl FromStr for PolicyKind {
    type Err = KindError;

    fn from_str(name: &str) -> Result<Self, KindError> {
        match name {
            POINT_BASED => Ok(Self::PointBased),
            DESPOT => Ok(Self::Despot),
            name => name.parse().map(Self::Heuristic).map_err(KindError),
        }
    }
}

impl fmt::Display for PolicyKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Heuristic(name) => name.fmt(f),
            Self::PointBased => f.write_str(POINT_BASED),
            Self::Despot => f.write_str(DESPOT),
        }
    }
}

impl PolicyName {
    /// The decider for a model, of which `solution` is the fully observable relaxation; `settings`
    /// are those of dual control, which a policy without it does not need.
    ///
    /// # Errors
    /// [`BuildError`].
    pub fn build(
        self,
        model: &Pomdp,
        solution: &Solution,
        settings: impl FnOnce(Information) -> Dual,
    ) -> Result<Decider, BuildError> {
        let mut policy = self.base.build(model, solution)?;
        if let Some(information) = self.information {
            let settings = settings(information);
            policy = Box::new(DualControl::new(policy, model, solution, settings)?);
        }
        Ok(Decider::new(policy, model, solution))
    }
}

impl FromStr for PolicyName {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        let (information, rest) = match (name.strip_prefix("dm-"), name.strip_prefix("adm-")) {
            (Some(rest), _) => (Some(Information::State), rest),
            (_, Some(rest)) => (Some(Information::Action), rest),
            _ => (None, name),
        };
        let base = Base::ALL.iter().find(|(_, known)| *known == rest);
        let (base, _) = base.ok_or_else(|| NameError(name.to_owned()))?;
        Ok(Self {
            base: *base,
            information,
        })
    }
}

impl fmt::Display for PolicyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.information {
            None => "",
            Some(Information::State) => "dm-",
            Some(Information::Action) => "adm-",
        })?;
        let name = Base::ALL.iter().find(|(base, _)| *base == self.base);
        f.write_str(name.map_or("", |(_, name)| name))
    }
}

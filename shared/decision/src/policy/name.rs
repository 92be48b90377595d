//! Names of policies, as configuration and command line know them.

use std::fmt;
use std::str::FromStr;

use super::{
    ActionVoting, Decider, Dual, DualControl, DualError, FastInformed, Information,
    MostLikelyState, Policy, QMdp,
};
use crate::bounds::{SolveError, fib};
use crate::budget::Budget;
use crate::mdp::Solution;
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
    /// [`SolveError`] if its values cannot be found.
    pub fn build(self, model: &Pomdp, solution: &Solution) -> Result<Box<dyn Policy>, SolveError> {
        Ok(match self {
            Self::MostLikelyState => Box::new(MostLikelyState::new(solution.clone())),
            Self::ActionVoting => Box::new(ActionVoting::new(solution.clone())),
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
    /// Its values cannot be found.
    #[error(transparent)]
    Solve(#[from] SolveError),
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

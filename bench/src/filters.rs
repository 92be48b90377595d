//! The filters that are compared, behind one constructor.

use vigil_inference::adaptive::Adaptive;
use vigil_inference::bootstrap::ParticleFilter;
use vigil_inference::filter::Filter;
use vigil_inference::hierarchical::Hierarchical;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::look_ahead::LookAhead;
use vigil_inference::merged::Merged;
use vigil_inference::proposal::Proposal;
use vigil_inference::resample::Resampling;
use vigil_inference::risk;
use vigil_inference::sequences::Sequences;

/// Share of the draws that leave a mode in the raised proposal.
const RAISED: f64 = 0.5;
/// Risks leave the nominal mode this many particles, in so many steps without a fault.
const NOMINAL_MIN: f64 = 50.0;
const STEPS: f64 = 30.0;
/// KLD-sampling: distance, quantile (99 %), least number of particles.
const ADAPTIVE: (f64, f64, usize) = (0.05, 2.326, 32);
/// Mode sequences that the pruned exact filter keeps.
const SEQUENCES: usize = 300;

/// A filter to compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The paper's classical filter.
    Bootstrap,
    /// With raised fault proposals.
    Raised,
    /// The same with as many particles as the belief needs.
    Adaptive,
    /// Raised and risk-sensitive, by the risks given.
    Risk,
    /// Hierarchical, split and merged by rule.
    Hierarchical,
    /// The same with raised proposals.
    RaisedHierarchical,
    /// With raised proposals, its nodes always merged.
    Coarse,
    /// With raised proposals, its nodes always split.
    Fine,
    /// Look-ahead, Rao-Blackwellised.
    LookAhead,
    /// One Kalman filter per mode.
    Merged,
    /// The most likely sequences of modes.
    Sequences,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Bootstrap,
        Self::Raised,
        Self::Adaptive,
        Self::Risk,
        Self::Hierarchical,
        Self::RaisedHierarchical,
        Self::Coarse,
        Self::Fine,
        Self::LookAhead,
        Self::Merged,
        Self::Sequences,
    ];

    /// As tables name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bootstrap => "bootstrap",
            Self::Raised => "raised proposals",
            Self::Adaptive => "raised, adaptive",
            Self::Risk => "raised, risk-sensitive",
            Self::Hierarchical => "hierarchical",
            Self::RaisedHierarchical => "hierarchical, raised",
            Self::Coarse => "hierarchical, raised, always merged",
            Self::Fine => "hierarchical, raised, always split",
            Self::LookAhead => "look-ahead",
            Self::Merged => "merged (one per mode)",
            Self::Sequences => "mode sequences (300)",
        }
    }

    /// True if it has particles.
    #[must_use]
    pub const fn is_sampled(self) -> bool {
        !matches!(self, Self::Merged | Self::Sequences)
    }

    /// False for numbers of particles that take long and show nothing new.
    #[must_use]
    pub const fn is_sensible(self, count: usize) -> bool {
        match self {
            Self::LookAhead => count <= 1_000,
            Self::Hierarchical | Self::RaisedHierarchical => count <= 10_000,
            Self::Coarse | Self::Fine => count <= 1_000,
            Self::Raised | Self::Risk => count <= 100_000,
            Self::Adaptive => count >= 1_000 && count <= 10_000,
            _ => true,
        }
    }
}

/// A filter that lends its model, for the command of the next step.
pub trait Driven<M>: Filter {
    /// The model.
    fn model(&mut self) -> &mut M;
}

macro_rules! driven {
    ($($filter:ty, $model:path, [$($dimension:tt)*];)*) => { $(
        impl<M: $model, $($dimension)*> Driven<M> for $filter {
            fn model(&mut self) -> &mut M {
                self.model_mut()
            }
        }
    )* };
}

driven! {
    ParticleFilter<M>, Sampled, [];
    Hierarchical<M>, Sampled, [];
    LookAhead<M, N>, Conditional<N>, [const N: usize];
    Merged<M, N>, Conditional<N>, [const N: usize];
    Sequences<M, N>, Conditional<N>, [const N: usize];
}

/// A model that every filter can take.
pub trait Model<const N: usize>:
    Sampled<Observation = <Self as Model<N>>::Seen>
    + Conditional<N, Observation = <Self as Model<N>>::Seen>
    + Clone
    + 'static
{
    /// What is observed in one step.
    type Seen: ?Sized;
}

impl<M, O: ?Sized, const N: usize> Model<N> for M
where
    M: Sampled<Observation = O> + Conditional<N, Observation = O> + Clone + 'static,
{
    type Seen = O;
}

/// Builds a filter; `nodes` are the abstract nodes of the hierarchical one, `risk` is that of each
/// mode.
///
/// # Panics
/// If `nodes` are not a hierarchy over the model's modes.
pub fn build<M: Model<N>, const N: usize>(
    kind: Kind,
    model: &M,
    (nodes, risk): (&[Vec<usize>], &[f64]),
    count: usize,
    seed: u64,
) -> Box<dyn Driven<M, Observation = <M as Model<N>>::Seen>> {
    let resampling = Resampling::default();
    let sampled = |proposal| {
        Box::new(ParticleFilter::new(
            model.clone(),
            proposal,
            resampling,
            count,
            seed,
        ))
    };
    let hierarchical = || {
        fits(Hierarchical::new(
            model.clone(),
            nodes,
            resampling,
            count,
            seed,
        ))
    };
    let raised = || hierarchical().with_raised_proposals(RAISED);
    match kind {
        Kind::Bootstrap => sampled(Proposal::prior(model)),
        Kind::Raised => sampled(fits(Proposal::raised(model, RAISED))),
        Kind::Adaptive => {
            let (error, quantile, least) = ADAPTIVE;
            let adaptive = Adaptive::new(error, quantile, least, count);
            let filter = sampled(fits(Proposal::raised(model, RAISED)));
            Box::new(filter.with_adaptive_count(adaptive))
        }
        Kind::Risk => {
            let mut risk = risk.to_vec();
            let p: Vec<f64> = (0..risk.len()).map(|k| prior(model, k)).collect();
            risk::bound(&mut risk, &p, count, NOMINAL_MIN.min(0.5 * count as f64));
            sampled(fits(Proposal::risk_raised(model, RAISED, &risk)))
        }
        Kind::Hierarchical => Box::new(hierarchical()),
        Kind::RaisedHierarchical => Box::new(raised()),
        Kind::Coarse => Box::new(raised().with_fixed_resolution(true)),
        Kind::Fine => Box::new(raised().with_fixed_resolution(false)),
        Kind::LookAhead => Box::new(LookAhead::<M, N>::new(model.clone(), count, seed)),
        Kind::Merged => Box::new(Merged::<M, N>::new(model.clone())),
        Kind::Sequences => Box::new(Sequences::<M, N>::new(model.clone(), SEQUENCES)),
    }
}

/// Probability of a mode before the data speak, some steps after the start.
fn prior<M: Modes>(model: &M, mode: usize) -> f64 {
    let fault = |k| STEPS * model.transition(0, k);
    match mode {
        0 => 1.0 - (1..model.modes()).map(fault).sum::<f64>().min(0.9),
        _ => fault(mode),
    }
}

#[allow(clippy::panic)] // A measuring program's own settings.
fn fits<T, E: std::fmt::Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|error| panic!("{error}"))
}

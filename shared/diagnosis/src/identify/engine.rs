//! The filter that an identification runs on.

use vigil_checkpoint::Checkpoint;
use vigil_robot::learned::{Healthy, NoiseScales, Observation};

use crate::identify::further::Fusion;
use crate::identify::hypotheses::{HypothesisList, add_hypotheses};
use crate::identify::leaf_map::LeafMap;
use crate::identify::multiple_hypothesis::MultipleHypothesis;
use crate::identify::node_sizes::NodeSizes;
use crate::identify::single_fault::SingleFaultFilter;
use crate::identify::tree_belief::TreeBelief;

/// The multiple-hypothesis filter over sets of faults, or one of the library's over single faults.
#[derive(Debug, Clone, Checkpoint)]
pub enum Engine {
    /// Sets of faults.
    MultipleHypothesis(Box<MultipleHypothesis>),
    /// Single faults.
    SingleFault(Box<SingleFaultFilter>),
}

impl Engine {
    /// Starts from the nominal mode, as the detector knew it at `t_ns`.
    pub fn restart(&mut self, healthy: &Healthy, t_ns: u64) {
        match self {
            Self::MultipleHypothesis(filter) => filter.restart(healthy, t_ns),
            Self::SingleFault(filter) => filter.restart(healthy, t_ns),
        }
    }

    /// Most hypotheses or particles.
    #[must_use]
    pub fn limit(&self) -> usize {
        match self {
            Self::MultipleHypothesis(filter) => filter.limit(),
            Self::SingleFault(filter) => filter.limit(),
        }
    }

    /// From the next observation on at most `count` hypotheses or particles.
    pub fn set_limit(&mut self, count: usize) {
        match self {
            Self::MultipleHypothesis(filter) => filter.set_limit(count),
            Self::SingleFault(filter) => filter.set_limit(count),
        }
    }

    /// Hypotheses or particles at present.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::MultipleHypothesis(filter) => filter.hypotheses().len(),
            Self::SingleFault(filter) => filter.count(),
        }
    }

    /// Takes one observation.
    pub fn step(&mut self, observation: &Observation, noise: NoiseScales) {
        match self {
            Self::MultipleHypothesis(filter) => filter.step(observation, noise),
            Self::SingleFault(filter) => filter.step(observation, noise),
        }
    }

    /// Fills the probabilities of nodes, sets and unknown; the first by what more channels
    /// say too.
    pub fn posterior(&mut self, leaves: &LeafMap, fusion: Option<&Fusion>, out: &mut TreeBelief) {
        match self {
            Self::MultipleHypothesis(filter) => filter.posterior(fusion, out),
            Self::SingleFault(filter) => filter.posterior(leaves, out),
        }
    }

    /// In which way each leaf's component is broken, and by how much: the first filter knows.
    #[must_use]
    pub fn sizes(&self, leaves: &LeafMap, posterior: &TreeBelief) -> NodeSizes {
        match self {
            Self::MultipleHypothesis(filter) => NodeSizes::new(filter, leaves, posterior),
            Self::SingleFault(_) => NodeSizes::default(),
        }
    }

    /// Most probable onset of a leaf's fault, capture time ns; 0 if it is no leaf.
    #[must_use]
    pub fn onset(&self, node: usize) -> u64 {
        match self {
            Self::MultipleHypothesis(filter) => filter.onset(node),
            Self::SingleFault(filter) => filter.onset(node),
        }
    }

    /// Most probable onset of the unknown, capture time ns; 0 if it was never supposed.
    #[must_use]
    pub fn onset_unknown(&self) -> u64 {
        match self {
            Self::MultipleHypothesis(filter) => filter.onset_unknown(),
            Self::SingleFault(filter) => filter.onset_unknown(),
        }
    }

    /// Observations that nothing explained, and were passed over.
    #[must_use]
    pub const fn degenerate_count(&self) -> u32 {
        match self {
            Self::MultipleHypothesis(filter) => filter.degenerate_count(),
            Self::SingleFault(filter) => filter.degenerate_count(),
        }
    }

    /// Adds the hypotheses, or the particles.
    pub fn hypotheses(&self, leaves: &LeafMap, out: &mut HypothesisList) {
        match self {
            Self::MultipleHypothesis(filter) => add_hypotheses(filter, leaves, out),
            Self::SingleFault(filter) => filter.hypotheses(out),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sensors;
    use crate::identify::fault_rates::fault_rates;
    use crate::rover::Rover;

    #[test]
    fn the_onset_of_the_unknown_is_the_first_frame_that_it_may_explain() {
        let rover = Rover::new();
        let (model, robot) = (&rover.model, &rover.robot);
        let leaves = rover.leaves(Sensors::PoseEncoders);
        let rates = fault_rates(&robot.fault_prior, &leaves, 0.01);
        let filter = MultipleHypothesis::new(model, robot, &leaves, true, rates);
        let mut engine = Engine::MultipleHypothesis(Box::new(filter));
        engine.restart(&Healthy::unsure(model, robot), 7);
        assert_eq!((engine.onset_unknown(), engine.count()), (0, 1));
        let observation = Observation {
            t_ns: 500,
            t_first_ns: 460,
            dt_s: 0.05,
            moving: true,
            ..Observation::default()
        };
        engine.step(&observation, NoiseScales::default());
        assert_eq!(
            (engine.onset_unknown(), engine.degenerate_count()),
            (460, 0)
        );
        engine.set_limit(1);
        engine.step(&observation, NoiseScales::default());
        assert_eq!((engine.count(), engine.limit()), (1, 1));
    }
}

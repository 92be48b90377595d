//! What rules see of detector and identifier.

use vigil_blocks::{DetectionBelief, FaultBelief, MODE_MULTIPLE};
use vigil_setup::Setup;

use super::breakdown::Cause;
use super::rules::{RuleInput, RuleOutput};

/// Leaves of the tree with what they mean.
#[derive(Debug, Clone)]
pub struct Explanations {
    leaves: Vec<(usize, Cause)>,
}

impl Explanations {
    /// Of a graph's fault tree.
    #[must_use]
    pub fn new(setup: &Setup) -> Self {
        let tree = &setup.tree;
        let meaning = |node: usize| {
            let fault = tree.nodes().get(node)?.fault.as_deref()?;
            let (kind, wheel) = fault.split_once(':')?;
            let wheel = setup.robot.wheel_index(wheel)?;
            let cause = match kind {
                "stuck" => Cause::Stuck(wheel),
                "encoder" => Cause::Encoder(wheel),
                _ => return None,
            };
            Some((node, cause))
        };
        Self {
            leaves: tree.leaves().filter_map(meaning).collect(),
        }
    }

    /// What a rule sees in a cycle.
    #[must_use]
    pub fn input(&self, detection: &DetectionBelief, diagnosis: &FaultBelief) -> RuleInput {
        let (explanation, p) = self.most_probable(diagnosis);
        RuleInput {
            alarm: detection.alarm != 0,
            explanation,
            p,
            several: diagnosis.mode == MODE_MULTIPLE,
            limp_home: self.limp_home(diagnosis),
        }
    }

    /// What answers all faults of the most probable set, if they are several.
    fn limp_home(&self, diagnosis: &FaultBelief) -> Option<RuleOutput> {
        let sets = diagnosis.sets.iter().take(diagnosis.set_count as usize);
        let set = sets.max_by(|a, b| a.p.total_cmp(&b.p))?;
        let held = self
            .leaves
            .iter()
            .filter(|(node, _)| set.leaves >> node & 1 == 1);
        let causes: Vec<Cause> = held.map(|(_, cause)| *cause).collect();
        let are_all = causes.len() == set.leaves.count_ones() as usize;
        let is_answered = are_all && causes.len() > 1;
        RuleOutput::limp_home(causes).filter(|_| is_answered)
    }

    /// The most probable explanation, `None` for none, and its probability. Ties go to none, then
    /// to the leaf that comes first.
    fn most_probable(&self, belief: &FaultBelief) -> (Option<Cause>, f64) {
        let mut best = (None, belief.p[0]);
        for &(node, cause) in &self.leaves {
            let p = belief.p.get(node).copied().unwrap_or(0.0);
            if p > best.1 {
                best = (Some(cause), p);
            }
        }
        if belief.p_unknown > best.1 {
            best = (Some(Cause::Unmodelled), belief.p_unknown);
        }
        best
    }
}

//! What a belief says of the modes of which exactly one is true of a robot with at most one fault:
//! the nominal one, each leaf, the unknown.

use super::Taxonomy;

/// Probabilities as they are published.
///
/// Before an alarm an identifier names no fault: its contract gives the nominal mode
/// 1 - p(fault), the unknown p(fault), and each leaf zero. That zero is a rule, no belief: here the
/// unknown is divided among the leaves and itself by their priors, as the identifier itself does
/// when the alarm comes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief<'a> {
    /// Of every node, in the tree's order.
    pub p_nodes: &'a [f64],
    /// That no modelled fault explains the data.
    pub p_unknown: f64,
    /// False before an alarm: leaves are not looked at yet.
    pub is_identifying: bool,
}

impl Belief<'_> {
    /// Probability of the nominal mode or a leaf.
    #[must_use]
    pub fn node(&self, node: usize, taxonomy: &Taxonomy) -> f64 {
        let published = self.p_nodes.get(node).copied().unwrap_or(0.0);
        match node {
            0 => published,
            _ => published + self.divided() * taxonomy.leaf_share(),
        }
    }

    /// Probability of the unknown.
    #[must_use]
    pub fn unknown(&self, taxonomy: &Taxonomy) -> f64 {
        let leaves = taxonomy.leaf_names().count().saturating_sub(1);
        self.p_unknown - self.divided() * taxonomy.leaf_share() * leaves as f64
    }

    /// The most probable of all, `None` for the unknown, and its probability.
    #[must_use]
    pub fn top(&self, taxonomy: &Taxonomy) -> (Option<usize>, f64) {
        let unknown = (None, self.unknown(taxonomy));
        let nodes = taxonomy.leaf_names().map(|(node, _)| node);
        let nodes = nodes.map(|node| (Some(node), self.node(node, taxonomy)));
        nodes.fold(unknown, |top, one| if one.1 > top.1 { one } else { top })
    }

    /// What is divided among the leaves and the unknown.
    const fn divided(&self) -> f64 {
        if self.is_identifying {
            0.0
        } else {
            self.p_unknown
        }
    }
}

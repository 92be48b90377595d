//! The fault tree of a robot whose description alone says what can be broken.

use super::component::{Component, components};
use crate::description::Description;
use crate::tree::{FaultTree, Node, TreeError};

/// Name of the nominal mode.
const NOMINAL: &str = "ND";

/// A tree with a leaf for each component, below the wheel that it belongs to or the body.
///
/// # Errors
/// [`TreeError`] if it is larger than a block.
pub fn tree(robot: &Description) -> Result<FaultTree, TreeError> {
    let components = components(robot);
    let mut nodes = vec![Node {
        name: NOMINAL.to_owned(),
        parent: None,
        fault: None,
    }];
    for component in &components {
        let Some(group) = &component.group else {
            continue;
        };
        if !nodes.iter().any(|node| node.name == *group) {
            nodes.push(Node {
                name: group.clone(),
                parent: None,
                fault: None,
            });
        }
    }
    let groups = nodes.clone();
    let parent = |of: &Component| {
        let group = of.group.as_ref()?;
        groups.iter().position(|node| node.name == *group)
    };
    nodes.extend(components.iter().map(|component| Node {
        name: component.name.clone(),
        parent: parent(component),
        fault: Some(component.fault.clone()),
    }));
    FaultTree::new(nodes)
}

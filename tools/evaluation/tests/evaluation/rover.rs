//! The rover of `config/`.

use std::path::PathBuf;

use vigil_robot::Description;
use vigil_robot::FaultTree;
use vigil_robot::tree::Node;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(name)
}

/// The rover.
pub fn robot() -> Description {
    toml::from_str(&std::fs::read_to_string(path("config/robots/rover.toml")).unwrap()).unwrap()
}

/// The paper's tree for six wheels.
pub fn tree() -> FaultTree {
    let abstract_node = |name: &str| Node {
        name: name.into(),
        parent: None,
        fault: None,
    };
    let mut nodes: Vec<Node> = ["ND", "LSS", "RSS", "RLE"].map(abstract_node).to_vec();
    for (kind, suffix) in [("stuck", "STUCK"), ("encoder", "ENC")] {
        for wheel in ["LF", "LM", "LR", "RF", "RM", "RR"] {
            let parent = match (kind, wheel.starts_with('L')) {
                ("encoder", _) => 3,
                (_, true) => 1,
                (_, false) => 2,
            };
            nodes.push(Node {
                name: format!("{wheel}_{suffix}"),
                parent: Some(parent),
                fault: Some(format!("{kind}:{wheel}")),
            });
        }
    }
    FaultTree::new(nodes).unwrap()
}

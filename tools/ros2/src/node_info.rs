//! What tells `ros2 node list` which node stands behind the topics
//! (`rmw_dds_common/msg/ParticipantEntitiesInfo`).

/// Topic and type, as every implementation of ROS 2 has them.
pub const TOPIC: &str = "ros_discovery_info";
/// See [`TOPIC`].
pub const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
/// Encapsulation: CDR, little endian.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// Identity of a participant or writer on the network.
pub type Identity = [u8; 16];

/// A node with its writers.
pub struct NodeInfo<'a> {
    /// Who it belongs to.
    pub participant: Identity,
    /// Its name, without a namespace.
    pub name: &'a str,
    /// Writers of its topics.
    pub writers: &'a [Identity],
    /// Bytes of an identity: 16, and 24 up to ROS 2 Humble.
    pub identity_bytes: usize,
}

/// A message under way.
struct Text(Vec<u8>);

impl Text {
    fn number(&mut self, number: usize) {
        let written = self.0.len() - HEAD.len();
        self.0.resize(HEAD.len() + written.next_multiple_of(4), 0);
        self.0.extend((number as u32).to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.number(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    fn identity(&mut self, identity: &Identity, bytes: usize) {
        self.0.extend(identity);
        self.0.extend(vec![0; bytes.saturating_sub(identity.len())]);
    }
}

impl NodeInfo<'_> {
    /// The message.
    pub fn cdr(&self) -> Vec<u8> {
        let mut text = Text(HEAD.to_vec());
        text.identity(&self.participant, self.identity_bytes);
        text.number(1);
        text.text("/");
        text.text(self.name);
        // It reads nothing.
        text.number(0);
        text.number(self.writers.len());
        for writer in self.writers {
            text.identity(writer, self.identity_bytes);
        }
        text.0
    }
}

/// A name that ROS 2 takes for a node: letters, digits and `_`.
pub fn node_name(graph: &str) -> String {
    let plain = |letter: char| match letter.is_ascii_alphanumeric() {
        true => letter,
        false => '_',
    };
    format!("vigil_{graph}").chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_told_byte_by_byte_as_the_definition_says() {
        let info = NodeInfo {
            participant: [1; 16],
            name: "ab",
            writers: &[[2; 16]],
            identity_bytes: 16,
        };
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([1; 16]);
        expected.extend([1, 0, 0, 0]); // one node
        expected.extend([2, 0, 0, 0, b'/', 0, 0, 0]); // padded
        expected.extend([3, 0, 0, 0, b'a', b'b', 0, 0]);
        expected.extend([0, 0, 0, 0]); // no reader
        expected.extend([1, 0, 0, 0]);
        expected.extend([2; 16]);
        assert_eq!(info.cdr(), expected);
        let older = NodeInfo {
            identity_bytes: 24,
            ..info
        };
        assert_eq!(older.cdr().len(), expected.len() + 16);
    }

    #[test]
    fn names_of_nodes_are_letters_digits_and_underscores() {
        assert_eq!(node_name("my-rover.2"), "vigil_my_rover_2");
    }
}

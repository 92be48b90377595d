//! Named numbers, which viewers show as curves.

use crate::cdr::Cdr;
use crate::messages::header::Header;
use crate::messages::message::Message;

/// `sensor_msgs/msg/JointState`. `positions` and `velocities` are as many as the names, or none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointState<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) names: &'a [String],
    pub(crate) positions: &'a [f64],
    pub(crate) velocities: &'a [f64],
}

impl<'a> JointState<'a> {
    /// Numbers that are no joints' but have names.
    pub(crate) const fn named(unix_ns: u64, names: &'a [String], values: &'a [f64]) -> Self {
        Self {
            header: Header::at(unix_ns),
            names,
            positions: values,
            velocities: &[],
        }
    }
}

impl Message for JointState<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        self.header.encode(cdr);
        cdr.text_sequence(self.names);
        cdr.f64_sequence(self.positions);
        cdr.f64_sequence(self.velocities);
        cdr.f64_sequence(&[]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_state_is_what_the_standard_says_byte_by_byte() {
        let mut cdr = Cdr::new();
        let names = ["LF".to_owned()];
        JointState::named(3_000_000_007, &names, &[1.0]).encode(&mut cdr);
        #[rustfmt::skip]
        let expected = [
            0, 1, 0, 0,
            3, 0, 0, 0, 7, 0, 0, 0, // stamp
            1, 0, 0, 0, 0, 0, 0, 0, // frame "", padded for the count
            1, 0, 0, 0, 3, 0, 0, 0, b'L', b'F', 0, 0, // names, padded
            1, 0, 0, 0, // one position, at 32 of 8
            0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
            0, 0, 0, 0, // no velocity
            0, 0, 0, 0, // no effort
        ];
        assert_eq!(cdr.bytes(), expected);
    }
}

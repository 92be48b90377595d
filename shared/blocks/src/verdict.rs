//! What Vigil answers a publisher of datagrams: diagnosis and action in one small block.

use crate::action::Action;
use crate::block::block;
use crate::diagnosis::FaultBelief;
use crate::header::Header;

/// Bytes of a name in a [`Verdict`].
pub const NAME_SIZE: usize = 32;

block! {
    /// Sent to the source of the frames over its own socket, for each [`Action`]. A robot obeys it
    /// for `valid_for_ns` from its arrival, and stops after that.
    pub struct Verdict, size 288 {
        /// Common header. `t_capture_ns` is that of the frame behind this verdict, by the
        /// publisher's own clock.
        pub header: Header,
        /// Run of the frame.
        pub run_id: u64,
        /// Counts decisions: rises when the action or its parameters change. From 1.
        pub decision_seq: u64,
        /// How long the action is valid, ns from its arrival; 0 if it is not valid.
        pub valid_for_ns: u64,
        /// Probability that something is wrong.
        pub p_fault: f64,
        /// Probability of `mode`; 0 for a mode that is no node of the fault tree.
        pub p_mode: f64,
        /// Expected size of the fault `mode`, in the unit of `size_kind`; 0 without a size.
        pub size: f64,
        /// Standard deviation of `size`, in the same unit.
        pub size_sd: f64,
        /// Speed factor to apply, 0..1.
        pub speed_scale: f64,
        /// Curvature to command: `curvature_gain * curvature + curvature_offset`.
        pub curvature_gain: f64,
        /// See `curvature_gain`; 1/m.
        pub curvature_offset: f64,
        /// What the robot is to do: a [`crate::RecoveryKind`].
        pub kind: u32,
        /// Stuck wheels that the action is about, as bits in the order of the robot's wheels.
        pub stuck_wheels: u16,
        /// Wheels whose encoders are not to be trusted, as bits.
        pub broken_encoders: u16,
        /// 1 while the alarm stands.
        pub alarm: u32,
        /// Alarms raised so far.
        pub alarm_count: u32,
        /// Why nothing is seen: a [`crate::Blindness`]; 0 while something is.
        pub blind: u32,
        /// Diagnosis with hysteresis, see [`FaultBelief::reported`].
        pub mode: u32,
        /// Bit 0: identifier lost; bit 1: detector lost.
        pub lost_stages: u32,
        /// In which way the component is broken: a [`crate::SizeKind`].
        pub size_kind: u32,
        /// Name of `mode`, UTF-8, zeros behind it: a node of the fault tree (`ND` for nominal), or
        /// `UNKNOWN`, `MULTIPLE`, `BLIND`.
        pub mode_name: [u8; NAME_SIZE],
        /// Name of the next best explanation, as `mode_name`.
        pub runner_up_name: [u8; NAME_SIZE],
        /// Name of the action in the decision model, UTF-8, zeros behind it.
        pub action_name: [u8; NAME_SIZE],
        /// Word for `size_kind`: `gain`, `bias`, `stuck`; zeros behind it.
        pub size_name: [u8; NAME_SIZE],
    }
}

/// A name as a [`Verdict`] carries it: cut at a whole letter if it is longer, always with a zero
/// behind it.
#[must_use]
pub fn fixed_name(name: &str) -> [u8; NAME_SIZE] {
    let mut length = name.len().min(NAME_SIZE - 1);
    while !name.is_char_boundary(length) {
        length -= 1;
    }
    let mut fixed = [0; NAME_SIZE];
    fixed[..length].copy_from_slice(&name.as_bytes()[..length]);
    fixed
}

impl Verdict {
    /// Takes what `action` and `belief` say into the verdict that is sent at `now_ns`; the names
    /// are the caller's.
    pub fn fill(&mut self, action: &Action, belief: &FaultBelief, now_ns: u64) {
        let mode = belief.reported as usize;
        let of_node = |values: &[f64]| values.get(mode).copied().unwrap_or(0.0);
        self.run_id = action.run_id;
        self.decision_seq = action.decision_seq;
        self.valid_for_ns = action.valid_until_ns.saturating_sub(now_ns);
        self.p_fault = (1.0 - belief.p[0]).clamp(0.0, 1.0);
        self.p_mode = of_node(&belief.p);
        self.size = of_node(&belief.size);
        self.size_sd = of_node(&belief.size_sd);
        self.speed_scale = action.speed_scale;
        self.curvature_gain = action.curvature_gain;
        self.curvature_offset = action.curvature_offset;
        self.kind = action.kind;
        self.stuck_wheels = action.stuck_wheels;
        self.broken_encoders = action.broken_encoders;
        (self.alarm, self.alarm_count) = (action.alarm, action.alarm_count);
        (self.blind, self.lost_stages) = (action.blind, action.lost_stages);
        self.mode = belief.reported;
        self.size_kind = belief.size_kind.get(mode).copied().unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_cut_at_a_whole_letter() {
        assert_eq!(fixed_name("ND")[..3], *b"ND\0");
        let long = fixed_name(&"x".repeat(40));
        assert_eq!((long[NAME_SIZE - 2], long[NAME_SIZE - 1]), (b'x', 0));
        // The letter of two bytes would be cut in the middle.
        let cut = fixed_name(&format!("{}é", "x".repeat(NAME_SIZE - 2)));
        assert_eq!((cut[NAME_SIZE - 3], cut[NAME_SIZE - 2]), (b'x', 0));
    }

    #[test]
    fn an_action_is_valid_for_what_is_left_of_its_time() {
        let (mut action, mut belief) = (Action::default(), FaultBelief::default());
        (action.valid_until_ns, action.kind, action.speed_scale) = (50, 2, 0.5);
        (belief.p[0], belief.p[3], belief.size[3]) = (0.1, 0.85, 0.4);
        (belief.reported, belief.size_kind[3]) = (3, 1);
        let mut verdict = Verdict::default();
        verdict.fill(&action, &belief, 20);
        assert_eq!(
            (verdict.valid_for_ns, verdict.kind, verdict.mode),
            (30, 2, 3)
        );
        assert_eq!((verdict.p_fault, verdict.p_mode), (0.9, 0.85));
        assert_eq!((verdict.size, verdict.size_kind), (0.4, 1));
        belief.reported = crate::MODE_UNKNOWN;
        verdict.fill(&action, &belief, 60);
        assert_eq!(
            (verdict.valid_for_ns, verdict.p_mode, verdict.size_kind),
            (0, 0.0, 0)
        );
    }
}

//! What is true of a simulated robot, for those who judge a diagnosis or a decision.

use crate::answered_wheels::AnsweredWheels;
use crate::block::block;
use crate::header::{Cause, Header};

block! {
    /// Written by the simulator every cycle, of the instant at which its frame was measured. No
    /// service reads it: a robot knows nothing of the kind.
    pub struct Truth, size 152 {
        /// Common header.
        pub header: Header,
        /// The frame of this instant.
        pub cause: Cause,
        /// Run of that frame.
        pub run_id: u64,
        /// Pose in the world: x m, y m, yaw rad (not wrapped).
        pub pose: [f64; 3],
        /// Velocity of the body: forward m/s, lateral m/s, yaw rad/s.
        pub velocity: [f64; 3],
        /// What was obeyed since the frame before: a [`crate::RecoveryKind`]; 0 if no action was
        /// valid.
        pub obeyed: u32,
        /// See [`crate::Action::stuck_wheels`], of the obeyed action.
        pub stuck_wheels: u16,
        /// See [`crate::Action::broken_encoders`], of the obeyed action.
        pub broken_encoders: u16,
        /// 1 while a fault or disturbance is in force.
        pub is_disturbed: u32,
        /// 1 while something is within the bumper's reach.
        pub touches: u32,
        /// 1 once the navigation holds its goal for reached.
        pub at_goal: u32,
        /// Reserved, zero.
        pub reserved: u32,
    }
}

impl Truth {
    /// The wheels that the obeyed action was about.
    #[must_use]
    pub const fn answered(&self) -> AnsweredWheels {
        AnsweredWheels {
            stuck: self.stuck_wheels,
            encoders: self.broken_encoders,
        }
    }
}

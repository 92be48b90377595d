//! Commands from the operator.

use crate::block::block;
use crate::header::Header;

block! {
    /// Written by the operator's tool. Faults are injected only if the configuration permits it.
    pub struct Control, size 96 {
        /// Common header.
        pub header: Header,
        /// A [`ControlCommand`].
        pub command: u32,
        /// Fault or disturbance to inject or clear: its kind code; 0 to clear all kinds. To
        /// acknowledge: the number of the fault, 0 for all.
        pub fault: u32,
        /// Wheel, by index in the robot's description, or side; `u32::MAX` for all.
        pub wheel: u32,
        /// Reserved, zero.
        pub reserved: u32,
        /// Parameters of a disturbance; the last two are reserved, zero.
        pub parameter: [f64; 4],
    }
}

/// What a [`Control`] block asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ControlCommand {
    /// Inject a fault.
    Inject = 1,
    /// Remove a fault.
    Clear = 2,
    /// Somebody knows of a fault: for the supervisor.
    Acknowledge = 3,
    /// Forget faults that are over: for the supervisor.
    Forget = 4,
}

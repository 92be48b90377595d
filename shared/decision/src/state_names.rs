//! Names of states with a meaning of their own, in a decision model of faults.

/// Nothing is wrong.
pub const NOMINAL: &str = "ND";
/// Deviations that no fault model explains.
pub const UNKNOWN: &str = "UNKNOWN";
/// A state X_NEW means the same as X, while evidence still comes. What is in doubt when it ends
/// stays in doubt.
pub const NEW: &str = "_NEW";
/// All named faults that have no state of their own. It may be of none.
pub const FAULT: &str = "FAULT";
/// Two faults or more.
pub const SEVERAL: &str = "SEVERAL";
/// Those of them with which a robot can be driven home.
pub const SEVERAL_DRIVABLE: &str = "SEVERAL_DRIVABLE";
/// After the end of the task. It is never believed: what goes on has not ended.
pub const DONE: &str = "DONE";

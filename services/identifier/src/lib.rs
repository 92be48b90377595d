//! Identifies the fault.

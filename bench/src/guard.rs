//! Does the guard at the graph's border find every kind of bad frame, by its right cause?
//!
//! Faults are injected into a good stream of recorded frames at random phases: what a publisher may
//! send that is wrong ([`faults`]), and what a sensor may say that is wrong ([`sensors`]), which is
//! for the filters to name.

pub mod faults;
pub mod sensors;
pub mod stream;

//! The questions, and what the options of several of them share.

pub mod bits;
pub mod corridors;
pub mod field;
pub mod first_minute;
pub mod ground_change;
pub mod healthy;
pub mod instructions;
pub mod latency;
pub mod missions;
pub mod mutants;
pub mod peers;
pub mod promise;
pub mod real_logs;
pub mod size;
pub mod solver;
pub mod taped_wheels;

//! How long a cycle takes from the instant it was due to the action, under load, and how
//! much of it is the machine's own doing.
//!
//! A *cell* is one rate, load and scheduling policy. In it the floor is measured before and after
//! the graph on the same cores: the same four processes, priorities and block sizes handed over by
//! a bare futex; and a canary on each core says when the machine was late.

pub mod attribution;
pub mod canary;
pub mod cell;
pub mod cycles;
pub mod files;
pub mod flood;
pub mod graph;
pub mod load;
pub mod page;
pub mod system;

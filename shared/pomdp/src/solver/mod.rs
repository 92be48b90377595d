//! A point-based solver: lower and upper bound of the optimal value, and a policy.
//!
//! Of the family of HSVI2 (Smith and Simmons, UAI 2005) and SARSOP (Kurniawati, Hsu and Lee, RSS
//! 2008): walks go from the start belief towards where the bounds are furthest apart, and back up
//! both on the way back. What is not theirs:
//!
//! - the upper bound begins with the tighter informed bound, and its sawtooth stands on the fast
//!   informed bound (`sawtooth`);
//! - beliefs that were reached twice share a node, know which vectors and points they have seen,
//!   and are never valued by the same one twice (`tree`);
//! - from time to time the best plans are tied into controllers and valued exactly (`controller`),
//!   and the expanded beliefs are valued together, then the points and certain states by
//!   themselves (`grid`), so that a discount near 1 does not slow either bound down;
//! - rounds at the edge of the graph (`frontier`) and from certain states (`corners`) have a share
//!   of the work, and all of it where walks go round in circles: a walk follows the most probable
//!   observation again and again, even where what is worth knowing is rare. What matters there
//!   follows from how often a plan visits each belief (`occupancy`);
//! - where part of the state is observed, a belief looks at the points and vectors of its own part
//!   alone; that is found out from the observations (`blocks`);
//! - a small policy is chosen from the vectors (`compact`).
//!
//! The same model and precision give the same vectors, unless time or memory ended the search.

mod alphas;
mod backup;
mod blocks;
mod compact;
mod controller;
mod corners;
mod export;
mod followers;
mod frontier;
mod grid;
mod initial;
mod method;
mod occupancy;
mod point_based;
mod policy_value;
mod prune;
mod report;
mod sawtooth;
mod search;
mod tree;
mod trial;

pub use compact::{Compact, compact};
pub use method::{Answer, Method, MethodError, bound};
pub use point_based::solve;
pub use policy_value::{PolicyValue, policy_value};
pub use report::{Bracket, EndReason, Options, Progress, SearchResult};

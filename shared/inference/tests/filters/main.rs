//! The filters against cases with exact answers.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cases;
mod exact;
mod hierarchy;
mod oracles;

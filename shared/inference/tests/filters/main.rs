//! The filters against cases with exact answers.

#![cfg(test)]

mod cases;
mod exact;
mod hierarchy;
mod hostile;
mod oracles;

//! `vigil-blackbox`.

mod ring;

fn main() {}

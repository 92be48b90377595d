//! Starts, watches, restarts, stops and summarises the graph.
fn main() {}

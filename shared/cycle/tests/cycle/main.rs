//! Tests of stages, sources and the border of a graph, under a virtual clock.

#![cfg(test)]

mod border;
mod hostile;
mod on_miss;
mod virtual_chain;

//! Configuration: schema, reading, validation with precise messages, defaults.
//!
//! [`GraphArgs`] are the command-line options that every program of the graph shares;
//! [`GraphArgs::load`] reads the graph file and the files it names, applies the options, and checks
//! everything before anything starts. All problems are reported at once, each with file, line,
//! key and what is allowed.

mod args;
mod check;
mod load;
mod locate;
mod place;
pub mod schema;
mod solved;

pub use args::{GraphArgs, ServiceArgs};
pub use load::{
    Problem, Setup, SetupError, load_decision, load_graph, load_model, load_robot, load_tree,
};

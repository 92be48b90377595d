#![doc = include_str!("../README.md")]

mod args;
mod border;
mod check;
mod document;
mod fault_name;
pub mod graph_file;
mod hash;
mod load;
mod locate;
mod origin;
mod place;
mod problem;
mod ranges;
mod reference;
mod running;
mod schema;
mod state_risks;

pub use args::{GraphArgs, ServiceArgs};
pub use border::Border;
pub use check::NAME_LENGTH_MAX;
pub use document::Document;
pub use fault_name::fault_name;
pub use load::{Setup, load_decision, load_graph, load_model, load_robot, load_tree};
pub use origin::Origin;
pub use problem::{Problem, SetupError};
pub use ranges::{OutOfRange, Ranges};
pub use reference::{reference, reference_of, robot_reference};
pub use running::{NotRunning, RunningArgs, RunningGraph};
pub use schema::schema;
pub use state_risks::state_risks;

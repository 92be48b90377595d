//! The model of what to do about faults, from a few parameters.
//!
//! States are nominal (`ND`), a leaf of the fault tree or leaves about which the same is done
//! (`STUCK`, `FAULT`), two faults or more (`SEVERAL`, and apart from these `SEVERAL_DRIVABLE`),
//! what nothing explains (`UNKNOWN`), and the end of the task (`DONE`). All but the end come twice:
//! `STUCK_NEW` is the same while evidence of it comes. Rewards are what a healthy robot would not
//! have paid, so that a robot with nothing wrong loses only time.
//!
//! - The task ends with the way: a robot that stands comes no nearer to its end. So the discount
//!   need not stand for it, and may be near 1.
//! - A call for help is one step, however long help takes: it mends everything for its price.
//! - What changes is new, and what is new passes, is joined by another fault, gets a name, or
//!   settles. What is wrong and has settled stays as it is, and nothing more is seen of it. So how
//!   long to wait for evidence is a matter of the model.
//! - The observation of a step is what its evidence speaks for most: the name of a new state, or
//!   `none`; and that it has `settled`. Evidence depends on the action: a robot that stands shows
//!   nothing.
//!
//! [`generate`] writes the model in Cassandra's format.

mod fit;
mod generator;
mod parameters;

pub use fit::fit;
pub use generator::generate;
pub use parameters::{ActionParameters, ParameterError, Parameters};

//! Learning T, Z and the start belief from recorded missions; rewards stay what they are.
//!
//! **The rule** is Baum and Welch's, conditioned on the actions taken. With the scaled forward
//! variables alpha_0 = b0, alpha_{t+1}(s') = Z(a_t,s',z_{t+1}) sum_s alpha_t(s) T(s,a_t,s') /
//! c_{t+1}, and the backward ones beta_t(s) = sum_s' T(s,a_t,s') Z(a_t,s',z_{t+1}) beta_{t+1}(s') /
//! c_{t+1}, the probability of a step is xi_t(s,s') = alpha_t(s) T(s,a_t,s') Z(a_t,s',z_{t+1})
//! beta_{t+1}(s') / c_{t+1}, and the log-likelihood sum ln c_t. Summed over all missions the xi are
//! expected counts N; a new row is theta_i = (N_i + kappa_i) / sum (N + kappa).
//!
//! **The prior** is a model made by hand, worth K visits of each row: kappa = K theta_hand. It
//! keeps the names of the states in their places, keeps rare faults from dying out, and stands for
//! whatever the missions do not show. What it rules out (a 0) stays ruled out; a row that no
//! mission visits stays as it is. What rises from iteration to iteration is
//! sum ln c + sum kappa ln theta; with K = 0 that is the likelihood itself.
//!
//! **States** may be told with a mission, all or some ([`Record::labels`]); then they are facts.
//!
//! [`learn`] does this, from several starts if wished. [`LearnedModel`] says of each row what is
//! data and what is prior, with credible intervals. [`check`] compares what a model predicts with
//! what was measured, and refuses one that is off by more than a fifth.

pub mod check;
mod expectation;
pub mod file;
mod information;
mod layout;
mod learned;
mod learner;
mod record;
mod starts;

pub use expectation::Impossible;
pub use layout::{Row, Table};
pub use learned::{Entry, Iteration, LearnedModel, LearnedRow};
pub use learner::{LearnError, Settings, learn};
pub use record::{Record, RecordError};

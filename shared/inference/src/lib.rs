//! Bayes filters over hybrid models: detection of any deviation from nominal, identification of
//! the fault. No robot, no transport, no clock, no files.
//!
//! **Which filter when.** A model implements [`hybrid::Modes`] and one of [`hybrid::Sampled`] (it
//! can be simulated) and [`hybrid::Conditional`] (linear and Gaussian given the mode, or
//! linearised); every filter then gives a belief over modes by [`filter::Filter::step`]
//! (`examples/own_model.rs` is a whole one).
//!
//! | you have | take | measured |
//! |---|---|---|
//! | no model of the faults | [`ages`] | delay 1.0 to 1.3 of the Lorden bound |
//! | one fault at a time, linear(ised) | [`merged`] | p = 1e-6: none of 138 missed, 0.1 s |
//! | a model to simulate | [`bootstrap`], raised [`proposal`]s | 100 particles miss 0, not 99 % |
//! | the same, faults alike at first | [`hierarchical`], raised | pose, 1e-3: 94 % right, flat 62 |
//! | linear(ised), evidence wanted | [`look_ahead`] | 1000 particles beat 10000 of [`bootstrap`] |
//!
//! The faults missed are those of recorded runs with encoders; the leaves those of simulated runs,
//! 100 particles. By a weak signal alone (a pose) sampled filters fall behind [`merged`].
//!
//! Figures: `docs/results.md`, closed studies. Equal seeds and observations give equal bits; a step
//! allocates nothing; observations that are not finite or that nothing explains are events, never
//! panics.
//!
//! | also here | holds |
//! |---|---|
//! | [`constant`] | the paper's detection: a constant likelihood, and its blind spot |
//! | [`departure`] | a planar robot departing from its nominal motion by an unknown amount |
//! | [`alternative`] | which of several explanations holds, where any may |
//! | [`ending`] | whether a fault that was alarmed is still there |
//! | [`windowed`] | the same on sums over overlapping windows: a smaller blind spot |
//! | [`risk`] | what losing track of a mode costs, for risk-sensitive proposals |
//! | [`resample`], [`weights`], [`adaptive`] | four schemes, log-weights, number of particles |
//! | [`gaussian`], [`track`] | Kalman filter, pose track |
//! | [`slow_state`] | what drifts within a tolerance, as a healthy robot does |
//! | [`outlier`] | measurements of which now and then one is far off |
//! | [`onsets`] | components by the age of their onset, in bounded number |
//! | [`bank`] | exact single faults: one hypothesis per (mode, onset) |
//! | [`logspace`], [`angle`] | probabilities as logarithms, angles on the circle |

pub mod adaptive;
pub mod ages;
pub mod alternative;
pub mod angle;
pub mod bank;
pub mod bootstrap;
pub mod constant;
pub mod departure;
pub mod ending;
pub mod filter;
pub mod gaussian;
pub mod hierarchical;
pub mod hybrid;
pub mod logspace;
pub mod look_ahead;
pub mod merged;
pub mod onsets;
pub mod outlier;
pub mod proposal;
pub mod resample;
pub mod risk;
pub mod size;
pub mod slow_state;
pub mod track;
pub mod weights;
pub mod windowed;

//! A look-ahead Rao-Blackwellised particle filter for linear models whose modes differ by shifts
//! only, on the lanes of [`lanes`](super): every mode of 16 particles is tried in a few cycles.
//!
//! The model, with d' drawn from row d of the transition probabilities:
//!
//! ```text
//! x' = A x + b[d'] + N(0, Q)        z = H x' + h[d'] + N(0, R)        w ~ N(mu[d'], diag sd²)
//! ```
//!
//! A particle is a mode d and a mean m. As A, H, Q and R are the same in all modes, and so is the
//! covariance before the first step, covariance P, gain and the factor L of the innovation's
//! covariance are the same for all particles. They are computed once a step, in double precision,
//! together with the track of one reference `m*`, which moves as the likeliest mode `*` does.
//! Particles are distances `δ = m - m*` from it, which stay small, so that single precision is
//! enough. With `V = L^-1`, `y = V (z - H (A m* + b*) - h*)` and the gain `K = B V`:
//!
//! ```text
//! s[k] = V (H (b[k] - b*) + h[k] - h*)        v = V H A δ        y[δ] = y - v
//! ln [P(k|d) N(z; k, δ)] = ln P(k|d) + y[δ]·s[k] - ½ |s[k]|² + v·(y - ½ v) + ln N(z; *, 0)
//! δ' = (A - B V H A) δ + (b[k] - b*) - B s[k]
//! ```
//!
//! (the second line holds `-½ |y[δ] - s[k]|²` without the large `-½ |y|²`). The measurement of the
//! mode alone, such as wheel rates, is one more term of the same kind that no δ enters.
//!
//! Both drawings of the look-ahead, of the parent by `Σ_k e^l` and of its next mode by `e^l`, are
//! one here: systematic resampling over all pairs of mode and parent, mode by mode. The chance of
//! a pair is the same; a mode has its share of the children within one, and one uniform draw is
//! enough. The belief over modes sums the `e^l`, before anything is drawn.
//!
//! Source: Morales-Menéndez, de Freitas and Poole, *Real-Time Monitoring of Complex Industrial
//! Processes with Particle Filters* (2002). For a model whose matrices depend on the mode see
//! [`look_ahead`](crate::look_ahead); a [`LinearModel`] runs in every other filter too.
//!
//! | file | holds |
//! |---|---|
//! | `model` | the model, checked, and its tables |
//! | `reference` | what all particles share: one Kalman filter |
//! | `kernels` | the passes over modes and particles |
//! | `steps` | the filter |

mod kernels;
mod model;
mod reference;
mod steps;

#[cfg(test)]
mod tests;

pub use model::{LinearModel, LinearParameters, Observation};
pub use steps::LaneLookAhead;

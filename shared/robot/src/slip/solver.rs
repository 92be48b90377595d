//! Damped Newton, and pseudo-transient continuation where Newton fails.

use super::balance::{Balance, MOTOR_SCALE};
use super::{SlipError, UNKNOWNS, Unknowns};

/// Largest residual of a solution, N. Chosen: far below what any sensor shows, and above the
/// rounding error of the sums: 1e-13 N at the rover's 140 N.
const TOLERANCE_N: f64 = 1e-8;
/// Newton steps before the fallback. Chosen: it converges quadratically or
/// not at all, so that more steps find no further solutions.
const NEWTON_MAX: u32 = 25;
/// Halvings of one Newton step. Chosen: a step of 1/256 that is no better points the wrong way.
const HALVINGS_MAX: u32 = 8;
/// Largest Newton step of a body velocity, m/s and rad/s. Chosen: half of the rover's usual speed.
const BODY_STEP_MAX: f64 = 0.1;
/// Largest Newton step of a wheel rate, rad/s. Chosen: about the same at the
/// rim of a wheel.
const RATE_STEP_MAX_RAD_S: f64 = 1.0;
/// Pseudo-transient steps before the situation counts as without equilibrium. Chosen: a step may be
/// twelve times the one before. Smaller gives up where the way is long; larger delays that answer.
const TRANSIENT_MAX: u32 = 40;
/// First pseudo-time step, s. Chosen: a fifth of the body's lag.
const TRANSIENT_STEP_S: f64 = 0.02;
/// Pseudo-time step below which the continuation ends, s. Chosen: it moves nothing any more.
const TRANSIENT_STEP_MIN_S: f64 = 1e-9;
/// Mass kg, mass kg, inertia kg m² of the body, and inertia kg m² of a wheel with its gear, in
/// pseudo-time. They shape the way, not the solution.
const PSEUDO_INERTIA: [f64; 4] = [14.2, 14.2, 1.2, 0.15];

/// Newton from `start`, then from `ideal`, then pseudo-transient continuation from standing and
/// from `ideal`. Returns the unknowns and the iterations of all attempts.
pub(super) fn solve(
    balance: &Balance<'_>,
    start: Option<&Unknowns>,
    ideal: &Unknowns,
) -> Result<(Unknowns, u32), SlipError> {
    let mut total = 0;
    if let Some(start) = start.filter(|start| start.iter().all(|value| value.is_finite())) {
        let found = newton(balance, balance.hold_stuck(start), &mut total);
        if let Some(found) = found {
            return Ok((found, total));
        }
    }
    if let Some(found) = newton(balance, *ideal, &mut total) {
        return Ok((found, total));
    }
    // Where the free wheels can hardly pull the stuck ones the rover all but stands: begin there.
    let mut standing = *ideal;
    standing.fixed_rows_mut::<3>(0).fill(0.0);
    let mut least = f64::INFINITY;
    for start in [standing, *ideal] {
        match transient(balance, start, &mut total) {
            Ok(found) => return Ok((found, total)),
            Err(residual) => least = least.min(residual),
        }
    }
    Err(SlipError::NotConverged {
        iterations: total,
        residual: least,
        allowed: TOLERANCE_N,
    })
}

fn newton(balance: &Balance<'_>, start: Unknowns, total: &mut u32) -> Option<Unknowns> {
    let mut unknowns = start;
    let mut residual = balance.residual(&unknowns);
    for _ in 0..NEWTON_MAX {
        if residual.amax() < TOLERANCE_N {
            return Some(balance.hold_stuck(&unknowns));
        }
        *total += 1;
        let full = balance.jacobian(&unknowns).lu().solve(&-residual)?;
        let mut step = clip(&full);
        let norm = residual.norm();
        let mut better = false;
        for _ in 0..=HALVINGS_MAX {
            let tried = unknowns + step;
            let tried_residual = balance.residual(&tried);
            // A comparison with NaN is false: such a step is never taken.
            if tried_residual.norm() < norm {
                (unknowns, residual, better) = (tried, tried_residual, true);
                break;
            }
            step *= 0.5;
        }
        if !better {
            return None;
        }
    }
    (residual.amax() < TOLERANCE_N).then(|| balance.hold_stuck(&unknowns))
}

/// Keeps a step within the limits, component by component.
fn clip(step: &Unknowns) -> Unknowns {
    let mut clipped = *step;
    for (i, value) in clipped.iter_mut().enumerate() {
        let limit = if i < 3 {
            BODY_STEP_MAX
        } else {
            RATE_STEP_MAX_RAD_S
        };
        *value = value.clamp(-limit, limit);
    }
    clipped
}

/// Implicit pseudo-time steps (M/dt - J) du = f; as dt grows they become Newton's. Returns the
/// residual reached on failure.
fn transient(balance: &Balance<'_>, start: Unknowns, total: &mut u32) -> Result<Unknowns, f64> {
    let mut unknowns = start;
    let mut residual = balance.residual(&unknowns);
    let mut step_s = TRANSIENT_STEP_S;
    for _ in 0..TRANSIENT_MAX {
        if residual.amax() < TOLERANCE_N {
            return Ok(balance.hold_stuck(&unknowns));
        }
        *total += 1;
        let mut system = -balance.jacobian(&unknowns);
        for i in 0..UNKNOWNS {
            let scale = if i < 3 { 1.0 } else { MOTOR_SCALE };
            system[(i, i)] += scale * PSEUDO_INERTIA[i.min(3)] / step_s;
        }
        let Some(change) = system.lu().solve(&residual) else {
            step_s *= 0.25;
            continue;
        };
        let tried = unknowns + change;
        let tried_residual = balance.residual(&tried);
        let (old, new) = (residual.norm(), tried_residual.norm());
        if new.is_finite() && new <= 1.5 * old {
            let gain = (old / new.max(f64::MIN_POSITIVE)).clamp(0.5, 10.0);
            step_s *= 1.2 * gain;
            (unknowns, residual) = (tried, tried_residual);
        } else {
            step_s *= 0.25;
        }
        if step_s < TRANSIENT_STEP_MIN_S {
            break;
        }
    }
    if residual.amax() < TOLERANCE_N {
        return Ok(balance.hold_stuck(&unknowns));
    }
    Err(residual.amax())
}

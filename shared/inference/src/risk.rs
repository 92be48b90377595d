//! The cost of losing track of a mode: the risk of the decision-theoretic filter.
//!
//! Particles either cover a mode (tracked) or do not (lost); the two change into each other with a
//! small probability per step. While tracked, the robot takes the best action; while lost, a
//! mixture of the worst and the average one. The risk of a mode is the difference in cost between
//! lost and tracked (Thrun, Langford and Verma, *Risk Sensitive Particle Filters*, 2001). It
//! follows from the recovery model by value iteration and is not set by hand.

/// The fully observed recovery problem: costs and transitions per action.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovery {
    /// `cost[d][u]`, finite, per step.
    pub cost: Vec<Vec<f64>>,
    /// `transition[u][d][d']`, rows sum to 1.
    pub transition: Vec<Vec<Vec<f64>>>,
    /// Discount per step, 0 to below 1.
    pub discount: f64,
}

/// Change between tracked and lost, and the actions of a lost robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking {
    /// Probability per step that tracked becomes lost, and lost tracked.
    pub flip: f64,
    /// Weight of the worst action while lost, 0 to 1; the rest goes to the mean over actions.
    pub pessimism: f64,
    /// Least risk, above 0.
    pub risk_min: f64,
}

impl Default for Tracking {
    fn default() -> Self {
        Self {
            // Chosen by hand: lost once in 50 steps, half-way between worst and mean action. Only
            // ratios of risks matter, which change little with either. A smaller least risk keeps
            // fewer particles in harmless modes, a larger one takes others away.
            flip: 0.02,
            pessimism: 0.5,
            risk_min: 1e-3,
        }
    }
}

/// Why a recovery model was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RiskError {
    /// The tables do not fit together.
    #[error("{0} does not have one entry per mode and action")]
    Shape(&'static str),
    /// A number is out of range.
    #[error("{quantity}: allowed is {allowed}")]
    Range {
        /// Which.
        quantity: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
}

/// Value iteration ends when no value changes by more than this share of the largest cost: far
/// below any difference of risks that moves a particle.
const TOLERANCE: f64 = 1e-9;
/// Enough for a discount of 0.9998 to reach the tolerance; a bound for those closer to 1.
const ROUNDS_MAX: usize = 100_000;

/// Risk of each mode: `max(V(d, lost) - V(d, tracked), risk_min)`, in units of cost.
///
/// # Errors
/// [`RiskError`] for tables that do not fit, or numbers out of range.
pub fn risk(recovery: &Recovery, tracking: Tracking) -> Result<Vec<f64>, RiskError> {
    check(recovery, tracking)?;
    let (modes, actions) = (recovery.cost.len(), recovery.transition.len());
    let largest = recovery
        .cost
        .iter()
        .flatten()
        .fold(0.0_f64, |m, c| m.max(c.abs()));
    // Values of each mode: lost, tracked.
    let mut values = vec![[0.0_f64; 2]; modes];
    for _ in 0..ROUNDS_MAX {
        let q = |d: usize, tracked: usize, u: usize| {
            let row = recovery.transition[u][d].iter().zip(&values);
            let ahead = row.map(|(p, value)| {
                let (stays, flips) = (value[tracked], value[1 - tracked]);
                p * ((1.0 - tracking.flip) * stays + tracking.flip * flips)
            });
            recovery.cost[d][u] + recovery.discount * ahead.sum::<f64>()
        };
        let back_up = |d: usize| {
            let lost = (0..actions).map(|u| q(d, 0, u));
            let worst = lost.clone().fold(f64::NEG_INFINITY, f64::max);
            let mean = lost.sum::<f64>() / actions as f64;
            let best = (0..actions)
                .map(|u| q(d, 1, u))
                .fold(f64::INFINITY, f64::min);
            [
                tracking.pessimism * worst + (1.0 - tracking.pessimism) * mean,
                best,
            ]
        };
        let next: Vec<[f64; 2]> = (0..modes).map(back_up).collect();
        let pairs = next.iter().flatten().zip(values.iter().flatten());
        let change = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        values = next;
        if change <= TOLERANCE * largest {
            break;
        }
    }
    let difference = values.iter().map(|[lost, tracked]| lost - tracked);
    Ok(difference.map(|r| r.max(tracking.risk_min)).collect())
}

/// Scales the risks of faults down so far that, with the belief `p`, the nominal mode 0 keeps
/// `nominal_min` of `count` particles: `Σ_k p_k r_k <= p_0 r_0 (count / nominal_min - 1)` over the
/// faults k. Their ratios stay.
pub fn bound(risk: &mut [f64], p: &[f64], count: usize, nominal_min: f64) {
    let (Some(&nominal), Some(&p_nominal)) = (risk.first(), p.first()) else {
        return;
    };
    let room = p_nominal * nominal * (count as f64 / nominal_min - 1.0).max(0.0);
    let faults: f64 = risk.iter().zip(p).skip(1).map(|(r, p)| r * p).sum();
    if faults > room && faults > 0.0 {
        for r in risk.iter_mut().skip(1) {
            *r = (*r * room / faults).max(f64::MIN_POSITIVE);
        }
    }
}

fn check(recovery: &Recovery, tracking: Tracking) -> Result<(), RiskError> {
    let (modes, actions) = (recovery.cost.len(), recovery.transition.len());
    let range = |quantity, allowed, fine: bool| {
        if fine {
            Ok(())
        } else {
            Err(RiskError::Range { quantity, allowed })
        }
    };
    let fits = |rows: &[Vec<f64>], width: usize| rows.iter().all(|row| row.len() == width);
    if modes == 0 || actions == 0 || !fits(&recovery.cost, actions) {
        return Err(RiskError::Shape("cost"));
    }
    let transition = &recovery.transition;
    if transition
        .iter()
        .any(|rows| rows.len() != modes || !fits(rows, modes))
    {
        return Err(RiskError::Shape("transition"));
    }
    let finite = recovery.cost.iter().flatten().all(|c| c.is_finite());
    range("cost", "any finite number", finite)?;
    let sums_to_one = |row: &Vec<f64>| {
        row.iter().all(|p| (0.0..=1.0).contains(p)) && (row.iter().sum::<f64>() - 1.0).abs() < 1e-6
    };
    let stochastic = transition.iter().flatten().all(sums_to_one);
    range("transition", "rows that sum to 1", stochastic)?;
    range(
        "discount",
        "0 to below 1",
        (0.0..1.0).contains(&recovery.discount),
    )?;
    range("flip", "0 to 1", (0.0..=1.0).contains(&tracking.flip))?;
    range(
        "pessimism",
        "0 to 1",
        (0.0..=1.0).contains(&tracking.pessimism),
    )?;
    let positive = tracking.risk_min.is_finite() && tracking.risk_min > 0.0;
    range("risk_min", "any finite number above 0", positive)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mode 0 is harmless; in mode 1 the right action costs 1, the wrong one 9. No mode changes.
    fn recovery() -> Recovery {
        let still = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
        Recovery {
            cost: vec![vec![0.0, 0.0], vec![1.0, 9.0]],
            transition: vec![still.clone(), still],
            discount: 0.5,
        }
    }

    #[test]
    fn without_flips_the_risk_is_the_discounted_extra_cost() {
        let tracking = Tracking {
            flip: 0.0,
            pessimism: 0.0,
            risk_min: 1e-3,
        };
        // Lost: mean cost 5 per step, tracked 1; over 1 / (1 - 0.5) steps: 8 more.
        let found = risk(&recovery(), tracking).unwrap();
        assert!(
            (found[1] - 8.0).abs() < 1e-6 && found[0] == 1e-3,
            "{found:?}"
        );
        let pessimist = Tracking {
            pessimism: 1.0,
            ..tracking
        };
        assert!((risk(&recovery(), pessimist).unwrap()[1] - 16.0).abs() < 1e-6);
    }

    #[test]
    fn flips_pull_lost_and_tracked_together() {
        // x = V(lost) - V(tracked) solves x = 4 + 0.5 (1 - 2 flip) x.
        let tracking = Tracking {
            flip: 0.1,
            pessimism: 0.0,
            risk_min: 1e-3,
        };
        let found = risk(&recovery(), tracking).unwrap()[1];
        assert!((found - 4.0 / (1.0 - 0.5 * 0.8)).abs() < 1e-6, "{found}");
    }

    #[test]
    fn bounded_risks_leave_the_nominal_mode_its_particles() {
        let (mut risk, p) = ([1.0, 1e6, 10.0], [0.998, 0.001, 0.001]);
        bound(&mut risk, &p, 1000, 50.0);
        let faults = risk[1] * p[1] + risk[2] * p[2];
        assert!((faults - 0.998 * 19.0).abs() < 1e-9);
        assert!((risk[1] / risk[2] - 1e5).abs() < 1e-3, "ratios stay");
        let mut low = [1.0, 2.0, 3.0];
        bound(&mut low, &p, 1000, 50.0);
        assert_eq!(low, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut bad = recovery();
        bad.cost[1].pop();
        assert_eq!(
            risk(&bad, Tracking::default()),
            Err(RiskError::Shape("cost"))
        );
        let mut bad = recovery();
        bad.transition[0][1] = vec![0.7, 0.7];
        assert!(risk(&bad, Tracking::default()).is_err());
        let mut bad = recovery();
        bad.discount = 1.0;
        assert!(risk(&bad, Tracking::default()).is_err());
    }
}

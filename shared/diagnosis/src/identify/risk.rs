//! Risk of losing track of a mode, from the recovery model.

use vigil_inference::risk::{self, Recovery, Tracking};
use vigil_pomdp::Pomdp;

use crate::identify::leaf_map::IdentifierError;

/// Particles that the nominal mode keeps, whatever the risks. Their mean is known within 14 % of a
/// deviation.
const NOMINAL_MIN: f64 = 50.0;

/// Risk of each mode, given its name among the states of the decision model and its probability
/// before the data speak; mode 0 is nominal. Risks are bounded to what `count` particles can carry.
///
/// # Errors
/// [`IdentifierError::Build`] if the decision model lacks a state.
pub fn risks(
    decision: &Pomdp,
    modes: &[(&str, f64)],
    count: usize,
) -> Result<Vec<f64>, IdentifierError> {
    let states = decision.states();
    let (n, actions) = (states.len(), decision.actions().len());
    let row = |state, action| {
        let mut row = vec![0.0; n];
        for &(to, p) in decision.successors(state, action) {
            row[to] += p;
        }
        row
    };
    let cost = |state| {
        (0..actions)
            .map(|action| -decision.reward(state, action))
            .collect()
    };
    let recovery = Recovery {
        cost: (0..n).map(cost).collect(),
        transition: (0..actions)
            .map(|action| (0..n).map(|state| row(state, action)).collect())
            .collect(),
        discount: decision.discount(),
    };
    let by_state = risk::risk(&recovery, Tracking::default())
        .map_err(|error| IdentifierError::Build(format!("risks: {error}")))?;
    let of = |name: &str| {
        let state = states.iter().position(|state| state == name);
        let missing =
            || IdentifierError::Build(format!("the decision model has no state '{name}'"));
        state.map(|state| by_state[state]).ok_or_else(missing)
    };
    let risks: Result<Vec<f64>, _> = modes.iter().map(|(name, _)| of(name)).collect();
    let mut risks = risks?;
    let p: Vec<f64> = modes.iter().map(|(_, p)| *p).collect();
    risk::bound(&mut risks, &p, count, NOMINAL_MIN.min(0.5 * count as f64));
    Ok(risks)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: &str = "discount: 0.5\nvalues: reward\nstates: ND A\nactions: go fix\n\
        observations: none\nT: * identity\nO: * : * : none 1\n\
        R: go : ND : * : * 1\nR: fix : ND : * : * 0\nR: go : A : * : * -9\nR: fix : A : * : * -1\n";

    #[test]
    fn the_risk_is_what_being_lost_costs_more() {
        let decision = Pomdp::parse(MODEL).unwrap();
        let found = risks(&decision, &[("ND", 0.999), ("A", 0.001)], 1000).unwrap();
        // Modes do not change, so x = V(lost) - V(tracked) solves x = c + 0.5 (1 - 2 · 0.02) x with
        // the extra cost c of half the worst and half the mean action over the best: in ND
        // (1 + 1/2) / 2, in A (8 + 4) / 2.
        for (risk, extra) in found.iter().zip([0.75, 6.0]) {
            assert!(
                (risk - extra / (1.0 - 0.5 * 0.96)).abs() < 1e-6,
                "{found:?}"
            );
        }
        assert!(risks(&decision, &[("B", 1.0)], 10).is_err());
        let few = risks(&decision, &[("ND", 0.5), ("A", 0.5)], 64).unwrap();
        assert!(few[1] < found[1], "{few:?}");
    }
}

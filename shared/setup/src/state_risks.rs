//! What faults cost, from the decision model, as numbers for the risk-sensitive identifier.

use vigil_diagnosis::identify::StateRisks;
use vigil_inference::risk::{self, Recovery, RiskError, Tracking};
use vigil_pomdp::Pomdp;

/// The risk of losing track of each state of a decision model.
///
/// # Errors
/// [`RiskError`] if the values of recovery cannot be found.
pub fn state_risks(decision: &Pomdp) -> Result<StateRisks, RiskError> {
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
    Ok(StateRisks {
        states: states.to_vec(),
        risks: risk::risk(&recovery, Tracking::default())?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: &str = "discount: 0.5\nvalues: reward\nstates: ND A\nactions: go fix\n\
        observations: none\nT: * identity\nO: * : * : none 1\n\
        R: go : ND : * : * 1\nR: fix : ND : * : * 0\nR: go : A : * : * -9\nR: fix : A : * : * -1\n";

    #[test]
    fn the_risk_is_what_being_lost_costs_more() {
        let found = state_risks(&Pomdp::parse(MODEL).unwrap()).unwrap();
        assert_eq!(found.states, ["ND", "A"]);
        // Modes do not change, so x = V(lost) - V(tracked) solves x = c + 0.5 (1 - 2 · 0.02) x with
        // the extra cost c of half the worst and half the mean action over the best: in ND
        // (1 + 1/2) / 2, in A (8 + 4) / 2.
        for (risk, extra) in found.risks.iter().zip([0.75, 6.0]) {
            let exact = extra / (1.0 - 0.5 * 0.96);
            assert!((risk - exact).abs() < 1e-6, "{found:?}");
        }
    }
}

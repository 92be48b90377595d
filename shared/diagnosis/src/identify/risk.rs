//! Risk of losing track of a mode.

use vigil_inference::risk;

use crate::identify::leaf_map::IdentifierError;

/// Particles that the nominal mode keeps, whatever the risks. Chosen: their mean is known within
/// 14 % of a deviation, the root of 1/50.
const NOMINAL_MIN: f64 = 50.0;

/// What it costs to lose track of each state of a decision model.
#[derive(Debug, Clone, PartialEq)]
pub struct StateRisks {
    /// Names of the states.
    pub states: Vec<String>,
    /// Extra cost of each, in the model's unit of reward; at least 0.
    pub risks: Vec<f64>,
}

/// Risk of each mode, given the names of the states that it may belong to and its probability
/// before the data speak; mode 0 is nominal. Risks are bounded to what `count` particles can carry.
///
/// # Errors
/// [`IdentifierError::Build`] if a mode has no state.
pub(crate) fn risks(
    by_state: &StateRisks,
    modes: &[(Vec<String>, f64)],
    count: usize,
) -> Result<Vec<f64>, IdentifierError> {
    let of_state = |names: &Vec<String>| {
        let state = |name: &String| by_state.states.iter().position(|state| state == name);
        let risk = names
            .iter()
            .find_map(state)
            .and_then(|state| by_state.risks.get(state));
        let missing = || {
            let names = names.join("', '");
            IdentifierError::Build(format!("the decision model has no state '{names}'"))
        };
        risk.copied().ok_or_else(missing)
    };
    let risks: Result<Vec<f64>, _> = modes.iter().map(|(names, _)| of_state(names)).collect();
    let mut risks = risks?;
    let p: Vec<f64> = modes.iter().map(|(_, p)| *p).collect();
    risk::bound(&mut risks, &p, count, NOMINAL_MIN.min(0.5 * count as f64));
    Ok(risks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_has_the_risk_of_its_state_within_what_the_particles_carry() {
        let by_state = StateRisks {
            states: vec!["ND".to_owned(), "A".to_owned()],
            risks: vec![1.5, 12.0],
        };
        let mode = |names: &[&str], p| {
            let names = names.iter().map(|name| (*name).to_owned());
            (names.collect::<Vec<String>>(), p)
        };
        let of = |modes: &[(Vec<String>, f64)], count| risks(&by_state, modes, count);
        let found = of(&[mode(&["ND"], 0.999), mode(&["A1", "A"], 0.001)], 1000);
        assert_eq!(found.unwrap(), [1.5, 12.0]);
        assert!(of(&[mode(&["B", "C"], 1.0)], 10).is_err());
        let few = of(&[mode(&["ND"], 0.5), mode(&["A"], 0.5)], 64).unwrap();
        assert!(few[1] < 12.0, "{few:?}");
    }
}

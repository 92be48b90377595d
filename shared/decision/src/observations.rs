//! From a set of symptoms and outcomes to an observation of the decision model, by name.

use vigil_blocks::Symptoms;
use vigil_pomdp::Pomdp;

use crate::error::SupervisorError;

/// Name of the empty set.
const NONE: &str = "none";

/// The observation for each set.
#[derive(Debug, Clone)]
pub(crate) struct Observations {
    index: [Option<usize>; Symptoms::ALL as usize + 1],
}

impl Observations {
    /// Of a model all of whose observations are sets.
    pub(crate) fn new(model: &Pomdp) -> Result<Self, SupervisorError> {
        let mut index = [None; Symptoms::ALL as usize + 1];
        for (z, name) in model.observations().iter().enumerate() {
            let set = set_of(name).ok_or_else(|| SupervisorError::NoSet(name.clone()))?;
            if let Some(twice) = index[set as usize].replace(z) {
                let other = model.observations()[twice].clone();
                return Err(SupervisorError::SameSet(name.clone(), other));
            }
        }
        for (basic, bit) in [(NONE, 0)].iter().chain(&Symptoms::NAMED) {
            if index[*bit as usize].is_none() {
                return Err(SupervisorError::NoObservation(basic));
            }
        }
        Ok(Self { index })
    }

    /// The model's observation; `None` if the model has none for this set.
    pub(crate) fn index(&self, set: u32) -> Option<usize> {
        self.index.get(set as usize).copied().flatten()
    }
}

/// Bits of a set by its name: its symptoms, joined by `_` in any order.
fn set_of(name: &str) -> Option<u32> {
    if name == NONE {
        return Some(0);
    }
    name.split('_').try_fold(0, |set, part| {
        let (_, bit) = Symptoms::NAMED.iter().find(|(basic, _)| *basic == part)?;
        (set & bit == 0).then_some(set | bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_named_by_its_symptoms_in_any_order_each_once() {
        assert_eq!(set_of("none"), Some(0));
        assert_eq!(set_of("EPM"), Some(Symptoms::EPM));
        for name in ["EPM_LD", "LD_EPM"] {
            assert_eq!(set_of(name), Some(Symptoms::EPM | Symptoms::LD));
        }
        for name in ["EPM_EPM", "EPM_", "", "epm", "none_EPM"] {
            assert_eq!(set_of(name), None, "{name}");
        }
    }
}

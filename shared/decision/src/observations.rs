//! From a set of symptoms and outcomes to an observation of the decision model, by name.

use std::collections::BTreeMap;

use vigil_blocks::Symptoms;
use vigil_pomdp::Pomdp;

use crate::epoch::SymptomKinds;
use crate::error::SupervisorError;
use crate::settings::OwnSymptom;

/// Name of the empty set.
const NONE: &str = "none";
/// An outcome of this probability is expected; what is less may be a floor against zeros.
const EXPECTED: f64 = 0.05;

/// The observation for each set of symptoms that the model knows.
#[derive(Debug, Clone)]
pub(crate) struct Observations {
    /// Sets, in order, and their observations.
    sets: Vec<(u32, usize)>,
    /// The symptoms that occur in any.
    known: u32,
}

impl Observations {
    /// Of a model all of whose observations are sets; `own` are symptoms beside the usual ones.
    ///
    /// # Errors
    /// [`SupervisorError`] naming what is no set, is there twice, or is missing.
    pub(crate) fn new(
        model: &Pomdp,
        own: &BTreeMap<String, OwnSymptom>,
    ) -> Result<Self, SupervisorError> {
        let own = own.iter().map(|(name, of)| (name.as_str(), of.set()));
        let named: Vec<(&str, u32)> = Symptoms::NAMED.into_iter().chain(own).collect();
        let mut sets: Vec<(u32, usize)> = Vec::new();
        for (z, name) in model.observations().iter().enumerate() {
            let set = set_of(name, &named).ok_or_else(|| SupervisorError::NoSet {
                found: name.clone(),
                allowed: named
                    .iter()
                    .map(|(name, _)| *name)
                    .collect::<Vec<_>>()
                    .join(", "),
            })?;
            if let Some((_, twice)) = sets.iter().find(|(other, _)| *other == set) {
                let other = model.observations()[*twice].clone();
                return Err(SupervisorError::SameSet(name.clone(), other));
            }
            sets.push((set, z));
        }
        let known = sets.iter().fold(0, |known, (set, _)| known | set);
        let is_alone = |bit: u32| sets.iter().any(|(set, _)| *set == bit);
        for (name, bit) in [(NONE, 0)].iter().chain(&named) {
            if known & bit == *bit && !is_alone(*bit) {
                return Err(SupervisorError::NoObservation((*name).to_owned()));
            }
            if known & bit != *bit && !Symptoms::NAMED.contains(&(*name, *bit)) {
                return Err(SupervisorError::ForeignSymptom((*name).to_owned()));
            }
        }
        sets.sort_unstable();
        Ok(Self { sets, known })
    }

    /// The model's observation; `None` if the model has none for this set. Symptoms that the model
    /// does not know are left out.
    pub(crate) fn index(&self, set: u32) -> Option<usize> {
        let known = set & self.known;
        let at = self.sets.binary_search_by_key(&known, |(set, _)| *set);
        at.ok().map(|at| self.sets[at].1)
    }
}

/// For each action of a model whose observations are sets of symptoms: whether the model expects an
/// outcome symptom of it, in some state with a probability of a twentieth or more. Then the model
/// knows what it says that none came, too.
///
/// # Errors
/// [`SupervisorError`] for an observation that is no set.
pub fn actions_with_outcome(
    model: &Pomdp,
    own: &BTreeMap<String, OwnSymptom>,
) -> Result<Vec<bool>, SupervisorError> {
    let (observations, outcomes) = (
        Observations::new(model, own)?,
        SymptomKinds::new(own).outcomes,
    );
    let expects = |action: usize| {
        let mut told = observations
            .sets
            .iter()
            .filter(|(set, _)| set & outcomes != 0);
        told.any(|(_, z)| model.likelihood(action, *z).iter().any(|p| *p >= EXPECTED))
    };
    Ok((0..model.actions().len()).map(expects).collect())
}

/// Bits of a set by its name: its symptoms, joined by `_` in any order.
fn set_of(name: &str, named: &[(&str, u32)]) -> Option<u32> {
    if name == NONE {
        return Some(0);
    }
    name.split('_').try_fold(0, |set, part| {
        let (_, bit) = named.iter().find(|(basic, _)| *basic == part)?;
        (set & bit == 0).then_some(set | bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_named_by_its_symptoms_in_any_order_each_once() {
        let set_of = |name| set_of(name, &[("EPM", 2), ("LD", 4), ("DOOR", 1 << 9)]);
        assert_eq!(set_of("none"), Some(0));
        assert_eq!(set_of("EPM"), Some(Symptoms::EPM));
        assert_eq!(set_of("DOOR_LD"), Some(1 << 9 | Symptoms::LD));
        for name in ["EPM_LD", "LD_EPM"] {
            assert_eq!(set_of(name), Some(Symptoms::EPM | Symptoms::LD));
        }
        for name in ["EPM_EPM", "EPM_", "", "epm", "none_EPM"] {
            assert_eq!(set_of(name), None, "{name}");
        }
    }
}

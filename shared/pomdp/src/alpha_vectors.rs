//! Vectors over states, each with the action that its plan begins with: a policy, and a lower
//! bound of what it earns.

/// Why vectors do not make a policy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VectorError {
    /// None at all.
    #[error("no vector: allowed is at least one")]
    None,
    /// A vector of the wrong length.
    #[error("vector {vector} has {found} values, allowed are {states}, one a state")]
    Length {
        /// Its index.
        vector: usize,
        /// Its length.
        found: usize,
        /// States of the model.
        states: usize,
    },
    /// An action that the model does not have.
    #[error("vector {vector} begins with action {found}, allowed are 0 to {max}")]
    Action {
        /// Its index.
        vector: usize,
        /// Its action.
        found: usize,
        /// The last action of the model.
        max: usize,
    },
    /// A value that is not finite.
    #[error("vector {vector} has the value {value} for state {state}, allowed are finite numbers")]
    Value {
        /// Its index.
        vector: usize,
        /// The state.
        state: usize,
        /// The value.
        value: f64,
    },
}

/// At least one vector, each of one value a state: discounted reward to come, in units of reward.
/// Values are finite.
#[derive(Debug, Clone, PartialEq)]
pub struct AlphaVectors {
    states: usize,
    actions: Vec<usize>,
    values: Vec<f64>,
}

impl AlphaVectors {
    /// Vectors (action, value of each state) of a model with so many states and actions.
    ///
    /// # Errors
    /// [`VectorError`] for none at all, a wrong length, an unknown action, a value that is not
    /// finite.
    pub fn new<V: AsRef<[f64]>>(
        states: usize,
        action_count: usize,
        vectors: impl IntoIterator<Item = (usize, V)>,
    ) -> Result<Self, VectorError> {
        let (mut actions, mut all) = (Vec::new(), Vec::new());
        for (vector, (action, values)) in vectors.into_iter().enumerate() {
            let values = values.as_ref();
            if values.len() != states {
                let found = values.len();
                return Err(VectorError::Length {
                    vector,
                    found,
                    states,
                });
            }
            if action >= action_count {
                return Err(VectorError::Action {
                    vector,
                    found: action,
                    max: action_count.saturating_sub(1),
                });
            }
            let wrong = values.iter().enumerate().find(|(_, v)| !v.is_finite());
            if let Some((state, &value)) = wrong {
                return Err(VectorError::Value {
                    vector,
                    state,
                    value,
                });
            }
            actions.push(action);
            all.extend_from_slice(values);
        }
        if actions.is_empty() || states == 0 {
            return Err(VectorError::None);
        }
        Ok(Self {
            states,
            actions,
            values: all,
        })
    }

    /// How many vectors.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.actions.len()
    }

    /// Never true.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }

    /// Length of every vector.
    #[must_use]
    pub const fn states(&self) -> usize {
        self.states
    }

    /// (action, value of each state) of every vector.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = (usize, &[f64])> {
        let values = self.values.chunks(self.states);
        self.actions.iter().copied().zip(values)
    }

    /// The largest alpha·b: at least this is earned from here on. `belief` has one probability a
    /// state.
    #[must_use]
    pub fn value(&self, belief: &[f64]) -> f64 {
        self.rows()
            .map(|(_, alpha)| alpha.iter().zip(belief).map(|(v, b)| v * b).sum())
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

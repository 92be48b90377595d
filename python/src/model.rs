//! Models.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use vigil_pomdp::Pomdp;

use crate::errors::{file_refusal, parse_refusal};
use crate::names::Key;
use crate::tables::Tables;

/// A decision model that does not change: names, probabilities, rewards, discount.
#[pyclass(frozen, eq, module = "vigil_pomdp", from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Model {
    pub pomdp: Arc<Pomdp>,
}

impl Model {
    fn read(py: Python<'_>, text: &str) -> PyResult<Self> {
        let is_xml = text.trim_start().starts_with('<');
        let parse = || match is_xml {
            true => Pomdp::parse_pomdpx(text),
            false => Pomdp::parse(text),
        };
        let pomdp = py.detach(parse).map_err(|e| parse_refusal(py, &e))?;
        Ok(Self {
            pomdp: Arc::new(pomdp),
        })
    }

    fn state(&self, key: &Key) -> PyResult<usize> {
        key.index("state", self.pomdp.states())
    }

    pub fn action(&self, key: &Key) -> PyResult<usize> {
        key.index("action", self.pomdp.actions())
    }

    pub fn observation(&self, key: &Key) -> PyResult<usize> {
        key.index("observation", self.pomdp.observations())
    }
}

#[pymethods]
impl Model {
    /// The model in a text: Cassandra's .pomdp format, or APPL's .pomdpx if it begins with `<`.
    ///
    /// Raises ParseError with line and column.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Self> {
        Self::read(py, text)
    }

    /// The model in a file; see `parse`.
    ///
    /// Raises OSError, ParseError.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text = std::fs::read_to_string(&path).map_err(|e| file_refusal(&path, &e))?;
        Self::read(py, &text)
    }

    /// The model of nested sequences, such as lists or numpy arrays, the action first in each.
    ///
    /// transitions[a][s][t] is the probability of state t after action a in s, and
    /// observations[a][t][z] that of observation z in t after a; None if the model is an MDP.
    /// rewards[a][s] is the expected reward of a in s. start[s] is the start belief; None is
    /// uniform. Without names they are s0, a0, z0 and so on.
    ///
    /// Raises PomdpError for shapes that do not agree and for what is no distribution.
    #[staticmethod]
    #[pyo3(signature = (transitions, observations, rewards, *, discount, start=None,
        state_names=None, action_names=None, observation_names=None))]
    #[allow(clippy::too_many_arguments)] // Keywords of Python.
    fn from_arrays(
        transitions: Vec<Vec<Vec<f64>>>,
        observations: Option<Vec<Vec<Vec<f64>>>>,
        rewards: Vec<Vec<f64>>,
        discount: f64,
        start: Option<Vec<f64>>,
        state_names: Option<Vec<String>>,
        action_names: Option<Vec<String>>,
        observation_names: Option<Vec<String>>,
    ) -> PyResult<Self> {
        let tables = Tables {
            discount,
            transitions,
            observations,
            rewards,
            start,
            state_names,
            action_names,
            observation_names,
        };
        Ok(Self {
            pomdp: Arc::new(tables.model()?),
        })
    }

    /// Names of the states.
    #[getter]
    fn states(&self) -> &[String] {
        self.pomdp.states()
    }

    /// Names of the actions.
    #[getter]
    fn actions(&self) -> &[String] {
        self.pomdp.actions()
    }

    /// Names of the observations; `none` alone for a model without any.
    #[getter]
    fn observations(&self) -> &[String] {
        self.pomdp.observations()
    }

    /// Discount per step, 0 to 1.
    #[getter]
    fn discount(&self) -> f64 {
        self.pomdp.discount()
    }

    /// The start belief, one probability a state.
    #[getter]
    fn start(&self) -> Vec<f64> {
        self.pomdp.start().to_vec()
    }

    /// True if the text states costs; rewards and values here are their negatives.
    #[getter]
    fn is_cost(&self) -> bool {
        self.pomdp.is_cost()
    }

    /// What the author of the text may want to mend, with its place.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let warnings = self.pomdp.warnings().iter();
        warnings
            .map(|w| format!("{}: {}", w.at, w.message))
            .collect()
    }

    /// T(s,a,.): (index, probability) of each state that may follow.
    fn successors(&self, state: Key, action: Key) -> PyResult<Vec<(usize, f64)>> {
        let (state, action) = (self.state(&state)?, self.action(&action)?);
        Ok(self.pomdp.successors(state, action).to_vec())
    }

    /// Z(a,.,z): the probability of the observation in each state that the action may lead to.
    fn likelihood(&self, action: Key, observation: Key) -> PyResult<Vec<f64>> {
        let (action, observation) = (self.action(&action)?, self.observation(&observation)?);
        Ok(self.pomdp.likelihood(action, observation).to_vec())
    }

    /// R(s,a), expected; costs count negative.
    fn reward(&self, state: Key, action: Key) -> PyResult<f64> {
        let (state, action) = (self.state(&state)?, self.action(&action)?);
        Ok(self.pomdp.reward(state, action))
    }

    /// The model as a .pomdp text; `parse` makes the same model of it, bit by bit.
    fn to_text(&self, py: Python<'_>) -> String {
        py.detach(|| self.pomdp.to_cassandra())
    }

    /// Models are pickled as their texts.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = slf.get().to_text(slf.py());
        Ok((slf.get_type().getattr("parse")?, (text,)))
    }

    fn __hash__(&self) -> u64 {
        self.pomdp.hash()
    }

    fn __repr__(&self) -> String {
        format!(
            "<Model: {} states, {} actions, {} observations, discount {}>",
            self.pomdp.states().len(),
            self.pomdp.actions().len(),
            self.pomdp.observations().len(),
            self.pomdp.discount()
        )
    }
}

//! Policies.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use vigil_pomdp::Decider;
use vigil_pomdp::policy_file::{PolicyFile, alpha, appl};
use vigil_pomdp::{AlphaVectors, PointBased, Pomdp, mdp};

use crate::errors::{file_refusal, refusal};
use crate::model::Model;
use crate::tracker::Belief;

/// A policy that was solved beforehand.
#[derive(Clone)]
pub struct Solved {
    pub vectors: AlphaVectors,
    pub method: String,
    pub lower: Option<f64>,
    pub upper: Option<f64>,
    /// Processor time that it took, s.
    pub cpu_s: f64,
}

/// From a belief to an action. `solve`, `heuristic`, `compact` and `Policy.load` make policies.
#[pyclass(frozen, module = "vigil_pomdp")]
pub struct Policy {
    pub model: Model,
    pub name: String,
    /// True if it remembers earlier decisions.
    pub has_memory: bool,
    /// None for a heuristic.
    pub solved: Option<Solved>,
    decider: Mutex<Decider>,
}

impl Policy {
    /// A policy that follows from the model alone.
    pub fn heuristic(model: Model, name: String, has_memory: bool, decider: Decider) -> Self {
        Self {
            model,
            name,
            has_memory,
            solved: None,
            decider: Mutex::new(decider),
        }
    }

    /// A policy of vectors.
    pub fn solved(model: Model, solved: Solved) -> PyResult<Self> {
        let policy = PointBased::new(&model.pomdp, &solved.vectors).map_err(refusal)?;
        let relaxed = mdp::solve(&model.pomdp).map_err(refusal)?;
        let decider = Decider::new(Box::new(policy), &model.pomdp, &relaxed);
        Ok(Self {
            model,
            name: solved.method.clone(),
            has_memory: false,
            solved: Some(solved),
            decider: Mutex::new(decider),
        })
    }

    /// Does something with what decides. Called without Python's lock.
    pub fn with_decider<T>(&self, act: impl FnOnce(&mut Decider) -> T) -> T {
        // What was left by a panic is reset before each mission.
        act(&mut self.decider.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn decide(&self, py: Python<'_>, belief: Belief<'_>) -> PyResult<(usize, Vec<f64>)> {
        let belief = belief.values(&self.model.pomdp)?;
        let guard = self.decider.lock_py_attached(py);
        let mut decider = guard.unwrap_or_else(PoisonError::into_inner);
        let action = decider.decide(&belief).action;
        Ok((action, decider.values().to_vec()))
    }

    /// What was solved.
    pub fn solved_or_refusal(&self) -> PyResult<&Solved> {
        let missing = || refusal(format!("{} follows from the model: no vectors", self.name));
        self.solved.as_ref().ok_or_else(missing)
    }

    fn bytes(&self, extension: &str) -> PyResult<Vec<u8>> {
        let solved = self.solved_or_refusal()?;
        match extension {
            "policy" => Ok(appl::write(&solved.vectors, "model").into_bytes()),
            "alpha" => Ok(alpha::write(&solved.vectors).into_bytes()),
            _ => {
                let unknown = || refusal("no lower bound is known: allowed are .policy and .alpha");
                let file = PolicyFile {
                    model_hash: self.model.pomdp.hash(),
                    discount: self.model.pomdp.discount(),
                    method: solved.method.clone(),
                    lower: solved.lower.ok_or_else(unknown)?,
                    upper: solved.upper,
                    cpu_s: solved.cpu_s,
                    vectors: solved.vectors.clone(),
                };
                file.write(&self.model.pomdp).map_err(refusal)
            }
        }
    }
}

/// A policy in any of the formats.
fn read(bytes: &[u8], model: &Pomdp) -> PyResult<Solved> {
    let text = String::from_utf8_lossy(bytes);
    let foreign = |method: &str, vectors| Solved {
        vectors,
        method: method.to_owned(),
        lower: None,
        upper: None,
        cpu_s: 0.0,
    };
    if text.trim_start().starts_with('<') {
        let vectors = appl::read(&text, model).map_err(refusal)?;
        return Ok(foreign("appl", vectors));
    }
    if !text.trim_start().starts_with('{') {
        let vectors = alpha::read(&text, model).map_err(refusal)?;
        return Ok(foreign("alpha", vectors));
    }
    let file = PolicyFile::read(bytes, model).map_err(refusal)?;
    Ok(Solved {
        vectors: file.vectors,
        method: file.method,
        lower: Some(file.lower),
        upper: file.upper,
        cpu_s: file.cpu_s,
    })
}

#[pymethods]
impl Policy {
    /// Reads a policy of the model from a file: Vigil's, APPL's .policy or pomdp-solve's .alpha.
    ///
    /// Vigil's files know their model, and another model's is refused; the others do not.
    /// Raises OSError, PomdpError.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, model: Model) -> PyResult<Self> {
        let bytes = std::fs::read(&path).map_err(|e| file_refusal(&path, &e))?;
        py.detach(|| Self::solved(model.clone(), read(&bytes, &model.pomdp)?))
    }

    /// Writes the policy. The name of the file decides the format: .policy is APPL's, .alpha is
    /// pomdp-solve's, any other is Vigil's own, which knows its model and its bounds.
    ///
    /// Raises OSError, and PomdpError for a heuristic, which has no vectors.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let extension = path.extension().and_then(|name| name.to_str());
        let bytes = self.bytes(extension.unwrap_or_default())?;
        std::fs::write(&path, bytes).map_err(|e| file_refusal(&path, &e))
    }

    /// The action for a belief: a Tracker, or one probability a state. Ties within 1e-9 go to the
    /// action that most of the belief votes for, then to the lowest index.
    fn action(&self, py: Python<'_>, belief: Belief<'_>) -> PyResult<String> {
        let (action, _) = self.decide(py, belief)?;
        Ok(self.model.pomdp.actions()[action].clone())
    }

    /// What the action was chosen by, one number an action; the larger is the better. Discounted
    /// reward to come; votes, 0 to 1, of `av` and `mls`.
    fn values(&self, py: Python<'_>, belief: Belief<'_>) -> PyResult<Vec<f64>> {
        Ok(self.decide(py, belief)?.1)
    }

    /// Forgets earlier decisions, if it remembers any: a new mission begins.
    fn reset(&self, py: Python<'_>) {
        let guard = self.decider.lock_py_attached(py);
        guard.unwrap_or_else(PoisonError::into_inner).reset();
    }

    /// How it was found, such as `sarsop` or `qmdp`.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The policy earns at least this from the start belief on; None if it is not known.
    #[getter]
    fn lower(&self) -> Option<f64> {
        self.solved.as_ref().and_then(|solved| solved.lower)
    }

    /// No policy earns more than this from the start belief on; None if it is not known.
    #[getter]
    fn upper(&self) -> Option<f64> {
        self.solved.as_ref().and_then(|solved| solved.upper)
    }

    /// (action, value of each state) of each vector; None for a heuristic.
    #[getter]
    fn vectors(&self) -> Option<Vec<(String, Vec<f64>)>> {
        let actions = self.model.pomdp.actions();
        let rows = self.solved.as_ref()?.vectors.rows();
        Some(
            rows.map(|(a, row)| (actions[a].clone(), row.to_vec()))
                .collect(),
        )
    }

    /// Processor time that it took to solve, s; None for a heuristic.
    #[getter]
    fn cpu_s(&self) -> Option<f64> {
        self.solved.as_ref().map(|solved| solved.cpu_s)
    }

    /// The model.
    #[getter]
    fn model(&self) -> Model {
        self.model.clone()
    }

    fn __repr__(&self) -> String {
        let Some(solved) = &self.solved else {
            return format!("<Policy: {}>", self.name);
        };
        let shown =
            |bound: Option<f64>| bound.map_or("?".to_owned(), |value| format!("{value:.6}"));
        format!(
            "<Policy: {}, {} vectors, {} <= V* <= {}>",
            self.name,
            solved.vectors.len(),
            shown(solved.lower),
            shown(solved.upper)
        )
    }
}

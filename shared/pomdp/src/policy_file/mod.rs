//! Policies in files: Vigil's own, which knows its model, and two that other programs read.
//!
//! | format | of | knows its model |
//! |---|---|---|
//! | [`PolicyFile`] (JSON) | Vigil | by hash: another model's policy is refused |
//! | [`appl`] (`.policy`, XML) | APPL's `pomdpsol` | no |
//! | [`alpha`] (`.alpha`, text) | `pomdp-solve` | no |
//!
//! Bytes in, bytes out; files are the caller's. All write digits that give back the same numbers.

#[cfg(feature = "solver")]
pub mod alpha;
#[cfg(feature = "pomdpx")]
pub mod appl;

use serde::{Deserialize, Serialize};

use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::model::Pomdp;

/// First member of every file.
const MAGIC: &str = "vigil-policy";
/// Version that this program writes and reads.
const VERSION: u32 = 1;

/// Why bytes are not a policy of this model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PolicyFileError {
    /// Not the expected document: cut short, not JSON, members missing, unknown or of another
    /// type, numbers beyond a double.
    #[error("line {line}, column {column}: {message}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What was found and what is allowed.
        message: String,
    },
    /// Something else than a policy.
    #[error("magic '{0}', allowed is '{MAGIC}'")]
    Magic(String),
    /// Of another version.
    #[error("version {0}, allowed is {VERSION}")]
    Version(u32),
    /// Of another model.
    #[error(
        "solved for the model {found}, this one is {wanted}: solve again, or give the model that \
         it was solved for"
    )]
    Model {
        /// Hash in the file.
        found: String,
        /// Hash of the model.
        wanted: String,
    },
    /// Bounds that cross or are no numbers.
    #[error("bounds {lower} to {upper}: allowed are finite numbers, the lower below the upper")]
    Bounds {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// Time that is no time.
    #[error("{0} s of computing: allowed is a number from 0")]
    Time(f64),
    /// Vectors that do not fit the model.
    #[error(transparent)]
    Vectors(#[from] VectorError),
}

/// A solved policy, with where it comes from and how good it is.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicyFile {
    /// [`Pomdp::hash`] of the model.
    pub model_hash: u64,
    /// Discount per step of the model.
    pub discount: f64,
    /// What found it, such as `sarsop`.
    pub method: String,
    /// The optimal value at the start belief is at least this, and so is this policy's; in units of
    /// reward.
    pub lower: f64,
    /// ... and at most this; none if the method gives none.
    pub upper: Option<f64>,
    /// What it cost, s of processor time.
    pub cpu_s: f64,
    /// The policy.
    pub vectors: AlphaVectors,
}

/// The file's members.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    /// `vigil-policy`.
    magic: String,
    /// Version of the format.
    version: u32,
    /// Hash of the model's meaning (not of its text), 16 hexadecimal digits.
    model_hash: String,
    /// Discount per step.
    discount: f64,
    /// What found the policy.
    method: String,
    /// Lower bound of the value at the start belief.
    lower: f64,
    /// Upper bound of the value at the start belief; null if there is none.
    upper: Option<f64>,
    /// upper - lower; for the reader's eye.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gap: Option<f64>,
    /// Processor time that it took, s.
    cpu_s: f64,
    /// Names of the states, in the order of the values.
    states: Vec<String>,
    /// Names of the actions.
    actions: Vec<String>,
    /// The vectors.
    vectors: Vec<Vector>,
}

/// One vector.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Vector {
    /// Index of the action that the plan begins with.
    action: usize,
    /// Value of the plan in each state.
    values: Vec<f64>,
}

fn hexadecimal(hash: u64) -> String {
    format!("{hash:016x}")
}

impl PolicyFile {
    /// The file's content.
    ///
    /// # Errors
    /// [`PolicyFileError`] for what [`Self::read`] would refuse.
    pub fn write(&self, model: &Pomdp) -> Result<Vec<u8>, PolicyFileError> {
        self.check(model)?;
        let vectors = self.vectors.rows().map(|(action, values)| Vector {
            action,
            values: values.to_vec(),
        });
        let document = Document {
            magic: MAGIC.to_owned(),
            version: VERSION,
            model_hash: hexadecimal(self.model_hash),
            discount: self.discount,
            method: self.method.clone(),
            lower: self.lower,
            upper: self.upper,
            gap: self.upper.map(|upper| upper - self.lower),
            cpu_s: self.cpu_s,
            states: model.states().to_vec(),
            actions: model.actions().to_vec(),
            vectors: vectors.collect(),
        };
        let mut bytes = serde_json::to_vec(&document).map_err(|error| syntax(&error))?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Reads a policy of `model`.
    ///
    /// # Errors
    /// [`PolicyFileError`]: what was found and what is allowed.
    pub fn read(bytes: &[u8], model: &Pomdp) -> Result<Self, PolicyFileError> {
        let document: Document = serde_json::from_slice(bytes).map_err(|error| syntax(&error))?;
        if document.magic != MAGIC {
            return Err(PolicyFileError::Magic(document.magic));
        }
        if document.version != VERSION {
            return Err(PolicyFileError::Version(document.version));
        }
        let wanted = hexadecimal(model.hash());
        if document.model_hash != wanted {
            return Err(PolicyFileError::Model {
                found: document.model_hash,
                wanted,
            });
        }
        let vectors = document.vectors.into_iter().map(|v| (v.action, v.values));
        let file = Self {
            model_hash: model.hash(),
            discount: document.discount,
            method: document.method,
            lower: document.lower,
            upper: document.upper,
            cpu_s: document.cpu_s,
            vectors: AlphaVectors::new(model.states().len(), model.actions().len(), vectors)?,
        };
        file.check(model)?;
        Ok(file)
    }

    fn check(&self, model: &Pomdp) -> Result<(), PolicyFileError> {
        let wanted = hexadecimal(model.hash());
        if self.model_hash != model.hash() || self.discount.to_bits() != model.discount().to_bits()
        {
            let found = hexadecimal(self.model_hash);
            return Err(PolicyFileError::Model { found, wanted });
        }
        let (lower, upper) = (self.lower, self.upper.unwrap_or(self.lower));
        if !(lower.is_finite() && upper.is_finite() && lower <= upper) {
            return Err(PolicyFileError::Bounds { lower, upper });
        }
        if !(self.cpu_s.is_finite() && self.cpu_s >= 0.0) {
            return Err(PolicyFileError::Time(self.cpu_s));
        }
        Ok(())
    }
}

fn syntax(error: &serde_json::Error) -> PolicyFileError {
    PolicyFileError::Syntax {
        line: error.line(),
        column: error.column(),
        message: error.to_string(),
    }
}

//! Model files: each has the version of its layout and a hash over its content.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use vigil_blocks::fnv1a;

/// Stands for the hash in a file that a person has changed on purpose.
pub const EDITED: &str = "edited";

/// Why a model was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// Not TOML, or not a model.
    #[error("not a learned model: {0}")]
    Parse(String),
    /// Another layout.
    #[error(
        "the model has layout version {found}; this program reads version {read}: learn it again \
         with `vigil learn`"
    )]
    Version {
        /// Version of the file.
        found: u32,
        /// Version that is read.
        read: u32,
    },
    /// The content does not fit the hash that the file carries.
    #[error(
        "the content has the hash {found}, but the file says hash = \"{stored}\": it was changed \
         or cut short. Learn it again; if the change is meant, write hash = \"{EDITED}\""
    )]
    Hash {
        /// Hash that the file carries.
        stored: String,
        /// Hash of the content.
        found: String,
    },
    /// A value is not finite or out of range.
    #[error("{key}: {value} is not allowed: {allowed}")]
    Value {
        /// Where.
        key: String,
        /// What was found.
        value: String,
        /// What is allowed.
        allowed: String,
    },
    /// The model is of another robot.
    #[error("the model is of robot '{model}' ({model_wheels}), not of '{robot}' ({robot_wheels})")]
    Robot {
        /// Robot of the model.
        model: String,
        /// Its wheels.
        model_wheels: String,
        /// Robot asked for.
        robot: String,
        /// Its wheels.
        robot_wheels: String,
    },
    /// The model has no calibration for the channels and the form of detection.
    #[error("the model has no calibration for '{sensors}' and '{form}', only for {known}")]
    Calibration {
        /// Channels.
        sensors: &'static str,
        /// Form.
        form: &'static str,
        /// Channels and forms for which it has one.
        known: String,
    },
}

/// The error of a value that is not allowed.
pub(crate) fn refuse<T>(
    key: impl Into<String>,
    value: impl ToString,
    allowed: impl Into<String>,
) -> Result<T, ModelError> {
    Err(ModelError::Value {
        key: key.into(),
        value: value.to_string(),
        allowed: allowed.into(),
    })
}

/// Refuses a number that is not finite or not within `low` to `high`.
pub(crate) fn check_range(key: &str, value: f64, low: f64, high: f64) -> Result<(), ModelError> {
    if value >= low && value <= high {
        return Ok(());
    }
    // Exponents keep numbers like 1e-12 short.
    let bound = |bound: f64| match bound.abs() {
        0.0 | 1e-3..=1e4 => bound.to_string(),
        _ => format!("{bound:e}"),
    };
    refuse(key, value, format!("{} to {}", bound(low), bound(high)))
}

/// A model that is kept in a file.
pub(crate) trait ModelFile: Clone + Serialize + DeserializeOwned {
    /// Version of the layout that is read and written.
    const VERSION: u32;

    /// Hash that the file carries.
    fn stored(&self) -> &str;

    /// The place of that hash.
    fn stored_mut(&mut self) -> &mut String;

    /// Checks every value.
    fn check(&self) -> Result<(), ModelError>;
}

/// The part that every layout has.
#[derive(Deserialize)]
struct Layout {
    /// Layout of the file.
    version: u32,
}

/// Reads and checks a model.
pub(crate) fn read<M: ModelFile>(text: &str) -> Result<M, ModelError> {
    // The version comes first: a file of another layout would fail by some missing key.
    let layout: Layout = toml::from_str(text).map_err(|error| parse_error(text, &error))?;
    if layout.version != M::VERSION {
        return Err(ModelError::Version {
            found: layout.version,
            read: M::VERSION,
        });
    }
    let model: M = toml::from_str(text).map_err(|error| parse_error(text, &error))?;
    model.check()?;
    let found = seal(&model);
    if model.stored() != found && model.stored() != EDITED {
        let stored = model.stored().to_owned();
        return Err(ModelError::Hash { stored, found });
    }
    Ok(model)
}

/// The file's text.
pub(crate) fn text<M: ModelFile>(model: &M) -> Result<String, ModelError> {
    toml::to_string(model).map_err(|error| ModelError::Parse(error.to_string()))
}

/// Hash over the content; equal for equal models.
pub(crate) fn hash<M: ModelFile>(model: &M) -> u64 {
    let mut content = model.clone();
    content.stored_mut().clear();
    let text = text(&content).unwrap_or_default();
    fnv1a::hash(fnv1a::BASIS, text.as_bytes())
}

/// The same with the hash that its content has, as [`read`] expects it.
pub(crate) fn sealed<M: ModelFile>(mut model: M) -> M {
    *model.stored_mut() = seal(&model);
    model
}

fn seal<M: ModelFile>(model: &M) -> String {
    format!("fnv1a64:{:016x}", hash(model))
}

fn parse_error(text: &str, error: &toml::de::Error) -> ModelError {
    let until = text
        .as_bytes()
        .iter()
        .take(error.span().map_or(0, |s| s.start));
    let line = 1 + until.filter(|&&byte| byte == b'\n').count();
    let message = error.message().replace('\n', " ");
    ModelError::Parse(format!("line {line}: {message}"))
}

//! A policy that was solved beforehand.

use std::path::Path;

use vigil_blocks::fnv1a;
use vigil_pomdp::policy_file::PolicyFile;
use vigil_pomdp::{PointBased, Pomdp};

/// Largest file, bytes: more than what a cycle has time for.
const BYTES_MAX: u64 = 64 << 20;

/// The policy of `model` in a file, and the hash of the file's bytes; or what is wrong with it.
pub(crate) fn load(path: &Path, model: &Pomdp) -> Result<(PointBased, u64), String> {
    let name = path.display();
    let unreadable = |error| format!("{name} cannot be read: {error}");
    let bytes = std::fs::metadata(path).map_err(unreadable)?.len();
    if bytes > BYTES_MAX {
        return Err(format!("{name} has {bytes} bytes, allowed are {BYTES_MAX}"));
    }
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let file = PolicyFile::read(&bytes, model).map_err(|error| format!("{name}: {error}"))?;
    let policy = PointBased::new(model, &file.vectors).map_err(|e| format!("{name}: {e}"))?;
    let (products, states) = (policy.products(), model.states().len());
    if products > PointBased::PRODUCTS_MAX {
        return Err(format!(
            "{name}: a decision with its vectors and those that give every action a value, {} in \
             all, of {states} values each, takes {products} multiplications, allowed are {}: solve \
             with a larger --precision or a shorter --timeout",
            products / states,
            PointBased::PRODUCTS_MAX
        ));
    }
    Ok((policy, fnv1a::hash(fnv1a::BASIS, &bytes)))
}

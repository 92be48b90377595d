//! What the questions share: the archive, the facts about the machine, the yardstick and the
//! filters that are compared.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

pub mod archive;
pub mod chain;
pub mod field;
pub mod figure7;
pub mod filters;
pub mod ground;
pub mod guard;
pub mod instructions;
pub mod latency;
pub mod machine;
pub mod matched;
pub mod missions;
pub mod naive;
pub mod noncentrality;
pub mod pairs;
pub mod pomdp_learning;
pub mod rare;
pub mod real;
pub mod recorded;
pub mod shares;
pub mod simulated;
pub mod speed;
pub mod unmodelled;

/// What the question of this name ends with: 0, or 1 and the reason.
pub fn ended(name: &str, result: Result<(), Box<dyn Error>>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(1)
        }
    }
}

/// What `work` makes of a folder of its own, which is gone afterwards.
///
/// # Errors
/// The file system's, and those of `work`.
pub fn in_folder<T>(
    name: &str,
    work: impl FnOnce(&Path) -> Result<T, Box<dyn Error>>,
) -> Result<T, Box<dyn Error>> {
    let folder = std::env::temp_dir().join(format!("vigil-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = work(&folder);
    let _ = std::fs::remove_dir_all(&folder);
    result
}

/// The value below which the share `q` of `values` lies; sorts them. NaN if there are none.
pub fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let at = (q * values.len() as f64) as usize;
    values
        .get(at.min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(f64::NAN)
}

//! What the questions share: the archive of results, facts about the machine, simulated drives.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use toml::Table;
use vigil_setup::{Setup, SetupError, load_graph};

pub mod archive;
pub mod blackbox;
pub mod chain;
pub mod corridors;
pub mod field;
pub mod ground_change;
pub mod interval;
pub mod large_robot;
pub mod latency;
pub mod launched;
pub mod machine;
pub mod missions;
pub mod null_drive;
pub mod process_time;
pub mod real_logs;
pub mod results;
pub mod run_time;
pub mod simulated;
pub mod taped_wheels;
pub mod tuning;
pub mod variation;

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

/// The project's folder.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A program that was built beside this one.
///
/// # Errors
/// The system's, where this program's path is not known.
pub fn program(name: &str) -> io::Result<PathBuf> {
    Ok(std::env::current_exe()?.with_file_name(name))
}

/// The graph of a configuration file; of `config/` if the path is relative.
///
/// # Errors
/// A configuration that is refused.
pub fn load(file: impl AsRef<Path>) -> Result<Setup, SetupError> {
    load_graph(&root().join("config").join(file), |_| {})
}

/// Makes a graph file of `config/` one that may lie anywhere: it names its models by full paths.
///
/// # Errors
/// One without models.
pub fn find_models(file: &mut Table) -> Result<(), Box<dyn Error>> {
    let config = root().join("config");
    let full = |path: &mut toml::Value| {
        let name = path.as_str().unwrap_or_default();
        *path = config.join(name).display().to_string().into();
    };
    let files = file.get_mut("files").and_then(toml::Value::as_table_mut);
    let files = files.ok_or("no [files]")?;
    files.iter_mut().for_each(|(_, path)| full(path));
    let policy = file
        .get_mut("supervisor")
        .and_then(|it| it.get_mut("policy_file"));
    policy.into_iter().for_each(full);
    Ok(())
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

/// What `work` makes of a clone of the project's last commit, which is gone afterwards.
///
/// # Errors
/// Git's, the file system's, and those of `work`.
pub fn in_clone<T>(
    name: &str,
    work: impl FnOnce(&Path) -> Result<T, Box<dyn Error>>,
) -> Result<T, Box<dyn Error>> {
    in_folder(name, |folder| {
        let clone = folder.join("vigil");
        let status = Command::new("git")
            .args(["clone", "--quiet", "--no-hardlinks"])
            .args([&root(), &clone])
            .status()?;
        if !status.success() {
            return Err("git clone failed".into());
        }
        work(&clone)
    })
}

/// True if `n` samples are enough to speak of their percentile `q`: of 99 none lies beyond the p99.
#[must_use]
pub fn has_percentile(q: f64, n: u64) -> bool {
    // A billionth for the rounding of `1 - q`.
    (1.0 - q) * n as f64 >= 1.0 - 1e-9
}

/// Text of the percentile `q` of `n` samples, or `-` if these are too few for it.
#[must_use]
pub fn percentile(q: f64, n: u64, text: impl Into<String>) -> String {
    if has_percentile(q, n) {
        text.into()
    } else {
        "-".into()
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentile_needs_a_sample_beyond_it() {
        for (q, least) in [(0.9, 10), (0.99, 100), (0.999, 1000), (0.9999, 10_000)] {
            assert_eq!(percentile(q, least, "1.5"), "1.5", "{q}");
            assert_eq!(percentile(q, least - 1, "1.5"), "-", "{q}");
        }
        assert_eq!(percentile(0.5, 2, "1.5"), "1.5");
        assert_eq!(percentile(0.99, 0, "NaN"), "-");
    }
}

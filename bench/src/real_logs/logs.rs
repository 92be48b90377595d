//! Logs of real robots: unpacked and imported.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

use vigil_import::{LogDescription, import};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_setup::load_robot;

use crate::root;

/// A robot's log.
#[derive(Debug)]
pub struct Log {
    /// The robot.
    pub robot: Description,
    /// Its runs.
    pub runs: Vec<Run>,
    /// Their names: of the file or folder, from the archive's.
    pub names: Vec<String>,
}

/// Unpacks `$VIGIL_DATA/real/<archive>.tar.xz` below the build folder and imports it by
/// `config/logs/<log>.toml`.
///
/// # Errors
/// What is missing or malformed.
pub fn log(archive: &str, log: &str) -> Result<Log, Box<dyn Error>> {
    let folder = unpacked(archive)?;
    let path = root().join(format!("config/logs/{log}.toml"));
    let description = LogDescription::load(&path)?;
    let robot = load_robot(&description.robot_path(&path))?;
    let imported = import(&description, &robot, &folder)?;
    for (channel, delay_s) in &imported.delays_s {
        eprintln!("{log}: {channel} is late by {delay_s:.3} s");
    }
    Ok(Log {
        names: imported.runs.iter().map(|run| run.name.clone()).collect(),
        runs: imported.frames(&robot),
        robot,
    })
}

/// The folder of an unpacked archive of `$VIGIL_DATA/real`, below the build folder.
///
/// # Errors
/// What is missing or malformed.
pub fn unpacked(archive: &str) -> Result<PathBuf, Box<dyn Error>> {
    let data = std::env::var("VIGIL_DATA");
    let data = data.map_err(|_| "VIGIL_DATA is not set: the folder that holds real/")?;
    let into = root().join("target/real");
    let folder = into.join(archive);
    if !folder.is_dir() {
        std::fs::create_dir_all(&into)?;
        let packed = Path::new(&data)
            .join("real")
            .join(format!("{archive}.tar.xz"));
        let mut tar = Command::new("tar");
        let status = tar.arg("-xJf").arg(&packed).arg("-C").arg(&into).status()?;
        if !status.success() {
            return Err(format!("{}: tar failed", packed.display()).into());
        }
    }
    Ok(folder)
}

//! Husky: natural grounds, nothing broken; a gyro and two motor currents.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use vigil_blocks::SensorFrame;
use vigil_recording::frames::Run;
use vigil_robot::{ChannelMap, Description};
use vigil_setup::{SetupError, load_robot};

use super::logs::unpacked;
use crate::root;

/// Half the distance between the wheels' centres, m.
fn half_track_m(robot: &Description) -> f64 {
    robot.wheels.first().map_or(f64::NAN, |wheel| wheel.y.abs())
}

/// The robot.
///
/// # Errors
/// A description that is refused.
pub fn robot() -> Result<Description, SetupError> {
    load_robot(&root().join("config/robots/husky.toml"))
}

/// The runs of its log, each with the ground it is on, in order.
///
/// # Errors
/// What is missing or malformed.
pub fn runs(robot: &Description) -> Result<Vec<(String, Run)>, Box<dyn Error>> {
    let folder = unpacked("husky_boreal")?;
    let mut grounds: Vec<PathBuf> = fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir())
        .collect();
    grounds.sort();
    let mut runs = Vec::new();
    for ground in grounds {
        let name = ground.file_name().unwrap_or_default().to_string_lossy();
        let name = name.into_owned();
        for number in 0.. {
            let path = |kind: &str| ground.join(format!("{kind}_{number:02}.csv"));
            let (wheels, gyro) = (path("pro"), path("imu"));
            if !wheels.is_file() {
                break;
            }
            let frames = frames(&table(&wheels)?, &table(&gyro)?, robot);
            let id = runs.len() as u32;
            runs.push((name.clone(), recorded(id, frames)));
        }
    }
    Ok(runs)
}

/// A run with the header that recorded frames have.
fn recorded(id: u32, mut frames: Vec<SensorFrame>) -> Run {
    for (seq, frame) in frames.iter_mut().enumerate() {
        frame.header.seq = seq as u64;
        frame.run_id = u64::from(id) + 1;
    }
    Run { id, frames }
}

/// Rows of numbers below a header.
fn table(path: &Path) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let text = fs::read_to_string(path)?;
    let row = |line: &str| -> Result<Vec<f64>, _> { line.split(',').map(str::parse).collect() };
    let rows: Result<Vec<Vec<f64>>, _> = text.lines().skip(1).map(row).collect();
    Ok(rows.map_err(|error| format!("{}: {error}", path.display()))?)
}

/// One frame for each row of the wheels; the yaw rate is the gyro's mean since the row before.
fn frames(wheels: &[Vec<f64>], gyro: &[Vec<f64>], robot: &Description) -> Vec<SensorFrame> {
    let half_track_m = half_track_m(robot);
    let map = ChannelMap::new(robot);
    let (mut at, mut frames) = (0, Vec::new());
    for row in wheels {
        let &[t_s, current_left, current_right, left_m_s, right_m_s, ..] = row.as_slice() else {
            continue;
        };
        let from = at;
        while gyro.get(at).is_some_and(|sample| sample[0] <= t_s) {
            at += 1;
        }
        let mut frame = SensorFrame::default();
        // 0 is no time.
        frame.header.t_capture_ns = (1e9 * (t_s + 1.0)).round() as u64;
        frame.robot_hash = map.hash();
        frame.set_command(0, 0.5 * (left_m_s + right_m_s));
        frame.set_command(1, 0.5 * (right_m_s - left_m_s) / half_track_m);
        if let Some(samples) = gyro.get(from..at).filter(|samples| !samples.is_empty()) {
            let sum: f64 = samples.iter().map(|sample| sample[3]).sum();
            map.set_yaw_rate(&mut frame, sum / samples.len() as f64);
        }
        map.set_current(&mut frame, 0, current_left);
        map.set_current(&mut frame, 1, current_right);
        frames.push(frame);
    }
    frames
}

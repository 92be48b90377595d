//! Channels as sums of columns, files side by side, several runs in a file, empty cells.
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use tempfile::TempDir;
use vigil_import::{LogDescription, import};
use vigil_robot::Description;

/// A robot of which only the gyro is measured, and a speed commanded.
const SMALL: &str = r#"
name = "small"
kinematics = "differential"
wheel_radius_m = 0.1
noise = "estimate"
command = [{ name = "v", unit = "m/s", limit = 1.0 }, { name = "w", unit = "rad/s", limit = 2.0 }]
wheels = [
  { name = "L", x = 0.0, y = 0.1, steered = false },
  { name = "R", x = 0.0, y = -0.1, steered = false },
]
measured = { pose = false, wheel_rates = false, steer = false, yaw_rate = true, currents = false }
limits = { speed_m_s = 1.0, yaw_rate_rad_s = 2.0, wheel_rate_rad_s = 50.0 }
"#;

const SUMS: &str = r#"
robot = "robot.toml"
rate_hz = 8.0
runs = ["pro_*.csv"]
run_column = "run"
[[source]]
name = "wheels"
time = { column = "t", unit = "s" }
[[source]]
name = "imu"
file = "imu_*.csv"
time = { column = "t", unit = "s" }
[[channel]]
name = "v"
source = "wheels"
columns = { left = 0.5, right = 0.5 }
method = "hold"
[[channel]]
name = "w"
source = "wheels"
columns = { left = -2.0, right = 2.0 }
method = "hold"
[[channel]]
name = "yaw_rate"
source = "imu"
column = "wz"
method = "interpolate"
"#;

/// Two files for each source, two runs in each.
fn write_sums(folder: &Path) {
    for file in 0..2 {
        let (mut wheels, mut imu) = ("run,t,left,right\n".to_owned(), "run,t,wz\n".to_owned());
        for run in 0..2 {
            for i in 0..50 {
                let t = f64::from(i) * 0.125;
                writeln!(wheels, "{run},{t},{},{}", run + file, i).unwrap();
                // The gyro's first value comes late, and one is missing: those beside it count.
                let wz = match i {
                    0..3 | 20 => String::new(),
                    _ => f64::from(i + 100 * run).to_string(),
                };
                writeln!(imu, "{run},{t},{wz}").unwrap();
            }
        }
        fs::write(folder.join(format!("pro_{file}.csv")), wheels).unwrap();
        fs::write(folder.join(format!("imu_{file}.csv")), imu).unwrap();
    }
}

#[test]
fn columns_add_up_files_lie_side_by_side_and_a_file_holds_several_runs() {
    let folder = TempDir::new().unwrap();
    write_sums(folder.path());
    let robot: Description = toml::from_str(SMALL).unwrap();
    let log: LogDescription = toml::from_str(SUMS).unwrap();
    let found = import(&log, &robot, folder.path()).unwrap();
    let names: Vec<&str> = found.runs.iter().map(|run| run.name.as_str()).collect();
    let wanted = [
        "pro_0.csv run 0",
        "pro_0.csv run 1",
        "pro_1.csv run 0",
        "pro_1.csv run 1",
    ];
    assert_eq!(names, wanted);
    for (index, run) in found.runs.iter().enumerate() {
        let (file, part) = (index / 2, index % 2);
        assert_eq!(run.rows.len(), 47, "from the fourth row on");
        for (k, row) in run.rows.iter().enumerate() {
            let (i, left) = ((k + 3) as f64, (part + file) as f64);
            let sums = [0.5 * (left + i), 2.0 * (i - left), i + 100.0 * part as f64];
            let close = row[1..]
                .iter()
                .zip(sums)
                .all(|(found, sum)| (found - sum).abs() < 1e-9);
            assert!(close, "run {index} row {i}: {row:?} {sums:?}");
        }
        let [lacking] = run.lacking.as_slice() else {
            unreachable!("the gyro's rows lack values")
        };
        assert_eq!(
            (lacking.column.as_str(), lacking.rows, lacking.of),
            ("wz", 4, 50)
        );
    }
    for (from, to, wanted) in [
        (
            "column = \"wz\"",
            "",
            "channel.2.column: is required, or `columns`",
        ),
        (
            "column = \"wz\"",
            "columns = { wz = nan }",
            "channel.2.columns.wz: NaN",
        ),
        (
            "columns = { left = 0.5,",
            "columns = { none = 0.5,",
            "there is no column 'none'; there are",
        ),
    ] {
        let text = SUMS.replacen(from, to, 1);
        assert_ne!(text, SUMS, "{from}");
        let log: LogDescription = toml::from_str(&text).unwrap();
        let message = import(&log, &robot, folder.path()).unwrap_err().to_string();
        assert!(message.contains(wanted), "{message}");
    }
}

//! What a robot's description must say of its geometry, and what a robot without one may leave out.

use std::fs;

use tempfile::TempDir;
use vigil_setup::load_robot;

/// What the description is refused for; empty if it is taken.
fn refused(text: &str) -> String {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("robot.toml");
    fs::write(&path, text).unwrap();
    load_robot(&path).map_or_else(|error| error.to_string(), |_| String::new())
}

const BOAT: &str = r#"
name = "boat"
kinematics = "none"
command = [{ name = "throttle", unit = "%", limit = 100.0 }]
measured = { pose = false, wheel_rates = false, steer = false, yaw_rate = true, currents = false }
"#;

#[test]
fn a_robot_without_a_geometry_needs_no_wheels_and_no_limits() {
    assert_eq!(refused(BOAT), "");
    assert_eq!(
        refused(&BOAT.replace(
            "[{ name = \"throttle\", unit = \"%\", limit = 100.0 }]",
            "[]"
        )),
        ""
    );
    let axis = "{ name = \"a\", unit = \"%\", limit = 1.0 }";
    let five = format!("[{}]", [axis; 5].join(", "));
    let many = BOAT.replace(
        "[{ name = \"throttle\", unit = \"%\", limit = 100.0 }]",
        &five,
    );
    assert!(
        refused(&many).contains("5 axes: allowed are up to four axes"),
        "{}",
        refused(&many)
    );
}

#[test]
fn what_a_geometry_needs_is_named_where_it_is_missing() {
    let rolling = BOAT.replace("\"none\"", "\"differential\"");
    let told = refused(&rolling);
    for missing in ["wheel_radius_m", "no wheels", "limits", "1 axes"] {
        assert!(told.contains(missing), "{missing}: {told}");
    }
}

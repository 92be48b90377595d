//! A small robot with two driven wheels, for tests that say what it measures.

use vigil_robot::Description;

/// The robot; `more`: keys of its description (TOML) beside its geometry and limits.
pub fn small(more: &str) -> Description {
    let text = format!(
        r#"
name = "small"
kinematics = "differential"
wheel_radius_m = 0.1
command = [
  {{ name = "v", unit = "m/s", limit = 1.0 }},
  {{ name = "w", unit = "rad/s", limit = 2.0 }},
]
wheels = [
  {{ name = "L", x = 0.0, y = 0.1, steered = false }},
  {{ name = "R", x = 0.0, y = -0.1, steered = false }},
]
limits = {{ speed_m_s = 1.0, yaw_rate_rad_s = 2.0, wheel_rate_rad_s = 50.0 }}
{more}
"#
    );
    toml::from_str(&text).unwrap()
}

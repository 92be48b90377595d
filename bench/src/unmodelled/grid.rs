//! Which disturbances, in which sizes and turns, at which speeds.

/// Sizes of each kind; `W` stands for a wheel, `S` for a steered one, `side` for a side: they
/// change from cell to cell.
const SPECS: [&str; 60] = [
    "steer-jump:S:0.1",
    "steer-jump:S:0.2",
    "steer-jump:S:-0.3",
    "steer-offset-hidden:S:0.1",
    "steer-offset-hidden:S:0.2",
    "steer-offset-hidden:S:-0.3",
    "tether:10",
    "tether:20",
    "tether:40",
    "torque-loss:W:0.3",
    "torque-loss:W:0.5",
    "torque-loss:W:0.7",
    "torque-loss:W:1",
    "yaw-rate-bias:0.01",
    "yaw-rate-bias:0.02",
    "yaw-rate-bias:-0.05",
    "pose-drift:0.01",
    "pose-drift:0.02",
    "pose-drift:-0.05",
    "pose-delay:0.1",
    "pose-delay:0.3",
    "pose-delay:0.6",
    "pose-drop:0.5",
    "pose-drop:1",
    "pose-scale:1.05",
    "pose-scale:1.1",
    "pose-scale:0.8",
    "sinkage:W:3",
    "sinkage:W:6",
    "sinkage:W:10",
    "slope:0.08",
    "slope:0.15",
    "slope:-0.2",
    "side-slope:0.08",
    "side-slope:0.15",
    "side-slope:-0.25",
    "brush:W:5",
    "brush:W:10",
    "brush:W:20",
    "puncture:W:0.95",
    "puncture:W:0.9",
    "puncture:W:0.8",
    "soil-soft:side:0.7",
    "soil-soft:side:0.4",
    "soil-soft:side:0.2",
    "encoder-scale:W:1.05",
    "encoder-scale:W:1.2",
    "encoder-scale:W:0.8",
    "encoder-delay:W:0.3",
    "encoder-delay:W:0.6",
    "payload-shift:-0.08:0.1",
    "payload-shift:0.1:-0.15",
    "payload-shift:-0.1:0.15",
    "encoder-bias:W:0.3",
    "encoder-bias:W:0.6",
    "encoder-drift:W:0.05",
    "steer-held:S:0.2",
    "steer-bias:S:0.1",
    "pose-jump:0.2",
    "pose-held:60",
];
const CURVATURES_1_M: [f64; 5] = [0.0, 0.3, -0.3, 0.7, -0.7];
const SPEEDS_M_S: [f64; 3] = [0.1, 0.2, 0.3];
const WHEELS: [&str; 6] = ["LF", "LM", "LR", "RF", "RM", "RR"];
const STEERED: [&str; 4] = ["LF", "LR", "RF", "RR"];
const SIDES: [&str; 2] = ["left", "right"];

/// A disturbance in a turn at a speed.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Kind of the disturbance: first word of `spec`.
    pub kind: &'static str,
    /// The disturbance, as `--inject` takes it.
    pub spec: String,
    /// Wheel whose encoder is disturbed, by name: naming it is right.
    pub encoder: Option<&'static str>,
    /// Commanded curvature, 1/m.
    pub curvature_1_m: f64,
    /// Commanded speed, m/s.
    pub speed_m_s: f64,
    /// True if the curvature weaves about its value: a late encoder is late about changes only.
    pub weaves: bool,
}

/// All cells, wheels and sides spread evenly over them.
#[must_use]
pub fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for (s, spec) in SPECS.into_iter().enumerate() {
        for (c, curvature_1_m) in CURVATURES_1_M.into_iter().enumerate() {
            for (v, speed_m_s) in SPEEDS_M_S.into_iter().enumerate() {
                let turn = s + 2 * c + 3 * v;
                let wheel = match spec.contains(":S:") {
                    true => STEERED[turn % STEERED.len()],
                    false => WHEELS[turn % WHEELS.len()],
                };
                let kind = spec.split(':').next().unwrap_or(spec);
                let with = spec.replace(":W", &format!(":{wheel}"));
                let with = with.replace(":S:", &format!(":{wheel}:"));
                let with = with.replace(":side", &format!(":{}", SIDES[turn % SIDES.len()]));
                cells.push(Cell {
                    kind,
                    spec: with,
                    encoder: kind.starts_with("encoder").then_some(wheel),
                    curvature_1_m,
                    speed_m_s,
                    weaves: kind == "encoder-delay",
                });
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::collections::BTreeSet;
    use vigil_robot::Injection;
    use vigil_robot::disturbance::KINDS;

    #[test]
    fn every_kind_is_there_and_every_specification_is_understood() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let robot = vigil_setup::load_robot(&root.join("config/robots/rover.toml")).unwrap();
        let cells = cells();
        assert_eq!(cells.len(), SPECS.len() * 15);
        for cell in &cells {
            Injection::parse_change(&cell.spec, &robot).unwrap();
        }
        let kinds: BTreeSet<&str> = cells.iter().map(|cell| cell.kind).collect();
        // Gyro and currents show in neither pose nor encoders.
        let shown = KINDS.iter().map(|row| row.name);
        let shown = shown.filter(|name| !name.starts_with("gyro") && !name.starts_with("current"));
        assert_eq!(kinds, shown.collect());
        let wheels = cells.iter().filter(|cell| cell.kind == "brush");
        let wheels: BTreeSet<&str> = wheels.map(|c| c.spec.split(':').nth(1).unwrap()).collect();
        assert_eq!(wheels.len(), 6);
    }
}

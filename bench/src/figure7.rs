//! How a stuck wheel bends the path of the rover: the slip model beside recorded runs of an
//! independent physics engine, radius by radius, wheel by wheel.
//!
//! The paper's figure 7 and its claim: a wheel stuck on the inside of a turn sharpens it, one on
//! the outside makes it shallower.

mod drawing;
mod measured;

pub use drawing::draw;
pub use measured::Measured;

use serde_json::{Value, json};
use vigil_robot::kinematics::{ROVER_WHEELS, advance};
use vigil_robot::slip::{Condition, Situation, SlipError, SlipModel, Soil};

/// Radii of the table, m; each to the left and to the right.
pub const RADII_M: [f64; 10] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0];
/// Speed where no recorded run gives one, m/s.
pub const SPEED_M_S: f64 = 0.2;
/// Mean over standard error from which a recorded change counts as significant.
const SIGNIFICANT: f64 = 2.0;
/// Factor within which model and recorded change shall agree.
pub const RATIO_MAX: f64 = 1.5;

/// One stuck wheel in one turn.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Signed radius, m; positive to the left.
    pub radius_m: f64,
    /// Which wheel.
    pub wheel: usize,
    /// Name of the wheel.
    pub name: String,
    /// Change of heading per metre commanded, of the model, rad/m.
    pub model_rad_m: f64,
    /// The same relative to the nominal heading rate of the model, %.
    pub model_percent: f64,
    /// The cell in the recorded runs, if it is there.
    pub measured: Option<Measured>,
}

impl Cell {
    /// True if the sign is the paper's: the same side sharpens, the other makes shallower.
    #[must_use]
    pub fn is_sign_right(&self) -> bool {
        self.sharpens(self.model_percent)
            && self
                .measured
                .as_ref()
                .is_none_or(|m| self.sharpens(m.percent))
    }

    fn sharpens(&self, percent: f64) -> bool {
        let is_inner = (self.wheel < ROVER_WHEELS / 2) == (self.radius_m > 0.0);
        if is_inner {
            percent > 0.0
        } else {
            percent < 0.0
        }
    }

    /// Model over recorded change, where the recorded one is there and significant.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        let measured = self.measured.as_ref()?;
        let clear = measured.rad_m.abs() > SIGNIFICANT * measured.error_rad_m;
        clear.then(|| self.model_rad_m / measured.rad_m)
    }

    /// True if a significant cell's sizes differ by more than [`RATIO_MAX`].
    #[must_use]
    pub fn misses(&self) -> bool {
        self.ratio()
            .is_some_and(|ratio| !(1.0 / RATIO_MAX..=RATIO_MAX).contains(&ratio))
    }

    /// Raw data.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "radius_m": self.radius_m, "wheel": self.name,
            "model_rad_m": self.model_rad_m, "model_percent": self.model_percent,
            "recorded": self.measured.as_ref().map(Measured::json),
            "ratio": self.ratio(), "sign_right": self.is_sign_right(),
        })
    }
}

fn situation(curvature_1_m: f64, speed_m_s: f64, stuck: Option<usize>) -> Situation {
    Situation {
        curvature_1_m,
        speed_m_s,
        stuck: std::array::from_fn(|i| Some(i) == stuck),
        soil: Soil::uniform(0.65, 0.2),
        condition: Condition::default(),
    }
}

/// Steady heading rate per metre commanded, rad/m.
///
/// # Errors
/// The slip model's.
pub fn heading_rad_m(
    model: &SlipModel,
    curvature_1_m: f64,
    speed_m_s: f64,
    stuck: Option<usize>,
) -> Result<f64, SlipError> {
    let motion = model.solve(&situation(curvature_1_m, speed_m_s, stuck), None)?;
    Ok(motion.velocity[2] / speed_m_s)
}

/// All cells; `recorded` gives the recorded runs of a cell and their speeds, if there are any.
///
/// # Errors
/// The slip model's.
pub fn cells(
    model: &SlipModel,
    names: &[String],
    recorded: impl Fn(f64, usize) -> Option<Measured>,
) -> Result<Vec<Cell>, SlipError> {
    let mut cells = Vec::new();
    for radius_m in RADII_M
        .into_iter()
        .flat_map(|radius_m| [radius_m, -radius_m])
    {
        for (wheel, name) in names.iter().enumerate().take(ROVER_WHEELS) {
            let measured = recorded(radius_m, wheel);
            let alone = [SPEED_M_S];
            let speeds_m_s = measured.as_ref().map_or(&alone[..], |m| &m.speeds_m_s);
            let (mut change, mut nominal) = (0.0, 0.0);
            for &speed_m_s in speeds_m_s {
                let curvature = 1.0 / radius_m;
                let healthy = heading_rad_m(model, curvature, speed_m_s, None)?;
                let stuck = heading_rad_m(model, curvature, speed_m_s, Some(wheel))?;
                change += (stuck - healthy) / speeds_m_s.len() as f64;
                nominal += healthy / speeds_m_s.len() as f64;
            }
            cells.push(Cell {
                radius_m,
                wheel,
                name: name.clone(),
                model_rad_m: change,
                model_percent: 100.0 * change / nominal,
                measured,
            });
        }
    }
    Ok(cells)
}

/// Path of the rover's centre, m, over `length_m` commanded metres from the origin, heading along
/// x.
///
/// # Errors
/// The slip model's.
pub fn path(
    model: &SlipModel,
    curvature_1_m: f64,
    stuck: Option<usize>,
    length_m: f64,
) -> Result<Vec<(f64, f64)>, SlipError> {
    const STEP_S: f64 = 0.1;
    let motion = model.solve(&situation(curvature_1_m, SPEED_M_S, stuck), None)?;
    let steps = (length_m / SPEED_M_S / STEP_S).round() as usize;
    let mut pose = [0.0; 3];
    let mut points = vec![(0.0, 0.0)];
    for _ in 0..steps {
        pose = advance(pose, motion.velocity, STEP_S);
        points.push((pose[0], pose[1]));
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::path::Path;

    fn rover() -> (SlipModel, Vec<String>) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let robot = vigil_setup::load_robot(&root.join("config/robots/rover.toml")).unwrap();
        let names = robot
            .wheels
            .iter()
            .map(|wheel| wheel.name.clone())
            .collect();
        (SlipModel::new(&robot).unwrap(), names)
    }

    #[test]
    fn a_stuck_wheel_sharpens_a_turn_to_its_side_and_makes_the_other_shallower_in_every_cell() {
        let (model, names) = rover();
        let cells = cells(&model, &names, |_, _| None).unwrap();
        assert_eq!(cells.len(), 120);
        for cell in cells {
            let inner = cell.name.starts_with('L') == (cell.radius_m > 0.0);
            assert_eq!(cell.model_percent > 0.0, inner, "{cell:?}");
            assert!(
                cell.is_sign_right() && cell.model_percent.abs() > 0.5,
                "{cell:?}"
            );
            let left = if cell.name.starts_with('L') {
                1.0
            } else {
                -1.0
            };
            assert!(cell.model_rad_m * left > 0.0, "{cell:?}");
        }
    }

    #[test]
    fn a_wrong_sign_or_size_in_the_recorded_runs_is_told() {
        let (model, names) = rover();
        let with = |factor: f64, error_rad_m: f64| {
            let plain = cells(&model, &names, |_, _| None).unwrap().remove(0);
            Cell {
                measured: Some(Measured {
                    rad_m: factor * plain.model_rad_m,
                    percent: factor * plain.model_percent,
                    error_rad_m,
                    speeds_m_s: vec![SPEED_M_S],
                }),
                ..plain
            }
        };
        assert!(with(1.0, 0.0).is_sign_right() && !with(1.0, 0.0).misses());
        assert!(!with(-1.0, 0.0).is_sign_right());
        assert!(with(2.0, 0.0).misses() && with(0.6, 0.0).misses());
        assert_eq!(with(2.0, 1.0).ratio(), None, "not significant");
    }

    #[test]
    fn the_nominal_path_is_the_commanded_circle() {
        let (model, _) = rover();
        let path = path(&model, 1.0 / 6.0, None, 6.0).unwrap();
        assert_eq!(path.len(), 301);
        for (x, y) in path {
            let radius = x.hypot(y - 6.0);
            assert!((radius / 6.0 - 1.0).abs() < 0.005, "{radius}");
        }
    }
}

//! What missions hold fixed, changed one thing at a time: `bench/variations.toml`.

mod comparison;

pub use comparison::{Commanded, Comparison, say_comparisons, without_lead};

use std::error::Error;

use serde::Deserialize;
use vigil_diagnosis::Sensors;
use vigil_setup::graph_file::{GraphFile, Simulator};

/// A change of what all missions have in common; what is `None` stays as it is.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Variation {
    /// What is changed, in words.
    pub name: String,
    /// Rate of the frames, Hz.
    rate_hz: Option<f64>,
    /// Channels that detector and identifier use.
    sensors: Option<Sensors>,
    /// Factor on the planned speed.
    speed_scale: Option<f64>,
    /// Soil: its relative slip and its friction coefficient.
    shear_modulus: Option<f64>,
    friction: Option<f64>,
    /// Time constant of the body's velocity, s.
    lag_s: Option<f64>,
    /// Factor on the sensors' noise.
    noise_scale: Option<f64>,
    /// Half of a corridor's width, m.
    corridor_half_m: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VariationsFile {
    variation: Vec<Variation>,
}

impl Variation {
    /// All of the file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read_all() -> Result<Vec<Self>, Box<dyn Error>> {
        let text = std::fs::read_to_string(crate::root().join("bench/variations.toml"))?;
        Ok(toml::from_str::<VariationsFile>(&text)?.variation)
    }

    /// True if nothing but corridors is changed.
    #[must_use]
    pub fn is_of_corridors(&self) -> bool {
        let others = Self {
            name: self.name.clone(),
            corridor_half_m: self.corridor_half_m,
            ..Self::default()
        };
        self.corridor_half_m.is_some() && *self == others
    }

    /// Changes the graph that watches.
    pub(crate) fn change_graph(&self, file: &mut GraphFile) {
        let graph = &mut file.graph;
        graph.rate_hz = self.rate_hz.unwrap_or(graph.rate_hz);
        file.detector.sensors = self.sensors.unwrap_or(file.detector.sensors);
    }

    /// Changes the world that was drawn for a mission.
    pub(crate) fn change_world(&self, world: &mut Simulator) {
        world.shear_modulus = self.shear_modulus.unwrap_or(world.shear_modulus);
        world.friction = self.friction.unwrap_or(world.friction);
        world.lag_s = self.lag_s.unwrap_or(world.lag_s);
        world.noise_scale = self.noise_scale.unwrap_or(world.noise_scale);
    }

    /// Factor on the planned speed.
    pub(crate) fn speed_scale(&self) -> f64 {
        self.speed_scale.unwrap_or(1.0)
    }

    /// Half of a corridor's width, m, if it is that of `shipped_m` otherwise.
    pub(crate) fn corridor_half_m(&self, shipped_m: f64) -> f64 {
        self.corridor_half_m.unwrap_or(shipped_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_changes_nothing_and_every_other_something() {
        let all = Variation::read_all().unwrap();
        let changed = |variation: &Variation| {
            let setup = crate::load("corridor-people.toml").unwrap();
            let (mut file, mut world) = (setup.file.clone(), Simulator::default());
            variation.change_graph(&mut file);
            variation.change_world(&mut world);
            file != setup.file
                || world != Simulator::default()
                || variation.speed_scale() != 1.0
                || variation.corridor_half_m(1.2) != 1.2
        };
        assert!(!changed(&all[0]) && !all[0].is_of_corridors());
        assert!(all[1..].iter().all(changed));
        assert_eq!(all.iter().filter(|it| it.is_of_corridors()).count(), 2);
    }
}

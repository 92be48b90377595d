//! What live missions brought, beside the same missions within one process.

use serde_json::{Value, json};
use vigil_missions::simulation::{PairedDifference, Summary};

use super::drive::CorridorMission;
use super::live::LiveMission;
use super::report::{hits, without_lead};
use super::score::{MEASURES, POINTS, TOUCHES};
use crate::archive::Archive;

/// Points in which two drives of a mission may differ and be alike: a second and a half.
const ALIKE: f64 = 1.5;

/// Missions driven live, and the same by Vigil and by the ladder within one process.
#[derive(Debug)]
pub struct LiveComparison<'a> {
    /// The live ones.
    pub live: &'a [LiveMission],
    /// Vigil's within one process, and after it the ladder's.
    pub simulated: &'a [CorridorMission],
}

impl LiveComparison<'_> {
    fn live(&self) -> Vec<f64> {
        let points = self.live.iter().map(|it| (POINTS.of)(&it.score));
        points.collect()
    }

    fn simulated(&self, arm: usize) -> Vec<f64> {
        let scores = self.simulated.iter().filter_map(|it| it.scores.get(arm));
        scores.map(POINTS.of).collect()
    }

    /// Live less a commander within one process.
    fn against(&self, arm: usize) -> PairedDifference {
        PairedDifference::new(&self.live(), &self.simulated(arm))
    }

    fn alike(&self) -> usize {
        let pairs = self.live().into_iter().zip(self.simulated(0));
        pairs.filter(|(a, b)| (a - b).abs() <= ALIKE).count()
    }

    fn sum(&self, of: fn(&LiveMission) -> u64) -> u64 {
        self.live.iter().map(of).sum()
    }

    /// All figures.
    #[must_use]
    pub fn document(&self) -> Value {
        let difference = |arm| {
            let it = self.against(arm);
            json!({"mean": it.difference, "half_width_95": it.half_width, "p": it.p})
        };
        let mut figures = json!({});
        for measure in MEASURES {
            let mut values: Vec<f64> = self.live.iter().map(|it| (measure.of)(&it.score)).collect();
            let found = Summary::new(&mut values);
            figures[measure.key] = json!({"mean": found.mean, "half_width_95": found.half_width});
        }
        json!({
            "missions": self.live.len(),
            "live": figures,
            "less_ladder": difference(1),
            "less_simulated": difference(0),
            "alike": self.alike(),
            "cycles": self.sum(|it| it.cycles),
            "missed": self.sum(|it| it.missed),
            "short": self.shortfalls(),
        })
    }

    /// The report; `at_once` graphs ran beside each other.
    pub fn say(&self, archive: &mut Archive, at_once: usize) {
        let missions = self.live.len();
        archive.say(&format!(
            "{missions} missions of `corridors`, each driven by a graph of its own: sensor-sim, \
             detector, identifier and supervisor over shared memory in real time, {at_once} graphs \
             at once on this machine. What was true comes from the simulator's block `truth`. \
             *Simulated*: the same missions within one process.\n"
        ));
        archive.say("| commander | points, mean ± 95 % | live less this | p |");
        archive.say("|---|---|---|---|");
        let mean = |mut values: Vec<f64>| {
            let found = Summary::new(&mut values);
            format!("{:.1} ± {:.1}", found.mean, found.half_width)
        };
        archive.say(&format!("| Vigil, live | {} | | |", mean(self.live())));
        for (arm, name) in [(0, "Vigil, simulated"), (1, "ladder, simulated")] {
            let found = self.against(arm);
            archive.say(&format!(
                "| {name} | {} | {:+.1} ± {:.1} | {:.1e} |",
                mean(self.simulated(arm)),
                found.difference,
                found.half_width,
                found.p,
            ));
        }
        archive.say(&format!(
            "\nLive and simulated are within {ALIKE} points in {} of {missions} missions. Services \
             missed {} of {} cycles.\n",
            self.alike(),
            self.sum(|it| it.missed),
            4 * self.sum(|it| it.cycles),
        ));
        for line in self.shortfalls() {
            archive.say(&format!("- Short: {line}."));
        }
    }

    /// The bars that are missed.
    #[must_use]
    pub fn shortfalls(&self) -> Vec<String> {
        let touches: Vec<f64> = self.live.iter().map(|it| (TOUCHES.of)(&it.score)).collect();
        let short = without_lead(&self.against(1)).into_iter();
        short.chain(hits(&touches)).collect()
    }
}

//! Means and paired differences of missions, by kind and weighed over the kinds.

use serde_json::{Value, json};
use vigil_missions::simulation::{PairedDifference, Summary};

use super::MissionFile;
use super::commander::Arm;
use super::drive::Mission;
use super::kind::Kind;
use super::score::{MEASURES, Measure, Score};
use crate::interval::Interval;

/// Odds of a fault over those of the file, at which overall figures are given.
pub(super) const ODDS: [(f64, &str); 3] = [
    (1.0, "as stated"),
    (3.0, "three times the odds"),
    (1.0 / 3.0, "a third of the odds"),
];

/// What was driven, by whom.
pub(super) struct Table<'a> {
    pub file: &'a MissionFile,
    pub arms: &'a [Arm],
    pub missions: &'a [Mission],
}

impl Table<'_> {
    pub(super) fn of_kind(&self, kind: Kind) -> impl Iterator<Item = &Mission> {
        self.missions.iter().filter(move |m| m.plan.kind == kind)
    }

    fn values(&self, kind: Kind, arm: usize, of: fn(&Score) -> f64) -> Vec<f64> {
        let scores = self.of_kind(kind).filter_map(|m| m.scores.get(arm));
        scores.map(of).collect()
    }

    /// What a commander brings in missions of a kind.
    pub(super) fn mean(&self, kind: Kind, arm: usize, measure: Measure<Score>) -> Interval {
        let found = Summary::new(&mut self.values(kind, arm, measure.of));
        Interval {
            mean: found.mean,
            half_width: found.half_width,
        }
    }

    /// Vigil less another commander, in missions of a kind.
    pub(super) fn against(&self, kind: Kind, arm: usize, measure: Measure<Score>) -> Interval {
        let ours = self.values(kind, 0, measure.of);
        let found = PairedDifference::new(&ours, &self.values(kind, arm, measure.of));
        Interval {
            mean: found.difference,
            half_width: found.half_width,
        }
    }

    /// Over all kinds, weighed by their shares: the parts are independent, so that variances add.
    pub(super) fn over_kinds(&self, odds: f64, of_kind: impl Fn(Kind) -> Interval) -> Interval {
        let parts = Kind::ALL.map(|kind| (self.file.share(kind, odds), of_kind(kind)));
        let mean = parts.iter().map(|(share, part)| share * part.mean).sum();
        let squares = parts
            .iter()
            .map(|(share, part)| (share * part.half_width).powi(2));
        Interval {
            mean,
            half_width: squares.sum::<f64>().sqrt(),
        }
    }

    /// Commanders that follow rules, by their place.
    pub(super) fn rules(&self) -> impl Iterator<Item = usize> {
        let all = self.arms.iter().enumerate();
        all.filter(|(_, arm)| matches!(arm, Arm::Rule(_)))
            .map(|(at, _)| at)
    }

    /// The rule with the most points over all kinds.
    pub(super) fn best_rule(&self, odds: f64) -> Option<usize> {
        let points = |arm: &usize| {
            let of_kind = |kind| self.mean(kind, *arm, super::POINTS);
            self.over_kinds(odds, of_kind).mean
        };
        self.rules().max_by(|a, b| points(a).total_cmp(&points(b)))
    }

    /// All figures of a selection: its name, the mean of a commander and the difference to it.
    fn figures(
        &self,
        mean: impl Fn(usize, Measure<Score>) -> Interval,
        against: impl Fn(usize, Measure<Score>) -> Interval,
    ) -> Value {
        let mut figures = json!({});
        for (at, arm) in self.arms.iter().enumerate() {
            for measure in MEASURES {
                let mut value = mean(at, measure).document();
                if at > 0 {
                    value["vigil_minus_this"] = against(at, measure).document();
                }
                figures[arm.name()][measure.key] = value;
            }
        }
        figures
    }

    pub(super) fn document(&self) -> Value {
        let mut document = json!({});
        for (odds, name) in ODDS {
            document["overall"][name] = self.figures(
                |arm, measure| self.over_kinds(odds, |kind| self.mean(kind, arm, measure)),
                |arm, measure| self.over_kinds(odds, |kind| self.against(kind, arm, measure)),
            );
        }
        for kind in Kind::ALL {
            document["kinds"][kind.name()] = self.figures(
                |arm, measure| self.mean(kind, arm, measure),
                |arm, measure| self.against(kind, arm, measure),
            );
        }
        document
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::{POINTS, Plan};

    #[test]
    fn kinds_weigh_by_their_shares_however_many_missions_they_have() {
        let file = MissionFile::read().unwrap();
        let mission = |kind, points| Mission {
            plan: Plan::new(kind, 1),
            scores: vec![Score {
                points,
                ..Score::default()
            }],
        };
        let mut missions = Kind::ALL.map(|kind| mission(kind, 100.0)).to_vec();
        let weighed = |missions: &[Mission]| {
            let arms = [Arm::Vigil];
            let table = Table {
                file: &file,
                arms: &arms,
                missions,
            };
            table
                .over_kinds(1.0, |kind| table.mean(kind, 0, POINTS))
                .mean
        };
        assert!((weighed(&missions) - 100.0).abs() < 1e-9);
        missions.extend([200.0, 300.0].map(|points| mission(Kind::Nothing, points)));
        assert!((weighed(&missions) - 120.0).abs() < 1e-9);
    }
}

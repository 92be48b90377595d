//! What alarms, and what names one fault rather than another: the rules of the monitor.

use vigil_inference::logspace::log_add;
use vigil_robot::channel_model::Target;
use vigil_robot::channel_model::bank::{ERRATIC, IMPOSSIBLE, KINDS_MAX, ONSETS};
use vigil_robot::channel_model::law::{BLOCKS, Law};
use vigil_robot::channel_model::model::{Class, Tail};

use super::fault::{Extent, Fault};

/// Odds at which two faults count as told apart.
const ODDS: f64 = 9.0;

/// The rules.
pub(super) struct Rule {
    /// The law of whole windows.
    pub law: Law,
    /// What is measured.
    pub targets: Vec<Target>,
    /// Log-odds of a component before anything is seen.
    pub prior: f64,
    /// Log-odds at which to alarm.
    pub alarm: f64,
    /// Tail of each class.
    pub tails: [Option<Tail>; Class::ALL.len()],
}

impl Rule {
    /// Log-odds of no single fault in a window with this square, by class; `before`: the parts of
    /// the blocks in it before the fault.
    pub fn classes(&self, square: f64, before: &[f64]) -> [f64; Class::ALL.len()] {
        let mut classes = [IMPOSSIBLE; Class::ALL.len()];
        let unknown = self.law.log_ratio_unknown(square, before);
        classes[Class::Unknown as usize] = self.prior + unknown;
        classes
    }

    /// Log-odds of a fault in a window that is seen as this fault.
    pub fn log_odds(&self, fault: &Fault, sight: &Sight) -> f64 {
        let prior = fault.extent.prior;
        let penalty = match prior > 0.0 {
            true => 0.5 * (1.0 + sight.own / prior).ln(),
            false => 0.0,
        };
        let ratio = self.law.log_ratio_at(sight.square, sight.less);
        self.prior + ratio - penalty - fault.price
    }

    /// Log-odds of an erratic channel in a window with this square, of which the channel's readings
    /// from block `first` on say so much.
    pub fn erratic(&self, channel: usize, first: usize, square: f64, says: f64) -> f64 {
        let ratio = self
            .law
            .log_ratio_at(square, says * (1.0 - 1.0 / (ERRATIC * ERRATIC)));
        let penalty = (BLOCKS - first) as f64 * ERRATIC.ln();
        let target = &self.targets[channel];
        let shares = self
            .targets
            .iter()
            .filter(|other| other.component() == target.component());
        let price = (shares.count() * KINDS_MAX * ONSETS.len()) as f64;
        self.prior + ratio - penalty - price.ln()
    }

    /// True if so large log-odds of the classes alarm.
    pub fn alarms(&self, classes: &[f64; Class::ALL.len()]) -> bool {
        let tempered = classes.iter().zip(&self.tails).map(|(log_odds, tail)| {
            tail.as_ref()
                .map_or(*log_odds, |tail| tail.tempered(*log_odds))
        });
        let total = tempered.reduce(log_add).unwrap_or(IMPOSSIBLE);
        total >= self.alarm
    }

    /// True if a window with a fault, seen as this fault and as a rival, excludes the rival. Odds
    /// between faults are tempered as those against none.
    pub fn excludes(&self, classes: [Class; 2], [as_fault, as_rival]: &[Sight; 2]) -> bool {
        let slope = |class: Class| self.tails[class as usize].as_ref().map_or(1.0, |t| t.slope);
        let [fault, rival] = classes.map(slope);
        let ratio = |sight: &Sight| self.law.log_ratio_at(sight.square, sight.less);
        fault.min(rival) * (ratio(as_fault) - ratio(as_rival)) >= ODDS.ln()
    }
}

/// What a fault explains of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sight {
    /// Square of the window.
    pub square: f64,
    /// By how much the fault of the best size lessens it, held back by its prior.
    pub less: f64,
    /// Factor of the stated size that does so.
    pub factor: f64,
    /// `s'Ps` of the stated size.
    pub own: f64,
}

impl Sight {
    /// Of a fault in a window `square`, with whose residuals `r` its signature has the product
    /// `s'Pr`.
    pub fn new(extent: &Extent, square: f64, own: f64, product: f64) -> Self {
        let [least, most] = extent.bounds;
        let precision = (own + extent.prior).max(1e-300);
        let factor = (product / precision).max(least).min(most);
        Self {
            square,
            less: factor * (2.0 * product - factor * precision),
            factor,
            own,
        }
    }
}

//! How what the window's means show is divided: among single faults, declared ones, two at once,
//! and what none of them explains.

use vigil_inference::logspace::{log_add, log_sum_exp};

use super::{ANOTHER, ClassOdds, IMPOSSIBLE, Monitor, tempered};
use crate::channel_model::model::Class;
use crate::channel_model::watched::{Part, likeliest};

/// How much the logarithm of what a fault leaves unexplained, over what it explains, says against
/// it. Chosen: no effect of a fault is exactly as described, and twice as much is 16 to 1.
const DOUBT: f64 = 4.0;

impl Monitor {
    /// How much more likely the likeliest single fault that is not declared makes the window, and
    /// how much that may be at best: no effect of a drive's fault is exactly as described.
    pub(super) fn explained_alone(&self, prior: f64, raw: &ClassOdds) -> [f64; 2] {
        let of_means = |by_class: &[f64; Class::ALL.len()]| {
            let all = by_class.iter().enumerate();
            all.filter(|(class, _)| *class != Class::Noise as usize)
                .fold(IMPOSSIBLE, |most, (_, log_odds)| log_odds.max(most))
        };
        let single = &raw[..self.watched.len() - self.bank.declared().len()];
        let single = single.iter().map(of_means).enumerate();
        let single = single.max_by(|(_, one), (_, other)| one.total_cmp(other));
        single.map_or([0.0; 2], |(component, log_odds)| {
            let log_ratio = log_odds - prior;
            let part = self.watched[component].part;
            let at_best = match part {
                Part::Drive => {
                    let likeliest = likeliest(self.bank.weighed(component), part);
                    self.bank.at_best(log_ratio, likeliest.age_s)
                }
                _ => log_ratio,
            };
            [log_ratio, at_best]
        })
    }

    /// Divides what the window's means show among declared faults, other single ones, two at once,
    /// and what none of them explains. What a name leaves has to be as in health, or less than what
    /// it explains. `explained`: as [`Self::explained_alone`] says. Returns the components of two
    /// faults.
    pub(super) fn explain(
        &self,
        prior: f64,
        explained: [f64; 2],
        (odds, unknown): (&mut [f64], &mut f64),
    ) -> Option<[usize; 2]> {
        let pair = self.bank.pair();
        let [mut explained, at_best] = explained;
        let tail = |class: Class| self.tails[class as usize].as_ref();
        let first = odds.len() - 1 - self.bank.declared().len();
        let (single_odds, declared_odds) = odds.split_at_mut(first);
        let (named, declared) = (log_sum_exp(single_odds), log_sum_exp(declared_odds));
        let mut total = log_add(log_add(named, declared), *unknown);
        let mut both = None;
        if let Some(pair) = pair {
            let log_odds = tempered(tail(Class::Pair), self.classes[Class::Pair as usize]);
            total = log_add(total, log_odds - ANOTHER);
            let slope = tail(Class::Unknown).map_or(1.0, |tail| tail.slope);
            let more = slope * (pair.log_ratio - at_best) - ANOTHER;
            if more > 0.0 {
                explained = pair.log_ratio;
                both = Some((pair.components, more));
            }
        }
        // Labelled runs do not tell all that a declared fault changes: what it leaves says little.
        let bounded = tempered(tail(Class::Unknown), prior + self.bank.unknown_bounded());
        let against = declared - log_add(named, bounded);
        let others = total - log_add(0.0, against);
        let change = total - log_add(0.0, -against) - declared;
        declared_odds.iter_mut().for_each(|one| *one += change);
        let (further, doubt) = self.bank.unknown_beside(explained);
        let further = tempered(tail(Class::Unknown), prior + further).min(DOUBT * doubt);
        *unknown = others - log_add(0.0, -further);
        let (more, of_named) = (
            both.map_or(IMPOSSIBLE, |(_, more)| more),
            others - log_add(0.0, further),
        );
        let change = of_named - log_add(0.0, more) - named;
        single_odds.iter_mut().for_each(|one| *one += change);
        let declared_pair = self.pair_components().map(|(components, _)| components);
        match (both, declared_odds.last_mut()) {
            (Some((components, more)), Some(slot)) => {
                let odds = of_named - log_add(0.0, -more);
                let is_likelier = declared_pair.is_none() || odds > *slot;
                *slot = log_add(*slot, odds);
                Some(components).filter(|_| is_likelier).or(declared_pair)
            }
            _ => declared_pair,
        }
    }

    /// Divides what speaks for the declared faults among them, with the mean slope of their tails.
    pub(super) fn divide_declared(&self, raw: &[[f64; Class::ALL.len()]], odds: &mut [f64]) {
        let tails = Class::DECLARED.iter();
        let tails = tails.filter_map(|&class| self.tails[class as usize].as_ref());
        let (sum, count) = tails.fold((0.0, 0.0), |(sum, count), tail| {
            (sum + tail.slope, count + 1.0)
        });
        let slope = if count > 0.0 { sum / count } else { 1.0 };
        let declared = self.bank.declared();
        let first = odds.len() - 1 - declared.len();
        declared.divide(slope, &raw[first..], &mut odds[first..]);
    }
}

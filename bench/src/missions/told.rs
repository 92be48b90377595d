//! The best that a commander can do who is told what breaks, and how it will go on.

use vigil_blocks::RecoveryKind;

use super::HELP_S;
use super::breakdown::{Cause, PresentFault};
use super::prices::Prices;
use super::rules::RuleOutput;
use super::score::price_1_m;

/// Planned speed in the mean, m/s: for what time costs.
const SPEED_M_S: f64 = 0.22;

/// What is known of a mission under way.
#[derive(Debug, Clone, Copy)]
pub struct Knowledge<'a> {
    /// What is wrong now.
    pub present: &'a [PresentFault],
    /// What is to be expected of the rest.
    pub expected: &'a [PresentFault],
    /// What is left of the path, m.
    pub rest_m: f64,
}

/// The action with the least price of the rest: help if it is worth its price, else what is best
/// against what is there now.
pub(super) fn best(prices: &Prices, knowledge: &Knowledge<'_>) -> RuleOutput {
    let helped = prices.call + prices.time_1_s * HELP_S;
    let rest_m = knowledge.rest_m;
    if !knowledge.expected.is_empty() {
        let (_, price) = cheapest(prices, knowledge.expected, rest_m);
        if helped < price {
            return RuleOutput::plain(RecoveryKind::CallForHelp);
        }
    }
    cheapest(prices, knowledge.present, rest_m).0
}

/// What costs least over the rest of the path, beyond what a healthy rover would cost, and that
/// price.
fn cheapest(prices: &Prices, faults: &[PresentFault], rest_m: f64) -> (RuleOutput, f64) {
    let plain = [RecoveryKind::GoOn, RecoveryKind::SlowDown].map(RuleOutput::plain);
    let has_remedy = |fault: &&PresentFault| fault.cause != Cause::Unmodelled;
    let remedies = faults.iter().filter(has_remedy);
    let remedies = remedies.map(|fault| RuleOutput::remedy(fault.cause));
    let all = RuleOutput::limp_home(faults.iter().map(|fault| fault.cause));
    let all = all.filter(|_| faults.len() > 1);
    let priced = plain.into_iter().chain(remedies).chain(all).map(|output| {
        let speed = output.speed_scale();
        let waits_s = rest_m / SPEED_M_S * (1.0 / speed - 1.0);
        let price = price_1_m(prices, faults, output, speed) * rest_m + prices.time_1_s * waits_s;
        (output, price)
    });
    let least = priced.min_by(|a, b| a.1.total_cmp(&b.1));
    least.unwrap_or((RuleOutput::plain(RecoveryKind::GoOn), 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::prices::MissionFile;

    fn fault(cause: Cause, severity: f64) -> PresentFault {
        PresentFault { cause, severity }
    }

    #[test]
    fn help_is_called_where_it_is_cheaper_than_the_rest_of_the_path() {
        let prices = MissionFile::read().unwrap().prices;
        let order = |faults: &[PresentFault], rest_m: f64| {
            let knowledge = Knowledge {
                present: faults,
                expected: faults,
                rest_m,
            };
            best(&prices, &knowledge)
        };
        use RecoveryKind::{CallForHelp, GoOn, SlowDown};
        assert_eq!(order(&[], 20.0).kind, GoOn);
        let stuck = [fault(Cause::Stuck(4), 1.0)];
        assert_eq!(order(&stuck, 18.0), RuleOutput::remedy(Cause::Stuck(4)));
        let encoder = [fault(Cause::Encoder(1), 1.0)];
        assert_eq!(order(&encoder, 18.0), RuleOutput::remedy(Cause::Encoder(1)));
        // 350 points a metre, half of it slowly, against 330.
        let unmodelled = [fault(Cause::Unmodelled, 1.0)];
        assert_eq!(order(&unmodelled, 3.0).kind, CallForHelp);
        assert_eq!(order(&unmodelled, 1.0).kind, SlowDown);
        // A stuck wheel and another's encoder: 10 + 2.5 a metre, with both remedies.
        let both = [stuck[0], encoder[0]];
        let limping = RuleOutput::limp_home([Cause::Stuck(4), Cause::Encoder(1)]).unwrap();
        assert_eq!(limping.kind, RecoveryKind::LimpHome);
        assert_eq!(order(&both, 18.0), limping);
        // Two wheels of one side cannot be steered against.
        let one_side = [stuck[0], fault(Cause::Stuck(3), 1.0)];
        assert_eq!(
            RuleOutput::limp_home([Cause::Stuck(4), Cause::Stuck(3)]),
            None
        );
        assert_eq!(order(&one_side, 8.0).kind, CallForHelp);
        let two_sides = [stuck[0], fault(Cause::Stuck(0), 1.0)];
        assert_eq!(order(&two_sides, 8.0).kind, RecoveryKind::LimpHome);
    }

    #[test]
    fn what_comes_and_goes_is_answered_while_it_is_there() {
        let prices = MissionFile::read().unwrap().prices;
        let expected = [fault(Cause::Stuck(0), 0.4)];
        let there = [fault(Cause::Stuck(0), 1.0)];
        for (present, wanted) in [
            (&there[..], RuleOutput::remedy(Cause::Stuck(0))),
            (&[], RuleOutput::plain(RecoveryKind::GoOn)),
        ] {
            let knowledge = Knowledge {
                present,
                expected: &expected,
                rest_m: 10.0,
            };
            assert_eq!(best(&prices, &knowledge), wanted);
        }
    }
}

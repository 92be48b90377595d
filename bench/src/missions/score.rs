//! What a mission brought.

use vigil_blocks::{AnsweredWheels, RecoveryKind};

use super::breakdown::{Cause, PresentFault};
use super::prices::Prices;
use super::rules::RuleOutput;

/// Driven farther than this with a fault that nobody answers, the mission ended unsafely, m.
const UNANSWERED_MAX_M: f64 = 1.0;
/// So did one that was farther off its path, m.
const OFF_PATH_MAX_M: f64 = 1.0;
/// What is less than this share of what it grows to is not counted as unanswered.
const SEVERE: f64 = 0.5;

/// True if the rover stands under an order.
const fn stands(order: RuleOutput) -> bool {
    matches!(
        order.kind,
        RecoveryKind::None | RecoveryKind::Stop | RecoveryKind::CallForHelp
    )
}

/// True if an order is the remedy for a cause.
fn remedies(order: RuleOutput, cause: Cause) -> bool {
    use RecoveryKind::{Compensate, IgnoreEncoder, LimpHome};
    match cause {
        Cause::Stuck(wheel) => {
            matches!(order.kind, Compensate | LimpHome) && order.wheels.has_stuck(wheel)
        }
        Cause::Encoder(wheel) => {
            matches!(order.kind, IgnoreEncoder | LimpHome) && order.wheels.has_encoder(wheel)
        }
        Cause::Unmodelled => false,
    }
}

/// Price of a metre with these faults under an order, at a share of the planned speed. The price of
/// a fault that is not answered falls with the speed.
#[must_use]
pub fn price_1_m(prices: &Prices, faults: &[PresentFault], order: RuleOutput, speed: f64) -> f64 {
    let of = &prices.fault_1_m;
    let priced = faults.iter().map(|fault| {
        let price = match (fault.cause, remedies(order, fault.cause)) {
            (Cause::Stuck(_), true) => of.stuck_compensated,
            (Cause::Encoder(_), true) => of.encoder_ignored,
            (Cause::Stuck(_), false) => of.stuck * speed,
            (Cause::Encoder(_), false) => of.encoder * speed,
            (Cause::Unmodelled, _) => of.unmodelled * speed,
        };
        price * fault.severity
    });
    priced.sum::<f64>() + needless_1_m(prices, faults, order)
}

/// Price of a metre with remedies for what is not there.
fn needless_1_m(prices: &Prices, faults: &[PresentFault], order: RuleOutput) -> f64 {
    let of = &prices.needless_1_m;
    let (stuck, encoders) = (order.wheels.stuck, order.wheels.encoders);
    let there = faults.iter().map(|fault| fault.cause.wheels());
    let there = there.fold(AnsweredWheels::default(), AnsweredWheels::with);
    let steers_needlessly = stuck & !there.stuck != 0;
    let ignores_needlessly = encoders & !there.encoders != 0;
    let price = |is: bool, price: f64| if is { price } else { 0.0 };
    match order.kind {
        RecoveryKind::Compensate => price(steers_needlessly || stuck == 0, of.compensation),
        RecoveryKind::IgnoreEncoder => price(ignores_needlessly || encoders == 0, of.ignoring),
        RecoveryKind::LimpHome => {
            price(steers_needlessly, of.compensation) + price(ignores_needlessly, of.ignoring)
        }
        _ => 0.0,
    }
}

/// What adds up while a mission is driven.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    pub score: Score,
    stood: bool,
    called: bool,
    off_path_m2_s: f64,
}

/// A step of a drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<'a> {
    pub faults: &'a [PresentFault],
    pub obeyed: RuleOutput,
    /// True if standing is what who is told would do, too.
    pub may_stand: bool,
    /// Way of the body, m, and progress along the path, m.
    pub moved_m: f64,
    pub progress_m: f64,
    /// Distance from the path, m.
    pub off_path_m: f64,
    /// Speed that the path asks for, m/s.
    pub planned_m_s: f64,
    pub dt_s: f64,
}

impl Tally {
    pub(super) fn add(&mut self, prices: &Prices, step: &Step<'_>) {
        let Step { faults, obeyed, .. } = *step;
        let score = &mut self.score;
        let count = |is: bool| f64::from(u8::from(is));
        let stands = stands(obeyed);
        let calls = obeyed.kind == RecoveryKind::CallForHelp && !self.called;
        score.time_s += step.dt_s;
        score.calls += count(calls);
        let speed = (step.moved_m / step.dt_s / step.planned_m_s).min(1.0);
        let price = price_1_m(prices, faults, obeyed, speed);
        score.points += prices.progress_1_m * step.progress_m
            - prices.time_1_s * step.dt_s
            - prices.call * count(calls)
            - prices.off_path_1_m_s * step.off_path_m * step.dt_s
            - price * step.moved_m;
        if stands && !step.may_stand {
            score.needless_stops += count(!self.stood);
            score.needless_s += step.dt_s;
        }
        let open =
            |fault: &PresentFault| fault.severity >= SEVERE && !remedies(obeyed, fault.cause);
        let goes_on = obeyed.kind != RecoveryKind::SlowDown && !stands;
        if goes_on && faults.iter().any(open) {
            score.unanswered_m += step.moved_m;
        }
        self.off_path_m2_s += step.off_path_m * step.off_path_m * step.dt_s;
        score.off_path_rms_m = (self.off_path_m2_s / score.time_s).sqrt();
        score.off_path_max_m = score.off_path_max_m.max(step.off_path_m);
        let calling = obeyed.kind == RecoveryKind::CallForHelp;
        (self.stood, self.called) = (stands, calling);
    }
}

/// A mission of one commander, measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Score {
    /// Points by the prices.
    pub points: f64,
    /// Metres driven on while a fault was not answered.
    pub unanswered_m: f64,
    /// Distance from the path, m.
    pub off_path_rms_m: f64,
    /// Its largest, m.
    pub off_path_max_m: f64,
    /// Times the rover stopped though who is told would have driven on.
    pub needless_stops: f64,
    /// Time it so stood, s.
    pub needless_s: f64,
    /// Calls for help.
    pub calls: f64,
    /// Time, s.
    pub time_s: f64,
    /// 1 if the path was driven to its end.
    pub done: f64,
}

impl Score {
    /// True if the mission ended unsafely.
    #[must_use]
    pub fn is_unsafe(&self) -> bool {
        self.unanswered_m > UNANSWERED_MAX_M || self.off_path_max_m > OFF_PATH_MAX_M
    }
}

/// A figure of a mission, from its score.
#[derive(Debug, Clone, Copy)]
pub struct Measure<S> {
    /// Name with unit, as in raw data.
    pub key: &'static str,
    /// In words, with unit.
    pub name: &'static str,
    /// Its value.
    pub of: fn(&S) -> f64,
    /// Decimals shown.
    pub decimals: usize,
}

/// The points, which decide.
pub const POINTS: Measure<Score> = measure("points", "points", |s| s.points, 1);

/// Calls for help.
pub const CALLS: Measure<Score> = measure("calls", "calls for help", |s| s.calls, 3);

/// 1 for a mission that ended unsafely.
pub const UNSAFE: Measure<Score> = measure(
    "unsafe",
    "ended unsafely",
    |s| f64::from(u8::from(s.is_unsafe())),
    4,
);

/// What is reported of a mission; the points first.
pub const MEASURES: [Measure<Score>; 10] = [
    POINTS,
    measure(
        "unanswered_m",
        "driven on unanswered, m",
        |s| s.unanswered_m,
        3,
    ),
    measure(
        "off_path_rms_m",
        "off the path, rms m",
        |s| s.off_path_rms_m,
        3,
    ),
    measure("off_path_max_m", "at most, m", |s| s.off_path_max_m, 3),
    measure("needless_stops", "needless stops", |s| s.needless_stops, 3),
    measure("needless_s", "so stood, s", |s| s.needless_s, 2),
    CALLS,
    measure("time_s", "time, s", |s| s.time_s, 1),
    measure("done", "driven to the end", |s| s.done, 3),
    UNSAFE,
];

/// A figure of a mission; the fields of [`Measure`] in their order.
#[must_use]
pub const fn measure<S>(
    key: &'static str,
    name: &'static str,
    of: fn(&S) -> f64,
    decimals: usize,
) -> Measure<S> {
    Measure {
        key,
        name,
        of,
        decimals,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::prices::MissionFile;

    const fn fault(cause: Cause, severity: f64) -> PresentFault {
        PresentFault { cause, severity }
    }

    #[test]
    fn a_metre_costs_what_each_fault_does_under_the_order() {
        use RecoveryKind::{Compensate, GoOn, IgnoreEncoder, LimpHome, SlowDown};
        let prices = MissionFile::read().unwrap().prices;
        let about = |kind, causes: &[Cause]| RuleOutput {
            kind,
            wheels: causes
                .iter()
                .map(|cause| cause.wheels())
                .fold(AnsweredWheels::default(), AnsweredWheels::with),
        };
        let order = |kind, wheel: Option<usize>| match (kind, wheel) {
            (_, None) => about(kind, &[]),
            (IgnoreEncoder, Some(wheel)) => about(kind, &[Cause::Encoder(wheel)]),
            (_, Some(wheel)) => about(kind, &[Cause::Stuck(wheel)]),
        };
        let limp = |causes: &[Cause]| about(LimpHome, causes);
        let stuck = [fault(Cause::Stuck(4), 1.0)];
        let encoder = [fault(Cause::Encoder(0), 1.0)];
        let both = [stuck[0], encoder[0]];
        let half = [fault(Cause::Unmodelled, 0.5)];
        let (jam, lie) = (Cause::Stuck(4), Cause::Encoder(0));
        let cases: [(&[PresentFault], RuleOutput, f64, f64); 15] = [
            (&both, limp(&[jam, lie]), 0.7, 12.5),
            (&stuck, limp(&[jam, lie]), 0.7, 15.0),
            (&encoder, limp(&[jam, lie]), 0.7, 102.5),
            (&encoder, limp(&[lie, Cause::Encoder(2)]), 0.7, 7.5),
            (&both, limp(&[jam]), 0.7, 10.0 + 52.5),
            (&[], order(GoOn, None), 1.0, 0.0),
            (&[], order(Compensate, Some(1)), 0.7, 100.0),
            (&stuck, order(GoOn, None), 1.0, 200.0),
            (&stuck, order(SlowDown, None), 0.5, 100.0),
            (&stuck, order(Compensate, Some(4)), 0.7, 10.0),
            (&stuck, order(Compensate, Some(1)), 0.5, 200.0),
            (&encoder, order(IgnoreEncoder, Some(0)), 1.0, 2.5),
            (&encoder, order(IgnoreEncoder, Some(3)), 1.0, 80.0),
            (&both, order(Compensate, Some(4)), 1.0, 85.0),
            (&half, order(SlowDown, None), 0.5, 87.5),
        ];
        for (faults, order, speed, wanted) in cases {
            let found = price_1_m(&prices, faults, order, speed);
            assert!(
                (found - wanted).abs() < 1e-9,
                "{faults:?} {order:?}: {found}"
            );
        }
    }

    #[test]
    fn sums_over_a_mission_are_exact() {
        let prices = MissionFile::read().unwrap().prices;
        let mut tally = Tally::default();
        let stuck = [fault(Cause::Stuck(1), 1.0)];
        use RecoveryKind::{CallForHelp, GoOn};
        // Two seconds each: healthy, unanswered, answered, and a call.
        let script = [
            (&[][..], RuleOutput::plain(GoOn), 0.4),
            (&stuck, RuleOutput::plain(GoOn), 0.4),
            (&stuck, RuleOutput::remedy(Cause::Stuck(1)), 0.2),
            (&stuck, RuleOutput::plain(CallForHelp), 0.0),
        ];
        for (faults, obeyed, way_m) in script {
            for _ in 0..100 {
                tally.add(
                    &prices,
                    &Step {
                        faults,
                        obeyed,
                        may_stand: false,
                        moved_m: way_m / 100.0,
                        progress_m: way_m / 200.0,
                        off_path_m: 0.1,
                        planned_m_s: 0.2,
                        dt_s: 0.02,
                    },
                );
            }
        }
        let score = tally.score;
        // Progress .5 m; 8 s; a call; 0.8 m s off the path; 0.4 m at 200 and 0.2 m at 10.
        let points = 25.0 - 8.0 - 300.0 - 16.0 - 80.0 - 2.0;
        assert!((score.points - points).abs() < 1e-9, "{}", score.points);
        assert!((score.unanswered_m - 0.4).abs() < 1e-9);
        assert!((score.off_path_rms_m - 0.1).abs() < 1e-9 && !score.is_unsafe());
        assert_eq!((score.calls, score.needless_stops), (1.0, 1.0));
        assert!((score.needless_s - 2.0).abs() < 1e-9);
    }
}

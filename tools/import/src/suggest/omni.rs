//! A robot with three omnidirectional wheels: from the command alone follows how each is mounted.

use super::draft::{Draft, DraftChannel};
use super::names::{Guess, number};
use super::signals::{How, fit2};
use super::{Evidence, NamedColumn};

/// Correlation from which a wheel's direction is known.
const SURE: f64 = 0.8;
/// Distance of the wheels from the centre where no turn was commanded, m.
const REACH_M: f64 = 0.125;

/// Drafts the robot; false if it has not three numbered wheels and a command of two directions.
pub(super) fn draft(evidence: &Evidence, draft: &mut Draft) -> bool {
    let mut wheels: Vec<&NamedColumn> = evidence
        .guessed(|guess| guess == Guess::WheelRate)
        .collect();
    wheels.sort_by_key(|found| number(&found.column));
    let forward = evidence.guessed(|guess| guess == Guess::Command(0)).next();
    let left = evidence.guessed(|guess| guess == Guess::Command(1)).next();
    let ([_, _, _], Some(forward), Some(left)) = (wheels.as_slice(), forward, left) else {
        return false;
    };
    let commanded = |found: &NamedColumn| {
        evidence
            .signals
            .cells(found.table, &found.column, How::Hold)
    };
    let (vx, vy) = (commanded(forward), commanded(left));
    let mut mounted = Vec::new();
    for wheel in &wheels {
        let rates = evidence
            .signals
            .cells(wheel.table, &wheel.column, How::Mean);
        let Some(fit) = fit2(&rates, &vx, &vy).filter(|fit| fit.correlation >= SURE) else {
            return false;
        };
        // A wheel at the angle a rolls by -sin(a) forward + cos(a) left, over its radius.
        let [x, y] = fit.factors;
        mounted.push(((-x).atan2(y), 1.0 / x.hypot(y), rates));
    }
    draft.kinematics = "omni3";
    draft.radius_m = mounted.iter().map(|(_, radius_m, _)| radius_m).sum::<f64>() / 3.0;
    let largest = |values: &[f64]| {
        values
            .iter()
            .filter(|v| v.is_finite())
            .fold(0.0_f64, |all, v| all.max(v.abs()))
    };
    draft.command = vec![
        ("cmd_forward", "m/s", 1.2 * largest(&vx)),
        ("cmd_left", "m/s", 1.2 * largest(&vy)),
    ];
    for (name, found) in [("cmd_forward", forward), ("cmd_left", left)] {
        let channel = DraftChannel::new(name, found.table, &found.column);
        draft.channels.push(channel.with("method", "\"hold\""));
    }
    draft.measured.wheel_rates = true;
    for ((wheel, (angle, _, rates)), name) in wheels.iter().zip(&mounted).zip(["A", "B", "C"]) {
        let (y, x) = angle.sin_cos();
        draft.wheels.push((name.into(), REACH_M * x, REACH_M * y));
        let channel = DraftChannel::new(format!("enc_{name}"), wheel.table, &wheel.column);
        let note = format!(
            "Mounted at {:.0} degrees by the command.",
            angle.to_degrees()
        );
        draft.channels.push(channel.noted(note));
        draft.rate_rad_s = draft.rate_rad_s.max(3.0 * largest(rates));
    }
    draft.unsure.push(format!(
        "the wheels' distance of {REACH_M} m from the centre is assumed"
    ));
    let note = "the radius is that of the command, gears and slip included";
    draft.unsure.push(note.into());
    currents(evidence, draft);
    true
}

fn currents(evidence: &Evidence, draft: &mut Draft) {
    let mut own: Vec<&NamedColumn> = evidence
        .guessed(|guess| guess == Guess::WheelCurrent)
        .collect();
    own.sort_by_key(|found| number(&found.column));
    if let [a, b, c] = own.as_slice() {
        draft.measured.currents = true;
        for (found, name) in [a, b, c].into_iter().zip(["A", "B", "C"]) {
            let name = format!("current_{name}");
            draft
                .channels
                .push(DraftChannel::new(name, found.table, &found.column));
        }
    }
}

//! A robot with driven wheels left and right: which are they, and what do the data say of their
//! radius, distance and signs.

use super::draft::{Draft, DraftChannel, number};
use super::names::Guess;
use super::signals::{Fit, How, fit_runs, fit2};
use super::wheels::{Wheels, currents, wheel_channel, wheels};
use super::{Evidence, NamedColumn};

/// Correlation from which a fit decides.
const SURE: f64 = 0.8;
/// Radius that is assumed where only its product with a counter's steps shows, m.
const RADIUS_M: f64 = 0.1;
/// Radii that a wheel may have, m.
const RADII_M: std::ops::RangeInclusive<f64> = 0.01..=1.0;
/// Distance between the wheels where nothing tells it, m.
const TRACK_M: f64 = 0.4;
/// Limits are this much above the largest command of the log, wheel rates this much: a fast wheel
/// may also spin.
const LIMIT_FACTOR: f64 = 1.2;
const RATE_FACTOR: f64 = 3.0;

/// Motion that the wheels are compared with.
struct Reference<'a> {
    /// Speed, m/s.
    forward: &'a [f64],
    /// Yaw rate, rad/s.
    turn: &'a [f64],
    /// Whose motion it is.
    whose: &'a str,
}

/// How far a wheel turns, in its own unit.
struct Turning {
    /// For each metre forward.
    per_m: f64,
    /// For each radian to the left.
    per_rad: f64,
}

/// The command's forward and yaw axes.
struct Axes {
    table: usize,
    forward: String,
    turn: String,
}

/// Drafts the robot; false if there are neither wheels nor a command.
pub(super) fn draft(evidence: &Evidence, draft: &mut Draft) -> bool {
    let wheels = wheels(evidence);
    let axes = axes(evidence);
    if wheels.is_none() && axes.is_none() {
        return false;
    }
    draft.kinematics = "differential";
    let gyro = evidence
        .guessed(|guess| guess == Guess::Gyro)
        .next()
        .cloned();
    if evidence.guessed(|guess| guess == Guess::Gyro).count() > 1
        && let Some(gyro) = &gyro
    {
        let note = format!(
            "of several gyros that of {} is taken",
            evidence.table(gyro.table)
        );
        draft.unsure.push(note);
    }
    let (track_m, gyro_scale) = match (&axes, &wheels) {
        (Some(axes), _) => commanded(evidence, (axes, wheels.as_ref(), gyro.as_ref()), draft),
        (None, Some(wheels)) => uncommanded(evidence, (wheels, gyro.as_ref()), draft),
        (None, None) => (TRACK_M, 1.0),
    };
    let y = track_m / 2.0;
    draft.wheels = vec![("L".into(), 0.0, y), ("R".into(), 0.0, -y)];
    if let Some(gyro) = gyro {
        draft.measured.yaw_rate = true;
        let channel = DraftChannel::new("yaw_rate", gyro.table, &gyro.column).scaled(gyro_scale);
        draft.channels.push(channel);
    }
    if let Some(wheels) = &wheels {
        currents(evidence, wheels, draft);
    }
    true
}

fn axes(evidence: &Evidence) -> Option<Axes> {
    let table = evidence.best_table(&[Guess::Command(0), Guess::Command(2)])?;
    let of = |table, axis| {
        evidence
            .column(table, Guess::Command(axis))
            .map(str::to_owned)
    };
    let complete = (of(table, 0), of(table, 2));
    match complete {
        (Some(forward), Some(turn)) => Some(Axes {
            table,
            forward,
            turn,
        }),
        // A command that never turned, or never drove: its other axis is still there.
        (Some(forward), None) => {
            let turn = forward.replace("linear.x", "angular.z");
            has_column(evidence, table, &turn).then_some(Axes {
                table,
                forward,
                turn,
            })
        }
        (None, Some(turn)) => {
            let forward = turn.replace("angular.z", "linear.x");
            has_column(evidence, table, &forward).then_some(Axes {
                table,
                forward,
                turn,
            })
        }
        (None, None) => None,
    }
}

fn has_column(evidence: &Evidence, table: usize, column: &str) -> bool {
    let table = evidence.tables.get(table);
    let is_there = table.is_some_and(|table| table.columns.iter().any(|c| c.name == column));
    is_there && evidence.found.iter().all(|found| found.column != column)
}

fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .filter(|value| value.is_finite())
        .fold(0.0, |all, value| all.max(value.abs()))
}

/// A robot whose command is known. Returns the distance between its wheels, m, and the factor of
/// its gyro.
fn commanded(
    evidence: &Evidence,
    (axes, wheels, gyro): (&Axes, Option<&Wheels>, Option<&NamedColumn>),
    draft: &mut Draft,
) -> (f64, f64) {
    let cells = |column: &str| evidence.signals.cells(axes.table, column, How::Hold);
    let (forward, turn) = (cells(&axes.forward), cells(&axes.turn));
    let limit = |values: &[f64]| match largest(values) {
        largest if largest > 0.0 => LIMIT_FACTOR * largest,
        _ => 1.0,
    };
    draft.command = vec![
        ("cmd_speed", "m/s", limit(&forward)),
        ("cmd_yaw_rate", "rad/s", limit(&turn)),
    ];
    for (name, column) in [("cmd_speed", &axes.forward), ("cmd_yaw_rate", &axes.turn)] {
        let channel = DraftChannel::new(name, axes.table, column).with("method", "\"hold\"");
        draft.channels.push(channel);
    }
    for (name, values) in [("cmd_speed", &forward), ("cmd_yaw_rate", &turn)] {
        if largest(values) <= 0.0 {
            draft
                .unsure
                .push(format!("{name} is 0 in all that was looked at"));
        }
    }
    let reckoned = odometry(evidence);
    let reference = match &reckoned {
        Some([forward, turn]) => Reference {
            forward,
            turn,
            whose: "odometry",
        },
        None => Reference {
            forward: &forward,
            turn: &turn,
            whose: "command",
        },
    };
    let whose = reference.whose;
    let track_m = wheels.map(|wheels| {
        let [left, right] = wheel_scales(evidence, wheels, &reference, draft);
        let track_m = track(&left, &right);
        if let Some(track_m) = track_m {
            let note = format!("the wheels' distance of {track_m:.3} m is that of the {whose}");
            draft.unsure.push(note);
        }
        track_m.unwrap_or(TRACK_M)
    });
    if track_m == Some(TRACK_M) || track_m.is_none() {
        draft
            .unsure
            .push(format!("the wheels' distance of {TRACK_M} m is assumed"));
    }
    let gyro_scale = gyro.map(|gyro| {
        let measured = evidence.signals.cells(gyro.table, &gyro.column, How::Mean);
        let found = fit_runs(&measured, &turn, &evidence.signals.runs());
        rate_scale(found, draft)
    });
    (track_m.unwrap_or(TRACK_M), gyro_scale.unwrap_or(1.0))
}

/// Speed and yaw rate as the robot's own odometry reckons them: it knows radius and distance.
fn odometry(evidence: &Evidence) -> Option<[Vec<f64>; 2]> {
    let speed = evidence.guessed(|guess| guess == Guess::Speed).next()?;
    let yaw_rate = speed.column.replace("linear.x", "angular.z");
    let cells = |column: &str| evidence.signals.cells(speed.table, column, How::Mean);
    Some([cells(&speed.column), cells(&yaw_rate)])
}

/// Factor of a gyro that reads `slope` times a yaw rate.
fn rate_scale(found: Option<Fit>, draft: &mut Draft) -> f64 {
    let Some(fit) = found.filter(|fit| fit.correlation >= 0.5) else {
        draft
            .unsure
            .push("unit and sign of the gyro could not be checked".into());
        return 1.0;
    };
    let slope = fit.factors[0];
    let is_degrees = (20.0..170.0).contains(&slope.abs());
    let note = format!("the gyro reads {slope:.3} times the commanded yaw rate");
    match (is_degrees, slope < 0.0) {
        (false, false) => return 1.0,
        (true, _) => draft.unsure.push(format!("{note}: taken as degrees")),
        (false, true) => draft
            .unsure
            .push(format!("{note}: taken as positive to the right")),
    }
    let unit = if is_degrees {
        std::f64::consts::PI / 180.0
    } else {
        1.0
    };
    unit.copysign(slope)
}

/// Radius of the wheels, m, and factor of their rates, from the metres that a unit of them makes.
fn radius(per_unit_m: f64, is_rate: bool, (whose, draft): (&str, &mut Draft)) -> (f64, f64) {
    match per_unit_m {
        radius if !radius.is_finite() => {
            let note = "unit, signs and radius of the wheels could not be found from the";
            draft.unsure.push(format!("{note} {whose}"));
            (RADIUS_M, 1.0)
        }
        radius if is_rate && (0.8..1.25).contains(&radius) => {
            draft
                .unsure
                .push("the wheels' rates look like m/s: their radius is assumed".into());
            (RADIUS_M, 1.0 / RADIUS_M)
        }
        radius if is_rate && RADII_M.contains(&radius) => {
            let note = format!("a wheel radius of {radius:.4} m is that of the {whose}");
            draft.unsure.push(note);
            (radius, 1.0)
        }
        radius => {
            let note = "of counters only radius times step shows: the radius is assumed";
            draft.unsure.push(note.into());
            (RADIUS_M, radius / RADIUS_M)
        }
    }
}

/// Adds the channels of the wheels. Returns for each side its rate per speed and per yaw rate.
fn wheel_scales(
    evidence: &Evidence,
    wheels: &Wheels,
    reference: &Reference<'_>,
    draft: &mut Draft,
) -> [Turning; 2] {
    let Reference {
        forward,
        turn,
        whose,
    } = *reference;
    let modulus = wheels.modulus(evidence);
    let how = wheels.how(modulus);
    let rate = |columns: &[String]| {
        evidence
            .signals
            .sum(wheels.table, &Wheels::terms(columns), how)
    };
    let measured = [rate(&wheels.left), rate(&wheels.right)];
    let fits = measured
        .each_ref()
        .map(|rates| fit2(rates, forward, turn).filter(|fit| fit.correlation >= SURE));
    let factors = fits.map(|fit| fit.map_or([f64::NAN; 2], |fit| fit.factors));
    // Wheels turn forwards by so much for each metre.
    let per_metre = (factors[0][0].abs() + factors[1][0].abs()) / 2.0;
    let is_rate = wheels.guess == Guess::WheelRate;
    let (radius_m, scale) = radius(1.0 / per_metre, is_rate, (whose, draft));
    draft.radius_m = radius_m;
    draft.measured.wheel_rates = true;
    let sides = [("enc_L", &wheels.left), ("enc_R", &wheels.right)];
    for (((name, columns), [own, _]), rates) in sides.into_iter().zip(factors).zip(&measured) {
        let sign = if own < 0.0 { -1.0 } else { 1.0 };
        if own < 0.0 {
            draft.unsure.push(format!(
                "{name} counts backwards when the robot drives forwards"
            ));
        }
        let mut channel = wheel_channel(name, (wheels, columns, modulus), draft);
        if factors[0][0].is_finite() {
            let text = format!("{} a metre of the {whose}.", number(per_metre));
            channel = channel.noted(text);
        }
        draft.channels.push(channel.scaled(sign * scale));
        draft.rate_rad_s = draft.rate_rad_s.max(RATE_FACTOR * scale * largest(rates));
    }
    let [left, right] = factors.map(|[forward, turn]| {
        let sign = if forward < 0.0 { -1.0 } else { 1.0 };
        Turning {
            per_m: sign * forward,
            per_rad: sign * turn,
        }
    });
    if left.per_rad > 0.0 && right.per_rad < 0.0 {
        let note = "left and right look exchanged, or the commanded yaw rate is positive to the \
                    right";
        draft.unsure.push(note.into());
    } else if !wheels.is_side_sure {
        draft
            .unsure
            .push("which wheel is left is taken from their order".into());
    }
    [left, right]
}

/// Distance between the wheels from their rates per speed and per yaw rate, m.
fn track(left: &Turning, right: &Turning) -> Option<f64> {
    let track_m = (right.per_rad - left.per_rad) / ((left.per_m + right.per_m) / 2.0);
    (track_m.abs() > 0.05 && track_m.abs() < 5.0).then_some(track_m.abs())
}

/// A robot without a recorded command: its wheels' speeds take the place of one.
fn uncommanded(
    evidence: &Evidence,
    (wheels, gyro): (&Wheels, Option<&NamedColumn>),
    draft: &mut Draft,
) -> (f64, f64) {
    let modulus = wheels.modulus(evidence);
    let how = wheels.how(modulus);
    let side = |columns: &[String]| {
        evidence
            .signals
            .sum(wheels.table, &Wheels::terms(columns), how)
    };
    let (left, right) = (side(&wheels.left), side(&wheels.right));
    let difference: Vec<f64> = right.iter().zip(&left).map(|(r, l)| r - l).collect();
    let found = gyro.and_then(|gyro| {
        let measured = evidence.signals.cells(gyro.table, &gyro.column, How::Mean);
        fit_runs(&measured, &difference, &evidence.signals.runs())
    });
    let slope = found
        .filter(|fit| fit.correlation >= 0.5)
        .map(|fit| fit.factors[0]);
    let (track_m, gyro_scale) = match slope {
        Some(slope) => {
            let note = "the wheels' distance is the gyro's, slip included";
            draft
                .unsure
                .push(format!("{note}: {:.3} m", 1.0 / slope.abs()));
            if slope < 0.0 {
                let note = "the gyro is positive to the right, or left and right are exchanged";
                draft.unsure.push(note.into());
            }
            (1.0 / slope.abs(), 1.0_f64.copysign(slope))
        }
        None => {
            draft
                .unsure
                .push(format!("the wheels' distance of {TRACK_M} m is assumed"));
            (TRACK_M, 1.0)
        }
    };
    let note = "no command was recognised: mean and difference of the wheels' speeds take its \
                place, taken as m/s; a wheel's fault is then part of the command";
    draft.unsure.push(note.into());
    let add = |name: &str, (l, r): (f64, f64), draft: &mut Draft| {
        let mut channel = wheel_channel(name, (wheels, &[], modulus), draft);
        let scaled = |columns: &[String], factor: f64| {
            let terms = Wheels::terms(columns).into_iter();
            terms
                .map(move |(column, own)| (column, own * factor))
                .collect::<Vec<_>>()
        };
        channel.terms = [scaled(&wheels.left, l), scaled(&wheels.right, r)].concat();
        if wheels.guess == Guess::WheelRate {
            channel = channel.with("method", "\"hold\"");
        }
        draft.channels.push(channel);
    };
    add("cmd_speed", (0.5, 0.5), draft);
    add("cmd_yaw_rate", (-1.0 / track_m, 1.0 / track_m), draft);
    let speed = LIMIT_FACTOR * largest(&left).max(largest(&right));
    let yaw_rate = LIMIT_FACTOR * largest(&difference) / track_m;
    draft.command = vec![
        ("cmd_speed", "m/s", speed),
        ("cmd_yaw_rate", "rad/s", yaw_rate),
    ];
    draft.rate_rad_s = RATE_FACTOR * speed / draft.radius_m;
    (track_m, gyro_scale)
}

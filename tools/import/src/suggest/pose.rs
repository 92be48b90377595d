//! A measured pose: which columns, and how their frame lies to the robot's motion.

use std::f64::consts::{PI, TAU};

use super::draft::{Draft, DraftChannel};
use super::names::Guess;
use super::signals::{How, Moved, PlaneFit, plane_fit};
use super::{Evidence, NamedColumn};

/// Correlation from which the frame of a pose is known from the motion, and how much better another
/// must fit than the one as it stands.
const SURE: f64 = 0.7;
const BETTER: f64 = 0.05;
/// Scales and angles that count as none: a log's commands are not exact.
const SCALE_FREE: std::ops::RangeInclusive<f64> = 0.8..=1.25;
const ANGLE_FREE_RAD: f64 = 0.2;

/// Columns of a pose.
struct PoseColumns<'a> {
    table: usize,
    x: &'a str,
    y: &'a str,
    yaw: &'a str,
}

/// One way to read the pose.
struct Way {
    yaw_sign: f64,
    is_mirrored: bool,
    fit: PlaneFit,
}

/// The table of a pose that is measured.
fn table(evidence: &Evidence, draft: &mut Draft) -> Option<usize> {
    let all = [Guess::Pose(0), Guess::Pose(1), Guess::Pose(2)];
    let complete = |table: &usize| all.iter().all(|g| evidence.column(*table, *g).is_some());
    let tables = || (0..evidence.tables.len()).filter(complete);
    let is_reckoned = |table: &usize| {
        let name = evidence.table(*table).to_lowercase();
        name.contains("odom") && draft.measured.wheel_rates
    };
    let measured = tables().find(|table| !is_reckoned(table));
    if let (None, Some(odometry)) = (measured, tables().next()) {
        draft.unsure.push(format!(
            "the pose of {} is left out: it may be reckoned from the wheels",
            evidence.table(odometry)
        ));
    }
    measured
}

/// Adds the pose, if there is one that the wheels were not integrated to.
pub(super) fn draft(evidence: &Evidence, draft: &mut Draft) {
    let Some(table) = table(evidence, draft) else {
        return;
    };
    let column = |axis| {
        evidence
            .column(table, Guess::Pose(axis))
            .unwrap_or_default()
            .to_owned()
    };
    let [x, y, yaw] = [0, 1, 2].map(column);
    let is_degrees = evidence.tables.get(table).is_some_and(|table| {
        let own = table.columns.iter().find(|column| column.name == yaw);
        own.is_some_and(|own| own.values.iter().any(|value| value.abs() > 1.2 * PI))
    });
    let factor = if is_degrees { PI / 180.0 } else { 1.0 };
    let way = way(
        evidence,
        draft,
        &PoseColumns {
            table,
            x: &x,
            y: &y,
            yaw: &yaw,
        },
        factor,
    );
    draft.measured.pose = true;
    let (mut xs, mut ys) = (vec![(x.clone(), 1.0)], vec![(y.clone(), 1.0)]);
    let mut yaw_scale = 1.0;
    match way {
        None => draft
            .unsure
            .push("unit and frame of the pose could not be checked".into()),
        Some(way) => {
            yaw_scale = way.yaw_sign;
            if let Some(terms) = terms(&way, [&x, &y]) {
                [xs, ys] = terms;
                draft.unsure.push(format!(
                    "the pose's frame is brought to the commanded motion, slip included: scale \
                     {:.6}{}",
                    1.0 / way.fit.factor[0].hypot(way.fit.factor[1]),
                    if way.is_mirrored { ", mirrored" } else { "" }
                ));
            }
        }
    }
    for (name, terms) in [("x", xs), ("y", ys)] {
        let mut channel = DraftChannel::new(name, table, "").with("method", "\"interpolate\"");
        channel.terms = terms;
        draft.channels.push(channel);
    }
    let mut channel = DraftChannel::new("yaw", table, &yaw).with("method", "\"interpolate\"");
    if is_degrees {
        channel = channel.with("unit", "\"deg\"");
        draft
            .unsure
            .push("the pose's yaw is taken as degrees".into());
    }
    draft
        .channels
        .push(channel.with("angle", true).scaled(yaw_scale));
}

/// The way of reading the pose that the commanded motion fits best.
fn way(evidence: &Evidence, draft: &Draft, columns: &PoseColumns<'_>, factor: f64) -> Option<Way> {
    let PoseColumns { table, x, y, yaw } = *columns;
    let rate = |column| evidence.signals.cells(table, column, How::Rate(None));
    let (dx, dy) = (rate(x), rate(y));
    let yaws = evidence.signals.cells(table, yaw, How::Hold);
    let turned = evidence.signals.cells(table, yaw, How::AngleRate(factor));
    let command = |axis| {
        let own: Option<&NamedColumn> = evidence
            .guessed(|guess| guess == Guess::Command(axis))
            .next();
        own.map(|own| evidence.signals.cells(own.table, &own.column, How::Hold))
    };
    let forward = command(0)?;
    let left = command(1).filter(|_| draft.kinematics == "omni3");
    let left = left.unwrap_or_else(|| vec![0.0; forward.len()]);
    let cell_s = evidence.signals.cell_s;
    let fits =
        [(1.0, false), (1.0, true), (-1.0, true), (-1.0, false)].map(|(yaw_sign, is_mirrored)| {
            let world = dx.iter().zip(&dy);
            let body = forward.iter().zip(&left);
            let angles = yaws.iter().zip(&turned);
            let pairs = world
                .zip(body)
                .zip(angles)
                .map(|(((dx, dy), (vx, vy)), (yaw, turned))| {
                    // Half-way through the cell.
                    let angle = yaw_sign * (yaw * factor - turned * cell_s / 2.0) % TAU;
                    let (s, c) = angle.sin_cos();
                    let dy = if is_mirrored { -dy } else { *dy };
                    Moved {
                        world: [*dx, dy],
                        body: [c * vx - s * vy, s * vx + c * vy],
                    }
                });
            let fit = plane_fit(&pairs.collect::<Vec<_>>())?;
            Some(Way {
                yaw_sign,
                is_mirrored,
                fit,
            })
        });
    let mut best: Option<Way> = None;
    for way in fits.into_iter().flatten() {
        let floor = best
            .as_ref()
            .map_or(SURE, |best| best.fit.correlation + BETTER);
        if way.fit.correlation >= floor {
            best = Some(way);
        }
    }
    best
}

/// x and y in m along the frame in which the robot drives as it says; none if they stand so.
fn terms(way: &Way, axes: [&str; 2]) -> Option<[Vec<(String, f64)>; 2]> {
    let ([x, y], [re, im]) = (axes, way.fit.factor);
    let scale = re.hypot(im);
    let is_plain = SCALE_FREE.contains(&scale) && im.atan2(re).abs() < ANGLE_FREE_RAD;
    if is_plain && !way.is_mirrored {
        return None;
    }
    // The inverse of the factor turns the world's axes into those of the robot's yaw.
    let (c, s) = match is_plain {
        true => (1.0, 0.0),
        false => (re / (scale * scale), im / (scale * scale)),
    };
    // Axes that nearly coincide are taken as the same.
    let whole = c.hypot(s);
    let clean = |part: f64| if part.abs() < 0.05 * whole { 0.0 } else { part };
    let sign = if way.is_mirrored { -1.0 } else { 1.0 };
    let (c, s) = (clean(c), clean(s));
    let terms = |of_x: f64, of_y: f64| {
        let terms = [(x.to_owned(), of_x), (y.to_owned(), of_y)];
        terms
            .into_iter()
            .filter(|(_, factor)| *factor != 0.0)
            .collect()
    };
    Some([terms(c, s * sign), terms(-s, c * sign)])
}

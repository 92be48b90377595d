//! A real Robotino that drives from one ground onto another: is the change told, and told as no
//! fault? Each heading is judged by what was learned from the others.

use std::collections::BTreeMap;
use std::error::Error;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use vigil_blocks::{DetectionBelief, Entry, ParticleBlock, SensorFrame};
use vigil_diagnosis::detect::{Detector, Settings};
use vigil_evaluation::parallel::in_parallel;
use vigil_learning::channel_learning::{LabelledChange, Log, TOLD_S, learn};
use vigil_recording::frames::Run;
use vigil_robot::channel_model::Model;
use vigil_robot::{ChannelMap, Description};
use vigil_terminal::output;

use crate::real_logs::logs;

/// Where a border lies across the recordings' pose, m, by the folder of the runs that cross it.
/// Fitted once, to where the speeds of these runs change.
const BORDERS: [(&str, f64); 2] = [("green_table", -1.974_388), ("table_gray", -2.294_828)];
/// Frames on either side over which a wheel's place is averaged.
const SMOOTHED: usize = 4;
/// A run counts as one that crosses if its speed changes by so many deviations.
const CLEAR: f64 = 2.0;
/// Runs on one ground that are judged, of each ground, and the seed of their choice.
const STILL: usize = 5;
const SEED: u64 = 1;
/// Width of a heading, degrees.
const HEADING_DEG: f64 = 30.0;
/// Mean time between false alarms, h.
const INTERVAL_H: f64 = 24.0;

/// What a run shows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Kind {
    /// Wheels cross a border, the first one then, s.
    Crosses(f64),
    /// It drives over two grounds, but is not known to cross, or not clearly.
    Unclear,
    /// One ground.
    Still,
}

/// A run, its label and what was told of it.
#[derive(Debug, Clone, Serialize)]
pub struct JudgedRun {
    /// Name of its file.
    pub name: String,
    /// What it shows.
    pub kind: Kind,
    /// When wheels cross the border, s.
    pub crossings_s: Vec<f64>,
    /// True for one of the twenty runs on one ground.
    pub is_chosen: bool,
    /// Changes that were told: when they came, s.
    pub changes_s: Vec<f64>,
    /// And when that was told, s.
    pub told_s: Vec<f64>,
    /// Alarms.
    pub alarms: u32,
}

struct Labelled {
    run: Run,
    name: String,
    ground: String,
    kind: Kind,
    crossings_s: Vec<f64>,
    heading: u32,
    is_chosen: bool,
}

/// All runs but the unclear ones, each judged by a model that has not seen its heading.
///
/// # Errors
/// A log that is missing or supports no model.
pub fn found() -> Result<Vec<JudgedRun>, Box<dyn Error>> {
    let log = logs::log("robotino_slip", "robotino")?;
    let clear = clear()?;
    let mut all: Vec<Labelled> = log
        .runs
        .into_iter()
        .zip(log.names)
        .map(|(run, name)| labelled(run, name, &log.robot, &clear))
        .collect();
    choose(&mut all);
    all.retain(|one| one.kind != Kind::Unclear);
    let mut headings: Vec<u32> = all.iter().map(|one| one.heading).collect();
    headings.sort_unstable();
    headings.dedup();
    let fold = |heading: &u32| {
        let judged = fold(&all, *heading, &log.robot);
        judged.map_err(|error| format!("heading {heading}: {error}"))
    };
    let mut out = Vec::new();
    for judged in in_parallel(&headings, fold) {
        out.extend(judged?);
    }
    Ok(out)
}

/// By how many deviations the speed of each run over two grounds changes.
fn clear() -> Result<BTreeMap<String, f64>, Box<dyn Error>> {
    let path = logs::unpacked("robotino_slip")?.join("derived_change_points.csv");
    let text = std::fs::read_to_string(&path)?;
    let mut out = BTreeMap::new();
    for row in text.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        if let [file, .., z] = cells[..] {
            out.insert(file.to_owned(), z.trim().parse()?);
        }
    }
    Ok(out)
}

fn labelled(
    run: Run,
    name: String,
    robot: &Description,
    clear: &BTreeMap<String, f64>,
) -> Labelled {
    let mut parts = name.rsplit('/').skip(1);
    let ground = parts.next().unwrap_or_default().to_owned();
    let border = BORDERS.iter().find(|(folder, _)| *folder == ground);
    let is_clear = clear
        .iter()
        .any(|(file, z)| name.ends_with(file.as_str()) && *z > CLEAR);
    let crossings_s = border.map_or_else(Vec::new, |(_, line)| crossings_s(&run, robot, *line));
    let kind = match (border, crossings_s.first()) {
        (None, _) => Kind::Still,
        (Some(_), Some(first_s)) if is_clear => Kind::Crosses(*first_s),
        (Some(_), _) => Kind::Unclear,
    };
    let heading = run.frames.first().map_or(0, heading);
    Labelled {
        run,
        name,
        ground,
        kind,
        crossings_s,
        heading,
        is_chosen: false,
    }
}

fn heading(frame: &SensorFrame) -> u32 {
    let [forward, left] = [0, 1].map(|axis| frame.commanded(axis).unwrap_or(0.0));
    let degrees = left.atan2(forward).to_degrees().rem_euclid(360.0);
    let places = (360.0 / HEADING_DEG) as u32;
    (degrees / HEADING_DEG).round() as u32 % places * HEADING_DEG as u32
}

/// When wheels cross a border, s, in order.
fn crossings_s(run: &Run, robot: &Description, line: f64) -> Vec<f64> {
    let map = ChannelMap::new(robot);
    let frames = run.frames.iter();
    let poses: Vec<(f64, [f64; 3])> = frames
        .filter_map(|frame| Some((frame.header.t_capture_ns as f64 * 1e-9, map.pose(frame)?)))
        .collect();
    let mut out = Vec::new();
    for wheel in &robot.wheels {
        let beyond = poses
            .iter()
            .map(|(_, [_, y, yaw])| y + wheel.x * yaw.sin() + wheel.y * yaw.cos() - line);
        let beyond: Vec<f64> = beyond.collect();
        let side = |i: usize| {
            let (from, to) = (
                i.saturating_sub(SMOOTHED),
                (i + SMOOTHED + 1).min(beyond.len()),
            );
            beyond[from..to].iter().sum::<f64>() > 0.0
        };
        let crosses = (1..beyond.len()).filter(|&i| side(i) != side(i - 1));
        out.extend(crosses.map(|i| poses[i].0));
    }
    out.sort_by(f64::total_cmp);
    out
}

/// Chooses the runs on one ground that are judged beside those that cross.
fn choose(all: &mut [Labelled]) {
    let mut grounds: Vec<String> = all.iter().map(|one| one.ground.clone()).collect();
    grounds.sort();
    grounds.dedup();
    let mut rng = Pcg64Mcg::seed_from_u64(SEED);
    for ground in grounds {
        let of = |one: &Labelled| one.kind == Kind::Still && one.ground == ground;
        let mut places: Vec<usize> = (0..all.len()).filter(|&i| of(&all[i])).collect();
        places.shuffle(&mut rng);
        for place in places.into_iter().take(STILL) {
            all[place].is_chosen = true;
        }
    }
}

fn fold(all: &[Labelled], heading: u32, robot: &Description) -> Result<Vec<JudgedRun>, String> {
    let (left_out, others): (Vec<&Labelled>, Vec<&Labelled>) =
        all.iter().partition(|one| one.heading == heading);
    let healthy: Vec<Run> = others.iter().map(|one| one.run.clone()).collect();
    let groups = others
        .iter()
        .map(|one| (one.run.id, one.heading.to_string()));
    let groups: Vec<(u32, String)> = groups.collect();
    let change = |one: &&Labelled| match one.kind {
        Kind::Crosses(onset_s) => Some(LabelledChange {
            run: one.run.id,
            context: "ground",
            onset_s,
        }),
        Kind::Unclear | Kind::Still => None,
    };
    let changes: Vec<LabelledChange<'_>> = others.iter().filter_map(change).collect();
    let log = Log {
        changes: &changes,
        groups: &groups,
        ..Log::of_healthy(&healthy)
    };
    let (model, report) = learn(&log, robot).map_err(|error| error.to_string())?;
    let said: Vec<String> = report.contexts.iter().map(ToString::to_string).collect();
    let thresholds = model.contexts.change.iter().map(|one| one.threshold);
    let thresholds: Vec<f64> = thresholds.collect();
    output::line(&format!(
        "heading {heading}: {}; threshold {thresholds:.2?}",
        said.join("; ")
    ))
    .map_err(|error| error.to_string())?;
    let judged = left_out.iter().map(|one| judged(one, &model, robot));
    judged.collect()
}

fn judged(one: &Labelled, model: &Model, robot: &Description) -> Result<JudgedRun, String> {
    let settings = Settings {
        false_alarm_interval_h: INTERVAL_H,
        ..Settings::default()
    };
    let detector = Detector::of_channels(model, robot, &settings);
    let mut detector = detector.map_err(|error| error.to_string())?;
    let (mut belief, mut particles): (Box<DetectionBelief>, Box<ParticleBlock>) =
        (Box::default(), Box::default());
    let (mut changes_s, mut told_s) = (Vec::new(), Vec::new());
    for frame in &one.run.frames {
        let before = belief.context_count;
        detector.step(Entry::Frame(frame), &mut belief, &mut particles);
        if belief.context_count != before {
            changes_s.push(belief.context_t_capture_ns as f64 * 1e-9);
            told_s.push(frame.header.t_capture_ns as f64 * 1e-9);
        }
    }
    Ok(JudgedRun {
        name: one.name.clone(),
        kind: one.kind.clone(),
        crossings_s: one.crossings_s.clone(),
        is_chosen: one.is_chosen,
        changes_s,
        told_s,
        alarms: belief.alarm_count,
    })
}

/// Changes told after the first of a run that crosses: how many come with another wheel, of how
/// many.
fn later(found: &[JudgedRun]) -> (usize, usize) {
    let (mut of_wheels, mut all) = (0, 0);
    let crossing = found.iter();
    for one in crossing.filter(|one| matches!(one.kind, Kind::Crosses(_))) {
        for t_s in one.changes_s.iter().skip(1) {
            // The first wheel's is the change itself.
            let mut crossings_s = one.crossings_s.iter().skip(1);
            let is_near = crossings_s.any(|crossing_s| (t_s - crossing_s).abs() <= TOLD_S);
            of_wheels += usize::from(is_near);
            all += 1;
        }
    }
    (of_wheels, all)
}

/// How many runs of how many.
pub type Count = (&'static str, usize, usize);

/// What was told, a count for each quantity.
#[must_use]
pub fn counts(found: &[JudgedRun]) -> Vec<Count> {
    let crossing: Vec<(&JudgedRun, f64)> = found
        .iter()
        .filter_map(|one| match one.kind {
            Kind::Crosses(onset_s) => Some((one, onset_s)),
            Kind::Unclear | Kind::Still => None,
        })
        .collect();
    let of = |holds: &dyn Fn(&JudgedRun, f64) -> bool| {
        let right = crossing
            .iter()
            .filter(|(one, onset_s)| holds(one, *onset_s));
        (right.count(), crossing.len())
    };
    let near = |one: &JudgedRun, onset_s: f64| {
        let near = one
            .changes_s
            .iter()
            .filter(|t_s| (**t_s - onset_s).abs() <= TOLD_S);
        near.count()
    };
    let first = |one: &JudgedRun, onset_s: f64| {
        let first = one.changes_s.first();
        first.is_some_and(|t_s| (t_s - onset_s).abs() <= TOLD_S) && near(one, onset_s) == 1
    };
    let alone = |one: &JudgedRun, onset_s: f64| first(one, onset_s) && one.changes_s.len() == 1;
    let early = |one: &JudgedRun, onset_s: f64| {
        let first = one.changes_s.first();
        first.is_some_and(|t_s| *t_s < onset_s - TOLD_S)
    };
    let still = |is_of: &dyn Fn(&JudgedRun) -> bool| {
        let all: Vec<&JudgedRun> = found
            .iter()
            .filter(|one| one.kind == Kind::Still && is_of(one))
            .collect();
        let told = all.iter().filter(|one| !one.changes_s.is_empty()).count();
        (told, all.len())
    };
    let alarms = |is_of: &dyn Fn(&JudgedRun) -> bool| {
        let all: Vec<&JudgedRun> = found.iter().filter(|one| is_of(one)).collect();
        (all.iter().filter(|one| one.alarms > 0).count(), all.len())
    };
    let is_judged = |one: &JudgedRun| one.is_chosen || matches!(one.kind, Kind::Crosses(_));
    let all: [(&'static str, (usize, usize)); 8] = [
        (
            "crossings: the first change told within 1 s, no second one there",
            of(&first),
        ),
        ("... and none beside it in the run", of(&alone)),
        ("crossings: a change told more than 1 s before", of(&early)),
        (
            "changes told after the first: within 1 s of another wheel's crossing",
            later(found),
        ),
        (
            "twenty runs on one ground: a change told",
            still(&|one| one.is_chosen),
        ),
        ("all runs on one ground: a change told", still(&|_| true)),
        ("the sixty-six: an alarm", alarms(&is_judged)),
        ("all runs: an alarm", alarms(&|_| true)),
    ];
    all.map(|(name, (count, of))| (name, count, of)).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(kind: Kind, changes_s: &[f64], alarms: u32) -> JudgedRun {
        JudgedRun {
            name: String::new(),
            is_chosen: kind == Kind::Still,
            kind,
            crossings_s: vec![5.0, 9.5],
            changes_s: changes_s.to_vec(),
            told_s: changes_s.to_vec(),
            alarms,
        }
    }

    #[test]
    fn a_crossing_is_right_if_its_first_change_is_near_and_the_only_one_there() {
        let found = [
            run(Kind::Crosses(5.0), &[5.5], 0),
            run(Kind::Crosses(5.0), &[4.5, 9.0], 0),
            run(Kind::Crosses(5.0), &[4.5, 5.5], 1),
            run(Kind::Crosses(5.0), &[3.0, 5.0], 0),
            run(Kind::Crosses(5.0), &[], 0),
            run(Kind::Still, &[2.0], 0),
            run(Kind::Still, &[], 0),
        ];
        let counts = counts(&found).into_iter().map(|(_, count, of)| [count, of]);
        let counts: Vec<[usize; 2]> = counts.collect();
        assert_eq!(
            counts,
            [
                [2, 5],
                [1, 5],
                [1, 5],
                [1, 3],
                [1, 2],
                [1, 2],
                [1, 7],
                [1, 7]
            ]
        );
    }
}

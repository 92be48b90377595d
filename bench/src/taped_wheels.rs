//! Wheels of a real Kobuki with tape on them, each class judged by what was learned from other
//! parts of the same recordings.

use std::error::Error;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use vigil_blocks::SensorFrame;
use vigil_diagnosis::detect::{self, Detector};
use vigil_diagnosis::identify::{self, ChannelIdentifier, Diagnoser};
use vigil_evaluation::scoring::Taxonomy;
use vigil_evaluation::stages::{Stages, Vocabulary};
use vigil_learning::channel_learning::{LabelledRun, Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::tree::tree;
use vigil_robot::channel_model::{Model, Monitor, Observer};
use vigil_robot::learned::channels::Channels;
use vigil_terminal::output;

use crate::{quantile, real_logs};

/// The recordings, by their place in the log: the tyres that are taped.
const TAPED: [&[&str]; 4] = [
    &[],
    &["LEFT_TYRE"],
    &["RIGHT_TYRE"],
    &["LEFT_TYRE", "RIGHT_TYRE"],
];
/// Length of a block, s, and of the gap after it.
const BLOCK_S: f64 = 20.0;
const GAP_S: f64 = 2.0;
/// Blocks shorter than this are left out, s.
const BLOCK_MIN_S: f64 = 6.9;
/// Parts of each recording: one in turn is judged by what the others show.
const PARTS: usize = 3;
/// Time that a block has to show its fault, s, and between looks at it.
const FIRST_LOOK_S: f64 = 8.0;
const LOOK_EVERY_S: f64 = 0.5;
/// Mean time between false alarms, h.
const INTERVAL_H: f64 = 1.0;
/// Resamples of a bootstrap over blocks.
const RESAMPLES: usize = 2000;

/// What a block shows at one instant.
#[derive(Debug, Clone, Serialize)]
pub struct Look {
    /// Place of its recording in the log.
    pub class: usize,
    /// Place of its block in the recording.
    pub block: usize,
    /// Evidence for each of the two faults, nats.
    pub evidence: [f64; 2],
    /// Evidence for both, nats: for the likelier one, and for the other beside it.
    pub evidence_both: f64,
    /// True if the odds of a fault exceed the threshold of the alarm.
    pub alarm: bool,
    /// The most probable faults then.
    pub named: String,
}

/// A figure with its interval of 95 %.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Figure {
    /// Its value.
    pub value: f64,
    /// Lower and upper bound.
    pub bounds: [f64; 2],
}

struct Block {
    class: usize,
    place: usize,
    run: Run,
}

/// All looks at all blocks, each by a model that has not seen its part of the recordings.
///
/// # Errors
/// A log that is missing or supports no model.
pub fn looks() -> Result<Vec<Look>, Box<dyn Error>> {
    let log = real_logs::logs::log("kobuki_wheel_fault", "kobuki")?;
    let blocks: Vec<Block> = log.runs.iter().enumerate().flat_map(blocks).collect();
    let mut out = Vec::new();
    for part in 0..PARTS {
        let model = learned(&log.robot, &blocks, part)?;
        for block in blocks.iter().filter(|block| block.place % PARTS == part) {
            out.extend(looks_at(block, &log.robot, &model)?);
        }
    }
    Ok(out)
}

fn blocks((class, run): (usize, &Run)) -> Vec<Block> {
    let time_s = |frame: &SensorFrame| frame.header.t_capture_ns as f64 * 1e-9;
    let end_s = run.frames.last().map_or(0.0, time_s);
    let mut out = Vec::new();
    let mut from_s = 0.0;
    while from_s < end_s - BLOCK_MIN_S {
        let place = out.len();
        let within = from_s..from_s + BLOCK_S;
        let frames = run
            .frames
            .iter()
            .filter(|frame| within.contains(&time_s(frame)));
        out.push(Block {
            class,
            place,
            run: Run {
                id: (100 * class + place) as u32,
                frames: frames.copied().collect(),
            },
        });
        from_s += BLOCK_S + GAP_S;
    }
    out
}

/// A model of all parts but one; the recording with two taped wheels is never learned from.
fn learned(robot: &Description, blocks: &[Block], part: usize) -> Result<Model, Box<dyn Error>> {
    let others = || blocks.iter().filter(|block| block.place % PARTS != part);
    let healthy = others().filter(|block| TAPED[block.class].is_empty());
    let healthy: Vec<Run> = healthy.map(|block| block.run.clone()).collect();
    let taped = others().filter_map(|block| match TAPED[block.class] {
        [fault] => Some(LabelledRun {
            run: &block.run,
            fault,
            onset_s: 0.0,
        }),
        _ => None,
    });
    let labelled: Vec<LabelledRun<'_>> = taped.collect();
    let log = Log {
        labelled: &labelled,
        ..Log::of_healthy(&healthy)
    };
    let (model, report) = learn(&log, robot)?;
    for fault in &report.faults {
        output::line(&format!("part {part} left out: {fault}"))?;
    }
    Ok(model)
}

fn looks_at(
    block: &Block,
    robot: &Description,
    model: &Model,
) -> Result<Vec<Look>, Box<dyn Error>> {
    let settings = detect::Settings {
        false_alarm_interval_h: INTERVAL_H,
        ..detect::Settings::default()
    };
    let tree = tree(robot)?;
    let used = (settings.sensors, settings.fault_rate_1_h);
    let p_unknown = identify::Settings::default().p_unknown;
    let detector = Detector::of_channels(model, robot, &settings)?;
    let threshold = detector.alarm_log_odds();
    let mut stages = Stages::new(
        detector,
        Diagnoser::from(ChannelIdentifier::new(model, robot, &tree, used)?),
        None,
        Vocabulary {
            taxonomy: Taxonomy::new(&tree, robot).with_prior_unknown(p_unknown),
            robot: robot.clone(),
            actions: Vec::new(),
        },
    );
    let mut observer = Observer::new(robot);
    let monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0);
    let mut monitor = monitor.ok_or("the model has no law")?;
    let mut out = Vec::new();
    let begin_ns = block
        .run
        .frames
        .first()
        .map_or(0, |frame| frame.header.t_capture_ns);
    let mut next_s = FIRST_LOOK_S;
    for frame in &block.run.frames {
        stages.take(frame);
        if observer.push(frame).complete {
            monitor.step(observer.history(), observer.orders());
        }
        let t_s = (frame.header.t_capture_ns - begin_ns) as f64 * 1e-9;
        let told = observer.orders().iter().any(|orders| orders.is_told());
        if t_s < next_s || !told {
            continue;
        }
        next_s += LOOK_EVERY_S;
        let declared = monitor.bank().declared();
        let evidence = [0, 1].map(|fault| declared.evidence(fault).unwrap_or(0.0));
        let further = declared.pair().map_or(0.0, |pair| pair.further);
        let verdict = stages.verdict(frame);
        out.push(Look {
            class: block.class,
            block: block.place,
            evidence,
            evidence_both: evidence[0].max(evidence[1]) + further,
            alarm: verdict.log_odds > threshold,
            named: verdict.fault_set.clone(),
        });
    }
    Ok(out)
}

/// A score of a look.
type Score = fn(&Look) -> f64;

/// What the looks say, a line and a figure for each quantity.
#[must_use]
pub fn figures(looks: &[Look]) -> Vec<(String, Figure)> {
    let scores: [(&str, usize, Score); 3] = [
        ("left from healthy", 1, |look| look.evidence[0]),
        ("right from healthy", 2, |look| look.evidence[1]),
        ("both from healthy", 3, |look| look.evidence_both),
    ];
    let mut out = Vec::new();
    for (name, class, score) in scores {
        let area = |looks: &[&Look]| area(looks, class, score);
        out.push((format!("AUC, {name}"), figure(looks, area)));
    }
    for (name, class) in [("healthy", 0), ("left", 1), ("right", 2), ("both", 3)] {
        let alarmed = |looks: &[&Look]| share(looks, |look| look.class == class, |look| look.alarm);
        out.push((format!("{name}: alarm"), figure(looks, alarmed)));
    }
    for (name, class) in [("left", 1), ("right", 2), ("both", 3)] {
        let alarmed = move |look: &Look| look.class == class && look.alarm;
        let exact =
            |looks: &[&Look]| share(looks, alarmed, |look| look.named == TAPED[class].join("+"));
        out.push((format!("{name}: named in alarms"), figure(looks, exact)));
    }
    let one_side = |look: &Look| (1..=2).contains(&look.class) && look.alarm;
    let is_side = |look: &Look| {
        let other = TAPED[3 - look.class][0];
        look.named.contains(TAPED[look.class][0]) && !look.named.contains(other)
    };
    let side = |looks: &[&Look]| share(looks, one_side, is_side);
    out.push((
        "right side named in alarms of one side".into(),
        figure(looks, side),
    ));
    out
}

/// A figure of all looks, with a bootstrap over blocks.
fn figure(looks: &[Look], of: impl Fn(&[&Look]) -> f64) -> Figure {
    let mut blocks: Vec<[usize; 2]> = looks.iter().map(|look| [look.class, look.block]).collect();
    blocks.dedup();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut found = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        let mut drawn = Vec::with_capacity(looks.len());
        for class in 0..TAPED.len() {
            let own: Vec<_> = blocks.iter().filter(|block| block[0] == class).collect();
            for _ in 0..own.len() {
                let block = own[rng.random_range(0..own.len())];
                drawn.extend(
                    looks
                        .iter()
                        .filter(|look| [look.class, look.block] == *block),
                );
            }
        }
        let value = of(&drawn);
        if !value.is_nan() {
            found.push(value);
        }
    }
    Figure {
        value: of(&looks.iter().collect::<Vec<_>>()),
        bounds: [0.025, 0.975].map(|q| quantile(&mut found, q)),
    }
}

/// Area under the curve of a class against health: how often a look at it scores higher.
fn area(looks: &[&Look], class: usize, score: Score) -> f64 {
    let of = |class: usize| looks.iter().filter(move |look| look.class == class);
    let (mut sum, mut count) = (0.0, 0.0);
    for faulty in of(class) {
        for healthy in of(0) {
            let (a, b) = (score(faulty), score(healthy));
            sum += if a > b {
                1.0
            } else if a < b {
                0.0
            } else {
                0.5
            };
            count += 1.0;
        }
    }
    sum / count
}

/// Share of the looks `among` which something holds.
fn share(looks: &[&Look], among: impl Fn(&Look) -> bool, holds: impl Fn(&Look) -> bool) -> f64 {
    let all: Vec<_> = looks.iter().filter(|look| among(look)).collect();
    let count = all.iter().filter(|look| holds(look)).count();
    count as f64 / all.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_is_the_share_of_pairs_in_the_right_order() {
        let look = |class, score| Look {
            class,
            block: 0,
            evidence: [score, 0.0],
            evidence_both: score,
            alarm: false,
            named: String::new(),
        };
        let looks = [look(0, 0.0), look(0, 2.0), look(1, 1.0), look(1, 2.0)];
        let all: Vec<&Look> = looks.iter().collect();
        // Of four pairs two in order, one tied, one not.
        assert!((area(&all, 1, |look| look.evidence[0]) - 2.5 / 4.0).abs() < 1e-12);
    }
}

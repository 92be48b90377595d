//! Test drives: short commands within the learned ranges that tell faults apart.

use vigil_robot::channel_model::channel::commands;
use vigil_robot::channel_model::law::{BLOCK_S, BLOCKS, Law};
use vigil_robot::channel_model::observation::smoothed;
use vigil_robot::channel_model::prediction::Predictor;
use vigil_robot::channel_model::window::{Suspects, Window};
use vigil_robot::channel_model::{AXES, History, Model, Observation, Range, Scales};

use super::comparison::Products;
use super::fault::Fault;
use super::rule::Rule;
use super::snapshot::Snapshot;

/// Durations that are tried, in blocks.
const LENGTHS: [usize; 3] = [2, 4, BLOCKS];
/// Part of an axis's learned range that is left out at each end.
const MARGIN: f64 = 0.2;

/// A command that is kept up from rest on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Manoeuvre {
    /// Command.
    pub command: [f64; AXES],
    /// Blocks for which it is kept up.
    pub blocks: usize,
}

/// Standstill, else the middle of the range, and a fifth of the range from either end.
fn levels(range: &Range) -> Vec<f64> {
    let width = range.max - range.min;
    let middle = match range.min <= 0.0 && range.max >= 0.0 {
        true => 0.0,
        false => range.min + 0.5 * width,
    };
    let mut levels = vec![
        middle,
        range.min + MARGIN * width,
        range.max - MARGIN * width,
    ];
    levels.dedup();
    levels
}

/// All that are tried: the shortest first.
pub(super) fn manoeuvres(ranges: &[Range]) -> Vec<Manoeuvre> {
    let mut all = vec![[0.0; AXES]];
    for (axis, range) in ranges.iter().enumerate().take(AXES) {
        let more = all.iter().flat_map(|command| {
            levels(range).into_iter().map(|level| {
                let mut command = *command;
                command[axis] = level;
                command
            })
        });
        all = more.collect();
    }
    all.retain(|command| command.iter().any(|value| *value != 0.0));
    let long = |blocks: usize| {
        all.iter()
            .map(move |&command| Manoeuvre { command, blocks })
    };
    LENGTHS.into_iter().flat_map(long).collect()
}

impl Manoeuvre {
    /// The window at its end, of a robot that does all as predicted.
    pub fn snapshot(&self, model: &Model, scales: &Scales, law: &mut Law) -> Snapshot {
        let used = model.channel.iter().cloned().enumerate().collect();
        let mut window = Window::new(used, scales.clone(), model.interval_s);
        let predictor = Predictor::new(model.channel.iter());
        let mut history = History::default();
        let driven = self.blocks * window.per_block();
        // At rest for long enough for what a late sensor would read.
        let total = 2 * BLOCKS * window.per_block();
        let mut last = Observation::default();
        for step in 0..total + driven {
            let moving = step >= total;
            let command = if moving { self.command } else { [0.0; AXES] };
            let dt_s = model.interval_s;
            let mut now = Observation {
                dt_s,
                command,
                moving,
                moving_s: if moving { last.moving_s + dt_s } else { 0.0 },
                ..last
            };
            now.smoothed = smoothed(Some(&last), &now);
            let mut ahead = history;
            ahead.push(now);
            let predicted = predictor.predict(&commands(&ahead), scales);
            let values = now.values.iter_mut().zip(predicted);
            let channels = values.take(model.channel.len());
            channels.for_each(|(value, predicted)| *value = Some(predicted));
            history.push(now);
            window.push(
                &history,
                &commands(&history),
                (model.widening(&history), Suspects::default()),
            );
            last = now;
        }
        let first = BLOCKS - self.blocks;
        let command = std::array::from_fn(|block| match block >= first {
            true => self.command,
            false => [0.0; AXES],
        });
        let mut snapshot = Snapshot::new(&window, law, command);
        snapshot.square = law.values() as f64;
        snapshot
    }

    /// How long it takes, s.
    pub fn length_s(&self) -> f64 {
        BLOCK_S * self.blocks as f64
    }
}

/// For each manoeuvre whether it tells each pair, if the fault is there throughout.
pub(super) fn tells(
    snapshots: &[Snapshot],
    pairs: &[[usize; 2]],
    faults: &[Fault],
    rule: &Rule,
) -> Vec<Vec<bool>> {
    let of_one = |snapshot: &Snapshot| -> Vec<bool> {
        let products = Products::new(faults, 0, snapshot, rule);
        let told = |f: usize, g: usize| products.exclude(faults, [f, g], rule, |_| 0.0);
        pairs
            .iter()
            .map(|&[one, other]| told(one, other) && told(other, one))
            .collect()
    };
    snapshots.iter().map(of_one).collect()
}

//! The wheels left and right: which columns they are, and the channels made of these.

use super::draft::{Draft, DraftChannel};
use super::names::{Guess, Side, number, side};
use super::signals::How;
use super::{Evidence, NamedColumn};

/// The columns of one side or of both.
pub(super) struct Wheels {
    /// Index of their table.
    pub table: usize,
    /// Rates or positions.
    pub guess: Guess,
    /// Columns of the left side.
    pub left: Vec<String>,
    /// Columns of the right side.
    pub right: Vec<String>,
    /// True if names tell the sides.
    pub is_side_sure: bool,
}

/// The wheels: of a table with both sides, best with names that tell them.
pub(super) fn wheels(evidence: &Evidence) -> Option<Wheels> {
    let mut best: Option<(usize, Wheels)> = None;
    for guess in [Guess::WheelRate, Guess::WheelPosition] {
        for table in 0..evidence.tables.len() {
            let own = evidence.guessed(move |other| other == guess);
            let own: Vec<&NamedColumn> = own.filter(|found| found.table == table).collect();
            let columns = |wanted| {
                let sided = own
                    .iter()
                    .filter(move |found| side(&found.column) == Some(wanted));
                sided.map(|found| found.column.clone()).collect::<Vec<_>>()
            };
            let (mut left, mut right) = (columns(Side::Left), columns(Side::Right));
            let is_side_sure = !left.is_empty() && !right.is_empty();
            if let (false, [first, second]) = (is_side_sure, own.as_slice()) {
                (left, right) = (vec![first.column.clone()], vec![second.column.clone()]);
            }
            if left.is_empty() || left.len() != right.len() {
                continue;
            }
            let score = 2 * usize::from(is_side_sure) + usize::from(guess == Guess::WheelRate);
            if best.as_ref().is_none_or(|(other, _)| score > *other) {
                let wheels = Wheels {
                    table,
                    guess,
                    left,
                    right,
                    is_side_sure,
                };
                best = Some((score, wheels));
            }
        }
    }
    best.map(|(_, wheels)| wheels)
}

impl Wheels {
    /// Modulus of the counters, if they are some and wrap around.
    pub fn modulus(&self, evidence: &Evidence) -> Option<f64> {
        if self.guess == Guess::WheelRate {
            return None;
        }
        let table = evidence.tables.get(self.table)?;
        let own = |name: &str| {
            self.left
                .iter()
                .chain(&self.right)
                .any(|other| other == name)
        };
        let columns = table.columns.iter().filter(|column| own(&column.name));
        columns
            .filter_map(|column| modulus(&column.values))
            .reduce(f64::max)
    }

    /// How its columns become rates.
    pub fn how(&self, modulus: Option<f64>) -> How {
        match self.guess {
            Guess::WheelRate => How::Mean,
            _ => How::Rate(modulus),
        }
    }

    /// Columns, each with its share of the mean.
    pub fn terms(columns: &[String]) -> Vec<(String, f64)> {
        let factor = 1.0 / columns.len().max(1) as f64;
        columns
            .iter()
            .map(|column| (column.clone(), factor))
            .collect()
    }
}

/// The power of two at which whole numbers wrap around.
fn modulus(values: &[f64]) -> Option<f64> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    if finite().any(|value| value.fract() != 0.0) {
        return None;
    }
    let span = finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min);
    let bits = (span + 1.0).log2().ceil();
    let full = 2.0_f64.powf(bits);
    let jumps = |pair: &[f64]| (pair[1] - pair[0]).abs() > 0.75 * full;
    (bits >= 8.0 && values.windows(2).any(jumps)).then_some(full)
}

/// A channel of these columns, differentiated if they are positions.
pub(super) fn wheel_channel(
    name: &str,
    (wheels, columns, modulus): (&Wheels, &[String], Option<f64>),
    draft: &mut Draft,
) -> DraftChannel {
    let mut channel = DraftChannel::new(name, wheels.table, "");
    channel.terms = Wheels::terms(columns);
    if columns.len() > 1 {
        let note = format!("{name} is the mean of {}", columns.join(", "));
        if !draft.unsure.contains(&note) {
            draft.unsure.push(note);
        }
    }
    if wheels.guess == Guess::WheelPosition {
        channel = channel
            .with("differentiate", true)
            .with("method", "\"interpolate\"");
        if let Some(modulus) = modulus {
            channel = channel.with("modulus", modulus);
        }
    }
    channel
}

/// Currents of the wheels' motors: of the sides that their names tell, or in order.
pub(super) fn currents(evidence: &Evidence, wheels: &Wheels, draft: &mut Draft) {
    let own: Vec<&NamedColumn> = evidence
        .guessed(|guess| guess == Guess::WheelCurrent)
        .collect();
    let Some(table) = own.first().map(|found| found.table) else {
        return;
    };
    let mut own: Vec<&NamedColumn> = own
        .into_iter()
        .filter(|found| found.table == table)
        .collect();
    own.sort_by_key(|found| number(&found.column));
    let of_side = |wanted| -> Vec<String> {
        let sided = own
            .iter()
            .filter(|found| side(&found.column) == Some(wanted));
        sided.map(|found| found.column.clone()).collect()
    };
    let (mut left, mut right) = (of_side(Side::Left), of_side(Side::Right));
    if let ([first, second], true) = (own.as_slice(), left.is_empty() && right.is_empty()) {
        (left, right) = (vec![first.column.clone()], vec![second.column.clone()]);
        draft
            .unsure
            .push("which current is the left motor's is taken from their order".into());
    }
    if left.is_empty() || left.len() != right.len() || left.len() > wheels.left.len() {
        draft
            .unsure
            .push("currents were found and could not be given to the wheels".into());
        return;
    }
    draft.measured.currents = true;
    for (name, columns) in [("current_L", left), ("current_R", right)] {
        let mut channel = DraftChannel::new(name, table, "");
        channel.terms = Wheels::terms(&columns);
        draft.channels.push(channel);
    }
    draft
        .unsure
        .push("the unit of the currents is taken as A".into());
}

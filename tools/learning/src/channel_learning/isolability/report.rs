//! What is said of faults and pairs of them.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::channel_model::{AXES, Range};

use super::wait::Waits;

/// Names of two faults.
pub type Pair = [String; 2];

/// Lines of slow pairs in the text.
const SLOW_MAX: usize = 4;
/// Columns of a list.
const LIST: usize = 70;
/// Columns of a name, of a size and of a wait.
const NAME: usize = 12;
const SIZE: usize = 11;
const CELL: usize = 18;

/// A fault of a stated size.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FaultReport {
    /// Component that the fault is of.
    pub component: String,
    /// What of it is broken: of a pose a channel, else the component.
    pub broken: String,
    /// How it is broken.
    pub kind: &'static str,
    /// Size; null where the kind has none. Of a drive the share that is lost or added.
    pub size: Option<f64>,
    /// Its unit; empty for a gain and a share.
    pub size_unit: String,
    /// Share of the log's motion that shows it within four seconds.
    pub shown_share: f64,
    /// Expected wait for an alarm from an onset on; null if the log's motion does not show it.
    pub detected_after: Option<Waits>,
    /// Channels that carry it, the most important first.
    pub channels: Vec<String>,
    /// Faults that it is not told from.
    pub not_told_from: Vec<String>,
}

/// Two faults that only few motions tell apart.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PairReport {
    /// Names of the two.
    pub pair: Pair,
    /// Share of the windows that show one of them in which the other is excluded.
    pub told_share: f64,
    /// Expected wait until they are told apart; null if no window tells them.
    pub told_after: Option<Waits>,
    /// Channels that separate them, the most important first.
    pub channels: Vec<String>,
}

/// A sensor that the robot lacks.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Sensor {
    /// What it measures.
    pub sensor: String,
    /// Pairs that it would tell apart and no one before it.
    pub pairs: Vec<Pair>,
}

/// One axis of a command.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AxisCommand {
    /// Name of the axis.
    pub axis: String,
    /// Commanded value, in its unit.
    pub value: f64,
    /// Its unit.
    pub unit: String,
}

impl AxisCommand {
    /// A command by its axes.
    pub(super) fn all(command: &[f64; AXES], ranges: &[Range]) -> Vec<Self> {
        let axes = ranges.iter().zip(command);
        let axis = |(range, value): (&Range, &f64)| Self {
            axis: range.name.clone(),
            value: *value,
            unit: range.unit.clone(),
        };
        axes.map(axis).collect()
    }
}

/// A command kept up from rest on.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TestDrive {
    /// The command, by axis.
    pub command: Vec<AxisCommand>,
    /// For how long, s.
    pub duration_s: f64,
    /// Pairs that it tells apart and no one before it.
    pub pairs: Vec<Pair>,
}

/// Which faults are detected, and told apart.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Isolability {
    /// Mean time between false alarms, h.
    pub false_alarm_interval_h: f64,
    /// Windows of the log that were looked at.
    pub windows: usize,
    /// The faults that were looked at.
    pub faults: Vec<FaultReport>,
    /// Sets of faults of which no two are told apart.
    pub groups: Vec<Vec<String>>,
    /// Pairs that are told apart by few motions only, the slowest first.
    pub slow_pairs: Vec<PairReport>,
    /// Sensors that would tell pairs apart which the robot's do not.
    pub sensors: Vec<Sensor>,
    /// Pairs that none of these tells.
    pub inseparable: Vec<Pair>,
    /// Test drives that tell pairs apart which most of the log does not.
    pub test_drives: Vec<TestDrive>,
}

/// With one decimal below 100.
fn number(value: f64) -> String {
    match value < 100.0 {
        true => format!("{value:.1}"),
        false => format!("{value:.0}"),
    }
}

/// The waits of half and of nine of ten onsets, and the way of the latter.
fn shown(waits: Option<Waits>) -> String {
    let Some(Waits { half, nine_of_ten }) = waits else {
        return "-".to_owned();
    };
    let [from, to] = [half, nine_of_ten].map(|wait| number(wait.motion_s));
    let way = nine_of_ten.way_m.map(|way| format!(" {} m", number(way)));
    format!("{from}-{to} s{}", way.unwrap_or_default())
}

/// The first pairs, and how many more there are.
fn examples(pairs: &[Pair]) -> String {
    let mut text = String::new();
    for (i, [one, other]) in pairs.iter().enumerate() {
        let next = format!("{}{one} from {other}", if i == 0 { "" } else { ", " });
        if i > 0 && text.len() + next.len() > LIST {
            return format!("{text} and {} more", pairs.len() - i);
        }
        text += &next;
    }
    text
}

impl Isolability {
    /// The faults of each channel and drive, in order.
    fn rows(&self) -> Vec<&[FaultReport]> {
        self.faults
            .chunk_by(|one, next| one.broken == next.broken)
            .collect()
    }

    /// A line for each channel, or each drive.
    fn write_table(&self, f: &mut fmt::Formatter<'_>, of_drives: bool) -> fmt::Result {
        let is_drive = |row: &[FaultReport]| row.iter().any(|fault| fault.kind == "loss");
        let of = if of_drives { "drive" } else { "sensor" };
        let mut head = Vec::new();
        for row in self
            .rows()
            .into_iter()
            .filter(|row| is_drive(row) == of_drives)
        {
            let kinds: Vec<&str> = row.iter().map(|fault| fault.kind).collect();
            if kinds != head {
                let size = if of_drives { "" } else { "bias of" };
                writeln!(f, "{}", line(of, size, &kinds))?;
                head = kinds;
            }
            let bias = row.iter().find(|fault| fault.kind == "bias");
            let bias = bias.map_or(String::new(), |fault| {
                format!("{:.3} {}", fault.size.unwrap_or(0.0), fault.size_unit)
            });
            let waits = row.iter().map(|fault| shown(fault.detected_after));
            let mut cells: Vec<String> = waits.collect();
            let mut by: Vec<&str> = Vec::new();
            for channel in row.iter().flat_map(|fault| &fault.channels) {
                let is_new = !by.contains(&channel.as_str()) && of_drives;
                by.extend(is_new.then_some(channel.as_str()));
            }
            cells.push(by.join(" "));
            let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
            writeln!(f, "{}", line(&row[0].broken, &bias, &cells))?;
        }
        Ok(())
    }

    /// Several groups a line.
    fn write_groups(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = String::new();
        for group in self.groups.iter().map(|group| in_short(group)) {
            if !text.is_empty() && text.len() + group.len() > LIST {
                writeln!(f, "not told apart: {text}")?;
                text.clear();
            }
            text += if text.is_empty() { "" } else { "; " };
            text += &group;
        }
        match text.is_empty() {
            true => Ok(()),
            false => writeln!(f, "not told apart: {text}"),
        }
    }
}

fn line(name: &str, size: &str, cells: &[&str]) -> String {
    let mut text = format!("{name:<NAME$} {size:<SIZE$}");
    for cell in cells {
        text += &format!(" {cell:<CELL$}");
    }
    text.trim_end().to_owned()
}

/// A group, with the kinds of what is broken together.
fn in_short(group: &[String]) -> String {
    let mut text = String::new();
    let mut last = "";
    for name in group {
        let (broken, kind) = name.rsplit_once(' ').unwrap_or((name, ""));
        text += &match (broken == last, text.is_empty()) {
            (true, _) => format!("/{kind}"),
            (false, true) => name.clone(),
            (false, false) => format!(", {name}"),
        };
        last = broken;
    }
    text
}

impl fmt::Display for Isolability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "faults put into {} windows of the log, at {} h between false alarms: time from the\n\
             onset to the alarm, half and nine of ten of all onsets; way of the latter; -: never",
            self.windows, self.false_alarm_interval_h
        )?;
        self.write_table(f, false)?;
        self.write_table(f, true)?;
        self.write_groups(f)?;
        for pair in self.slow_pairs.iter().take(SLOW_MAX) {
            let [one, other] = &pair.pair;
            let (after, by) = (shown(pair.told_after), pair.channels.join(" "));
            writeln!(f, "told apart slowly: {one} from {other}, {after}, by {by}")?;
        }
        if let Some(more) = self
            .slow_pairs
            .get(SLOW_MAX..)
            .filter(|more| !more.is_empty())
        {
            writeln!(f, "told apart slowly: {} pairs more", more.len())?;
        }
        for sensor in &self.sensors {
            writeln!(
                f,
                "a {} would tell {}",
                sensor.sensor,
                examples(&sensor.pairs)
            )?;
        }
        if !self.inseparable.is_empty() {
            writeln!(
                f,
                "no sensor looked at would tell {}",
                examples(&self.inseparable)
            )?;
        }
        for drive in &self.test_drives {
            let axis = |of: &AxisCommand| format!("{} {:.2} {}", of.axis, of.value, of.unit);
            let command: Vec<String> = drive.command.iter().map(axis).collect();
            let (command, pairs) = (command.join(", "), examples(&drive.pairs));
            writeln!(
                f,
                "test drive: {command} for {:.1} s tells {pairs}",
                drive.duration_s
            )?;
        }
        Ok(())
    }
}

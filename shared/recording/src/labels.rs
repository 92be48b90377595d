//! Labels: the true fault of each recorded run.
//!
//! CSV: `run`, `mode` (`ND`, `<WHEEL>_STUCK`, `<WHEEL>_ENC`), `kind` (`stuck`, `zero`, `frozen`,
//! `noise`, or empty), `wheel` (or empty), `onset_s` (-1 for none), `cmd_curv`, `cmd_speed`,
//! `dur_s`; if wanted, `terrain` and `group`. Other columns are ignored. For a robot with a model
//! of channels, `run`, `mode` and `onset_s` are enough, and a mode may have any name.

use std::collections::BTreeSet;
use std::path::Path;

use vigil_robot::Description;

pub use crate::table::TableError as LabelsError;
use crate::table::{Table, quoted};

/// Label of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// Id of the run.
    pub run: u32,
    /// Mode: `ND` or a leaf of the fault tree.
    pub mode: String,
    /// Kind of the fault; empty for none.
    pub kind: String,
    /// Index of the wheel, if the fault is a wheel's.
    pub wheel: Option<usize>,
    /// Onset of the fault, s; `None` for a nominal run.
    pub onset_s: Option<f64>,
    /// Commanded curvature, 1/m.
    pub command_curvature_1_m: f64,
    /// Commanded speed, m/s.
    pub command_speed_m_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Runs of one group resemble each other beyond their faults, as those of one day do: none is
    /// judged by what another showed. Left out: each run is one of its own.
    pub group: String,
}

impl Label {
    /// True if nothing is wrong in the run.
    #[must_use]
    pub const fn is_nominal(&self) -> bool {
        self.onset_s.is_none()
    }
}

const COLUMNS: [&str; 8] = [
    "run",
    "mode",
    "kind",
    "wheel",
    "onset_s",
    "cmd_curv",
    "cmd_speed",
    "dur_s",
];

/// Columns for a robot without fault models.
const NOMINAL: [&str; 3] = ["run", "mode", "onset_s"];

/// Reads the labels of a file.
///
/// # Errors
/// [`LabelsError`] naming file, row, column, what was found and what is allowed.
pub fn read(path: &Path, robot: &Description) -> Result<Vec<Label>, LabelsError> {
    let mut table = Table::open(path)?;
    let needed = if robot.has_fault_models() {
        &COLUMNS[..]
    } else {
        &NOMINAL[..]
    };
    let names: Vec<String> = needed.iter().map(|&name| name.to_owned()).collect();
    let at = table.require(&names)?;
    let (mut labels, mut seen) = (Vec::new(), BTreeSet::new());
    while table.advance()? {
        let label = match at[..] {
            [run, mode, onset] => unnamed(&table, run, mode, onset)?,
            _ => label(&table, &at, robot)?,
        };
        if !seen.insert(label.run) {
            return Err(table.wrong(format!("run {} appears twice", label.run)));
        }
        labels.push(label);
    }
    Ok(labels)
}

/// Names of the grounds of these runs, from the column `terrain`: sorted, without repetition,
/// joined by `+`. Empty without such a column.
///
/// # Errors
/// [`LabelsError`].
pub fn terrain(path: &Path, runs: &[u32]) -> Result<String, LabelsError> {
    let mut table = Table::open(path)?;
    let run = table.require(&["run".to_owned()])?;
    let (Some(&run), Some(terrain)) = (run.first(), table.position("terrain")) else {
        return Ok(String::new());
    };
    let mut found = BTreeSet::new();
    while table.advance()? {
        if runs.contains(&table.whole(run)?) && !table.text(terrain).is_empty() {
            found.insert(quoted(table.text(terrain)));
        }
    }
    Ok(found.into_iter().collect::<Vec<_>>().join("+"))
}

fn label(table: &Table, at: &[usize], robot: &Description) -> Result<Label, LabelsError> {
    let [run, mode, kind, wheel, onset, curvature, speed, duration] = at[..] else {
        return Err(table.wrong("columns are missing".into()));
    };
    let name = table.text(wheel);
    let index = robot.wheel_index(name);
    if !name.is_empty() && index.is_none() {
        let allowed: Vec<&str> = robot.wheels.iter().map(|w| w.name.as_str()).collect();
        let message = format!(
            "wheel is '{}', allowed are {} or empty",
            quoted(name),
            allowed.join(" ")
        );
        return Err(table.wrong(message));
    }
    let (mode, onset_s) = fault(table, mode, onset)?;
    Ok(Label {
        run: table.whole(run)?,
        mode,
        kind: table.text(kind).to_owned(),
        wheel: index,
        onset_s,
        command_curvature_1_m: table.number(curvature)?,
        command_speed_m_s: table.number(speed)?,
        duration_s: table.number(duration)?,
        group: group(table, run),
    })
}

/// Label of a run whose fault, if any, has only a name.
fn unnamed(table: &Table, run: usize, mode: usize, onset: usize) -> Result<Label, LabelsError> {
    let (mode, onset_s) = fault(table, mode, onset)?;
    Ok(Label {
        run: table.whole(run)?,
        mode,
        kind: String::new(),
        wheel: None,
        onset_s,
        command_curvature_1_m: 0.0,
        command_speed_m_s: 0.0,
        duration_s: 0.0,
        group: group(table, run),
    })
}

/// Name of a run's group: its own id where the file gives none.
fn group(table: &Table, run: usize) -> String {
    let given = table.position("group").map_or("", |at| table.text(at));
    let name = if given.is_empty() {
        table.text(run)
    } else {
        given
    };
    name.to_owned()
}

/// Mode and onset, which must agree.
fn fault(table: &Table, mode: usize, onset: usize) -> Result<(String, Option<f64>), LabelsError> {
    let onset_s = Some(table.number(onset)?).filter(|s| *s >= 0.0);
    let mode = table.text(mode).to_owned();
    if (mode == "ND") != onset_s.is_none() {
        let (mode, onset) = (quoted(&mode), quoted(table.text(onset)));
        let message = format!("mode is '{mode}' but onset_s is {onset}");
        return Err(table.wrong(format!("{message}: only ND has none (-1)")));
    }
    Ok((mode, onset_s))
}

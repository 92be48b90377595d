//! Recorded sensor frames.
//!
//! CSV, plain or gzip: `run, t` (s), the axes of the robot's command by their names (rover:
//! `cmd_curv` 1/m, left positive, and `cmd_speed` m/s), and what the robot's description says is
//! measured: `x, y` (m), `yaw` (rad, wrapped), `enc_<WHEEL>` (rad/s) for every wheel,
//! `steer_<WHEEL>` (rad) for every steered wheel, `yaw_rate` (rad/s), `current_<WHEEL>` (A), and
//! the description's `[[channel]]` tables by their names. Of a robot with fault models gyro and
//! currents are read where they are there, whatever it says.
//! An empty cell means that the channel was not measured; the rover's are always. Columns are found
//! by name, in any order; others are ignored. The rows of a run are contiguous and in order of
//! time. Several runs may follow each other.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::path::Path;

use vigil_blocks::{COMMANDS, SensorFrame};
use vigil_robot::channel::{Role, channels};
use vigil_robot::{ChannelMap, Description};

use crate::table::Table;
pub use crate::table::TableError as FramesError;

/// A gap longer than this is refused, s: after a second without frames a detector is blind, so that
/// a run with such a gap is two.
pub const GAP_MAX_S: f64 = 1.0;
/// Distance between two frames that no ground robot drives, m: 2 m in less than a second. Larger
/// ones are mostly wrong units.
const JUMP_M_MAX: f64 = 2.0;

/// One recorded run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its id in the file.
    pub id: u32,
    /// Its frames, in order of time. `header.t_capture_ns` is the recording's own time, `run_id`
    /// is `id + 1` (0 means none), `header.seq` counts from 0; the other header fields are 0.
    pub frames: Vec<SensorFrame>,
}

/// Content of a column other than run and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// An axis of the command, in its own unit.
    Command(usize),
    /// A channel, by its place in the robot's channel list.
    Channel {
        /// The place.
        place: usize,
        /// What it measures.
        role: Role,
        /// True if a file may lack its column.
        is_optional: bool,
    },
}

impl Field {
    /// Its value in a frame; `None` if it is not marked as measured.
    #[must_use]
    pub const fn get(self, frame: &SensorFrame) -> Option<f64> {
        match self {
            Self::Command(i) => frame.commanded(i),
            Self::Channel { place, .. } => frame.measured(place),
        }
    }

    /// Writes a value to its place in a frame, and marks it as measured.
    pub const fn put(self, value: f64, frame: &mut SensorFrame) {
        match self {
            Self::Command(i) => frame.set_command(i, value),
            Self::Channel { place, .. } => frame.set_channel(place, value),
        }
    }

    /// True if a file may lack its column.
    #[must_use]
    pub const fn is_optional(self) -> bool {
        matches!(
            self,
            Self::Channel {
                is_optional: true,
                ..
            }
        )
    }

    const fn is_angle(self) -> bool {
        matches!(
            self,
            Self::Channel {
                role: Role::PoseYaw | Role::SteeringAngle,
                ..
            }
        )
    }
}

/// Names and contents of the columns of a robot's frames, after `run` and `t`: command, then
/// channels.
#[must_use]
pub fn fields(robot: &Description) -> Vec<(String, Field)> {
    let axes = robot.command.iter().enumerate().take(COMMANDS);
    let axes = axes.map(|(i, axis)| (axis.name.clone(), Field::Command(i)));
    let channels = channels(robot).into_iter().enumerate();
    let channels = channels.map(|(place, channel)| {
        let field = Field::Channel {
            place,
            role: channel.role,
            is_optional: channel.is_optional,
        };
        (channel.name, field)
    });
    axes.chain(channels).collect()
}

/// Positions of the columns in a table.
struct Columns {
    map: ChannelMap,
    run: usize,
    t: usize,
    fields: Vec<(usize, String, Field)>,
    /// A channel may be without a value.
    may_lack: bool,
}

impl Columns {
    fn find(table: &Table, robot: &Description) -> Result<Self, FramesError> {
        let (optional, fields): (Vec<_>, Vec<_>) = fields(robot)
            .into_iter()
            .partition(|(_, field)| field.is_optional());
        let mut names = vec!["run".to_owned(), "t".to_owned()];
        names.extend(fields.iter().map(|(name, _)| name.clone()));
        let at = table.require(&names)?;
        let [run, t, at @ ..] = at.as_slice() else {
            return Err(table.wrong("columns are missing".into()));
        };
        let fields = fields.into_iter().zip(at);
        let fields = fields.map(|((name, field), &at)| (at, name, field));
        let mut fields: Vec<(usize, String, Field)> = fields.collect();
        for (name, field) in optional {
            if let Some(at) = table.position(&name) {
                fields.push((at, name, field));
            }
        }
        let map = ChannelMap::new(robot);
        Ok(Self {
            map,
            run: *run,
            t: *t,
            fields,
            may_lack: !robot.has_fault_models(),
        })
    }

    fn frame(&self, table: &Table) -> Result<(u32, SensorFrame), FramesError> {
        let mut frame = SensorFrame::default();
        let id = table.whole(self.run)?;
        (frame.run_id, frame.robot_hash) = (u64::from(id) + 1, self.map.hash());
        let t_s = table.number(self.t)?;
        if !(0.0..=1e9).contains(&t_s) {
            return Err(table.wrong(format!("t is {t_s}, allowed is 0 to 1e9 s")));
        }
        frame.header.t_capture_ns = (t_s * 1e9).round() as u64;
        for (column, name, field) in &self.fields {
            let is_channel = matches!(field, Field::Channel { .. });
            if is_channel && self.may_lack && table.text(*column).is_empty() {
                continue;
            }
            let value = table.number(*column)?;
            field.put(value, &mut frame);
            if field.is_angle() {
                angle(table, name, value)?;
            }
        }
        Ok((id, frame))
    }
}

/// Refuses an angle beyond half a turn: it is mostly in degrees.
fn angle(table: &Table, name: &str, value: f64) -> Result<(), FramesError> {
    // Rounding may put a wrapped angle a little beyond pi.
    if value.abs() <= PI + 1e-3 {
        return Ok(());
    }
    let message = format!("{name} is {value}, allowed is -pi to pi rad; are these degrees?");
    Err(table.wrong(message))
}

/// Reads all runs of a file.
///
/// # Errors
/// [`FramesError`] naming file, row, column, what was found and what is allowed.
pub fn read(path: &Path, robot: &Description) -> Result<Vec<Run>, FramesError> {
    let mut table = Table::open(path)?;
    let columns = Columns::find(&table, robot)?;
    let (mut runs, mut seen) = (Vec::<Run>::new(), BTreeSet::new());
    while table.advance()? {
        let (id, mut frame) = columns.frame(&table)?;
        if runs.last().is_none_or(|run| run.id != id) {
            if !seen.insert(id) {
                let message = format!("run {id} appears again: the rows of a run are contiguous");
                return Err(table.wrong(message));
            }
            runs.push(Run {
                id,
                frames: Vec::new(),
            });
        }
        let Some(run) = runs.last_mut() else { continue };
        follows(&table, run, &frame, (robot, &columns.map))?;
        frame.header.seq = run.frames.len() as u64;
        run.frames.push(frame);
    }
    if runs.is_empty() {
        return Err(table.wrong("there are no frames".into()));
    }
    Ok(runs)
}

/// Time between consecutive frames, ns.
fn intervals_ns(run: &Run) -> Vec<u64> {
    let pairs = run.frames.windows(2);
    let interval = |pair: &[SensorFrame]| {
        let [before, after] = [0, 1].map(|i| pair[i].header.t_capture_ns);
        assert!(before < after, "time rises within a run");
        after - before
    };
    pairs.map(interval).collect()
}

/// The median, s; of two in the middle the shorter. None without intervals.
fn median_s(intervals_ns: &mut [u64]) -> Option<f64> {
    let middle = intervals_ns.len().checked_sub(1)? / 2;
    let (_, median_ns, _) = intervals_ns.select_nth_unstable(middle);
    Some(*median_ns as f64 * 1e-9)
}

/// Frame rate of a playback at `speed` times the recorded one, Hz, from the median interval between
/// frames. `runs`: as [`read`] returns them.
///
/// # Errors
/// A message with the rate and what is allowed, for a rate outside 1 to 10000 Hz or no two frames.
pub fn playback_rate_hz(runs: &[Run], speed: f64) -> Result<f64, String> {
    let mut all_ns: Vec<u64> = runs.iter().flat_map(intervals_ns).collect();
    let Some(interval_s) = median_s(&mut all_ns) else {
        return Err("no run has two frames".into());
    };
    let rate_hz = speed / interval_s;
    if (1.0..=1e4).contains(&rate_hz) {
        return Ok(rate_hz);
    }
    Err(format!(
        "a frame every {interval_s:.4} s, played at --speed {speed} (sensor.speed), makes \
         {rate_hz} Hz: allowed is 1 to 10000 Hz"
    ))
}

/// Refuses a frame that cannot follow the last one of its run, with the likely cause.
fn follows(
    table: &Table,
    run: &Run,
    frame: &SensorFrame,
    (robot, map): (&Description, &ChannelMap),
) -> Result<(), FramesError> {
    let Some(before) = run.frames.last() else {
        return Ok(());
    };
    let t_ns = |f: &SensorFrame| f.header.t_capture_ns;
    let (last_ns, now_ns) = (t_ns(before), t_ns(frame));
    if now_ns <= last_ns {
        let (now, last) = (now_ns as f64 * 1e-9, last_ns as f64 * 1e-9);
        return Err(table.wrong(format!(
            "t is {now} after {last}: time must rise within a run"
        )));
    }
    let gap_s = (now_ns - last_ns) as f64 * 1e-9;
    if gap_s > GAP_MAX_S {
        let message = format!(
            "run {}: a gap of {gap_s:.3} s, allowed is {GAP_MAX_S} s",
            run.id
        );
        return Err(table.wrong(format!("{message}: start a new run; or is t in ms?")));
    }
    let Some(([x, y, _], [last_x, last_y, _])) = map.pose(frame).zip(map.pose(before)) else {
        return Ok(());
    };
    let moved = (x - last_x).hypot(y - last_y);
    if moved > JUMP_M_MAX {
        let mut message = format!("the pose jumps by {moved:.2} m; allowed are {JUMP_M_MAX} m");
        let [forward, left, _] = robot.twist(&before.command);
        let commanded = forward.hypot(left) * gap_s;
        if commanded > 0.0 {
            let factor = moved / commanded;
            message += &format!("; {factor:.0} times the commanded travel: are x and y in mm?");
        }
        return Err(table.wrong(message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(times_ns: &[u64]) -> Run {
        let frame = |&t_ns: &u64| {
            let mut frame = SensorFrame::default();
            frame.header.t_capture_ns = t_ns;
            frame
        };
        Run {
            id: 0,
            frames: times_ns.iter().map(frame).collect(),
        }
    }

    #[test]
    #[should_panic(expected = "time rises within a run")]
    fn frames_out_of_order_are_caught() {
        let _ = playback_rate_hz(&[run(&[0, 50_000_000, 40_000_000])], 1.0);
    }

    #[test]
    fn the_rate_is_that_of_the_shorter_median_interval() {
        let runs = [run(&[0, 50_000_000, 150_000_000]), run(&[7])];
        assert_eq!(playback_rate_hz(&runs, 1.0), Ok(20.0));
        assert_eq!(playback_rate_hz(&runs, 0.5), Ok(10.0));
        assert!(playback_rate_hz(&runs, 0.01).is_err());
        assert!(playback_rate_hz(&runs, 501.0).is_err());
        assert!(playback_rate_hz(&runs[1..], 1.0).is_err());
    }
}

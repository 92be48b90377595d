//! Frames as they come, written as runs.

use std::path::{Path, PathBuf};

use vigil_blocks::{COMMANDS, SensorFrame};
use vigil_robot::Description;

use crate::frames::{Field, fields};
use crate::table::TableError;
use crate::writer::FrameWriter;

/// A pause of the capture times after which a new run begins, s: a recording with a longer gap in a
/// run is refused where it is read.
const PAUSE_S: f64 = 0.9;
/// The same in periods of the graph.
const PAUSE_PERIODS: f64 = 9.0;

/// Writes frames to a table. A pause, a jump of the clock, another publisher or another `run_id`
/// begins a new run. A frame without the whole command is left out: nothing can be predicted from
/// it.
pub struct RunWriter {
    robot: Description,
    path: PathBuf,
    pause_ns: u64,
    /// Made with the first frame, which says what of the optional channels is measured.
    file: Option<FrameWriter>,
    fields: Vec<Field>,
    run: Option<PresentRun>,
    counts: FrameCounts,
}

/// What was written so far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrameCounts {
    /// Frames.
    pub frames: u64,
    /// Runs in which they lie.
    pub runs: u32,
    /// Time that the runs cover, s.
    pub recorded_s: f64,
    /// Frames that were left out for want of a command.
    pub without_command: u64,
}

/// The run to which the last frame belonged; first capture and last, ns.
struct PresentRun {
    id: u64,
    epoch: u64,
    from_ns: u64,
    last_ns: u64,
}

impl RunWriter {
    /// Of frames at about `rate_hz`, to a file that is made with the first of them.
    #[must_use]
    pub fn new(robot: &Description, rate_hz: f64, path: &Path) -> Self {
        Self {
            robot: robot.clone(),
            path: path.to_owned(),
            pause_ns: (PAUSE_S.min(PAUSE_PERIODS / rate_hz) * 1e9) as u64,
            file: None,
            fields: Vec::new(),
            run: None,
            counts: FrameCounts::default(),
        }
    }

    /// What was written so far.
    #[must_use]
    pub const fn counts(&self) -> FrameCounts {
        self.counts
    }

    /// Where in the table a capture time lies: the present run as the table numbers it, and the
    /// time in it, s; none outside what is written of that.
    #[must_use]
    pub fn place_of(&self, t_capture_ns: u64) -> Option<(u32, f64)> {
        let run = self.run.as_ref()?;
        let is_in_it = (run.from_ns..=run.last_ns).contains(&t_capture_ns);
        let t_s = t_capture_ns.saturating_sub(run.from_ns) as f64 * 1e-9;
        is_in_it.then_some((self.counts.runs - 1, t_s))
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, frame: &SensorFrame) -> Result<(), TableError> {
        let axes = self.robot.command.len().min(COMMANDS);
        if (0..axes).any(|axis| frame.commanded(axis).is_none()) {
            self.counts.without_command += 1;
            return Ok(());
        }
        if self.file.is_none() {
            let is_there = |field: &Field| !field.is_optional() || field.get(frame).is_some();
            let all = fields(&self.robot).into_iter();
            let (names, fields) = all.filter(|(_, field)| is_there(field)).unzip();
            let names: Vec<String> = names;
            self.fields = fields;
            self.file = Some(FrameWriter::create(&self.path, &names)?);
        }
        let t_s = self.place(frame);
        self.counts.frames += 1;
        let values = self.fields.iter().map(|field| field.get(frame));
        match &mut self.file {
            Some(file) => file.row(self.counts.runs - 1, t_s, values),
            None => Ok(()),
        }
    }

    /// Brings a frame to its run; its time in it, s.
    fn place(&mut self, frame: &SensorFrame) -> f64 {
        let now_ns = frame.header.t_capture_ns;
        let goes_on = |run: &PresentRun| {
            (run.id, run.epoch) == (frame.run_id, frame.header.epoch)
                && (run.last_ns + 1..run.last_ns.saturating_add(self.pause_ns)).contains(&now_ns)
        };
        if let Some(run) = self.run.as_mut().filter(|run| goes_on(run)) {
            self.counts.recorded_s += (now_ns - run.last_ns) as f64 * 1e-9;
            run.last_ns = now_ns;
            return (now_ns - run.from_ns) as f64 * 1e-9;
        }
        self.run = Some(PresentRun {
            id: frame.run_id,
            epoch: frame.header.epoch,
            from_ns: now_ns,
            last_ns: now_ns,
        });
        self.counts.runs += 1;
        0.0
    }

    /// Completes the file; without a frame there is none.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> Result<(), TableError> {
        self.file.map_or(Ok(()), FrameWriter::finish)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(robot: &Description, t_s: f64, run_id: u64) -> SensorFrame {
        let mut frame = SensorFrame {
            run_id,
            ..SensorFrame::default()
        };
        frame.header.t_capture_ns = 1_000_000_000 + (t_s * 1e9) as u64;
        (0..robot.command.len()).for_each(|axis| frame.set_command(axis, 0.1));
        (0..3).for_each(|place| frame.set_channel(place, t_s));
        frame
    }

    #[test]
    fn pauses_and_run_ids_begin_runs_and_frames_without_a_command_are_left_out() {
        let text = include_str!("../../../config/robots/rover.toml");
        let robot: Description = toml::from_str(text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.csv");
        let mut writer = RunWriter::new(&robot, 10.0, &path);
        for (t_s, run_id) in [(0.0, 1), (0.1, 1), (0.9, 1), (1.9, 1), (2.0, 2)] {
            writer.write(&frame(&robot, t_s, run_id)).unwrap();
        }
        let mut without = frame(&robot, 2.1, 2);
        without.command_valid = 0;
        writer.write(&without).unwrap();
        let counts = writer.counts();
        assert_eq!(
            (counts.frames, counts.runs, counts.without_command),
            (5, 3, 1)
        );
        assert!((counts.recorded_s - 0.9).abs() < 1e-9, "{counts:?}");
        writer.finish().unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let runs: Vec<&str> = text
            .lines()
            .skip(1)
            .map(|it| it.split(',').next().unwrap())
            .collect();
        assert_eq!(runs, ["0", "0", "0", "1", "2"], "{text}");
    }

    #[test]
    fn without_a_frame_there_is_no_file() {
        let text = include_str!("../../../config/robots/rover.toml");
        let robot: Description = toml::from_str(text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.csv");
        RunWriter::new(&robot, 10.0, &path).finish().unwrap();
        assert!(!path.exists());
    }
}

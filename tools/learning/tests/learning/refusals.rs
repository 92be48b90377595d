//! Recorded runs whose columns are made to mean something else, or that lack what a fit needs, are
//! refused with the run and the figure.

use vigil_blocks::SensorFrame;
use vigil_learning::learning::{Options, learn};
use vigil_learning::plausibility::{self, RunCheck};
use vigil_recording::frames::{self, Run};
use vigil_recording::labels::{self, Label};
use vigil_robot::Description;

use crate::rover;

struct Data {
    robot: Description,
    runs: Vec<Run>,
    labels: Vec<Label>,
}

impl Data {
    fn read() -> Self {
        let robot = rover::robot();
        let data = rover::path("tests/data/rover");
        let runs = frames::read(&data.join("learn_frames.csv.gz"), &robot).unwrap();
        let labels = labels::read(&data.join("learn_runs.csv"), &robot).unwrap();
        Self {
            robot,
            runs,
            labels,
        }
    }

    /// Only the runs whose label is wanted.
    fn keep(&mut self, wanted: impl Fn(&Label) -> bool) {
        self.labels.retain(|label| wanted(label));
        let labels = &self.labels;
        self.runs
            .retain(|run| labels.iter().any(|label| label.run == run.id));
    }

    /// Every run, with its label.
    fn each(&mut self, mut change: impl FnMut(&mut Run, &mut Label)) {
        for run in &mut self.runs {
            let label = self.labels.iter_mut().find(|label| label.run == run.id);
            change(run, label.unwrap());
        }
    }

    fn learn(&self) -> Result<(), String> {
        let options = Options {
            evaluations: 20,
            ..Options::default()
        };
        learn(&self.runs, &self.labels, &[], &self.robot, &options)
            .map(|_| ())
            .map_err(|error| error.to_string())
    }

    /// What learning says of one nominal run in a turn, changed frame by frame.
    fn changed(&self, change: impl Fn(&mut SensorFrame)) -> String {
        let is_wanted = |l: &&Label| l.is_nominal() && l.command_curvature_1_m > 0.3;
        let label = self.labels.iter().find(is_wanted).unwrap();
        let mut run = self
            .runs
            .iter()
            .find(|r| r.id == label.run)
            .unwrap()
            .clone();
        run.frames.iter_mut().for_each(change);
        let options = Options::default();
        let labels = [label.clone()];
        let error = learn(&[run], &labels, &[], &self.robot, &options).unwrap_err();
        let error = error.to_string();
        let of = format!("run {}: ", label.run);
        error.strip_prefix(&of).expect(&error).to_owned()
    }
}

/// The number in front of `times`, and the text after it.
fn ratio(message: &str) -> (f64, &str) {
    let (before, after) = message.split_once(" times ").expect(message);
    let number = before.rsplit(' ').next().unwrap();
    (number.parse().expect(message), after)
}

fn scale_position(factor: f64) -> impl Fn(&mut SensorFrame) {
    move |frame| {
        frame.channel[0] *= factor;
        frame.channel[1] *= factor;
    }
}

fn scale_rates(factor: f64) -> impl Fn(&mut SensorFrame) {
    move |frame| {
        frame.channel[3..9]
            .iter_mut()
            .for_each(|rate| *rate *= factor)
    }
}

#[test]
fn units_are_told_by_their_factor() {
    let data = Data::read();
    let degrees = 180.0 / std::f64::consts::PI;
    let in_degrees = |frame: &mut SensorFrame| {
        // Wrapped to half a turn, as a compass in degrees is, but to a radian's range.
        frame.channel[2] = (frame.channel[2] * degrees + 3.2).rem_euclid(6.4) - 3.2;
    };
    let rpm = 60.0 / std::f64::consts::TAU;
    let cases: [(String, f64, &str); 6] = [
        (data.changed(scale_position(1000.0)), 1000.0, "in mm?"),
        (data.changed(scale_position(100.0)), 100.0, "in cm?"),
        (data.changed(scale_position(3.281)), 3.281, "in feet?"),
        (data.changed(scale_rates(degrees)), degrees, "in deg/s?"),
        (data.changed(scale_rates(rpm)), rpm, "in rpm?"),
        (
            data.changed(scale_rates(1.0 / std::f64::consts::TAU)),
            0.159,
            "in revolutions per second?",
        ),
    ];
    for (message, factor, unit) in &cases {
        let (found, after) = ratio(message);
        assert!((found / factor - 1.0).abs() < 0.1, "{message}");
        assert!(after.ends_with(unit), "{message}");
    }
    assert!(data.changed(in_degrees).contains("yaw turns"));
}

#[test]
fn a_command_beyond_its_limit_is_asked_for_the_units_that_fit() {
    let data = Data::read();
    let refused = |speed: f64| data.changed(|frame| frame.command[1] = speed);
    for (speed, wanted) in [
        (
            1.6,
            "1.6; allowed is 0.5 m/s: is it in feet/s or cm/s or mm/s?",
        ),
        (20.0, "20; allowed is 0.5 m/s: is it in cm/s or mm/s?"),
        (200.0, "200; allowed is 0.5 m/s: is it in mm/s?"),
        (2e6, "2000000; allowed is 0.5 m/s: is it in another unit?"),
    ] {
        assert_eq!(refused(speed), format!("cmd_speed is up to {wanted}"));
    }
}

#[test]
fn signs_sides_and_silent_sensors_are_told() {
    let data = Data::read();
    let mirrored_yaw = data.changed(|frame| frame.channel[2] = -frame.channel[2]);
    let (turned, after) = ratio(&mirrored_yaw);
    assert!((turned + 1.0).abs() < 0.05, "{mirrored_yaw}");
    assert!(after.contains("positive to the right?"), "{mirrored_yaw}");
    let exact = [
        (
            data.changed(|frame| frame.channel[2] = 0.25),
            "yaw is 0.25 throughout, though a turn is commanded",
        ),
        (
            data.changed(|frame| frame.channel[3..9].fill(0.0)),
            "enc_LF is 0 throughout, though motion is commanded",
        ),
        (
            data.changed(|frame| frame.channel[3 + 4] = 1.5),
            "enc_RM is 1.5 throughout, though motion is commanded",
        ),
        (
            data.changed(scale_rates(-1.0)),
            "signs: enc_RF has the other sign",
        ),
        (
            data.changed(|frame| frame.channel[3..9].rotate_left(3)),
            "order: enc_LF and enc_RF fit when exchanged; or is cmd_curv positive to the right?",
        ),
    ];
    for (found, wanted) in exact {
        assert_eq!(found, wanted);
    }
    let sideways = data.changed(|frame| {
        (frame.channel[0], frame.channel[1]) = (-frame.channel[1], frame.channel[0]);
    });
    assert!(
        sideways.starts_with("axes: x and y move at 1.5"),
        "{sideways}"
    );
}

#[test]
fn frames_too_far_apart_to_be_judged_are_told_by_their_spacing() {
    let data = Data::read();
    let told = |factor: u64| {
        let mut runs = data.runs[..4].to_vec();
        let slowed = runs[2..].iter_mut().flat_map(|run| &mut run.frames);
        slowed.for_each(|frame| frame.header.t_capture_ns *= factor);
        plausibility::slow(runs.iter().map(|run| (run, f64::INFINITY)), &data.robot)
    };
    let wanted = |spacing_s: &str| {
        Some(format!(
            "units, signs and sides of 2 of 4 runs are NOT judged: in run 2 t advances by \
             {spacing_s} s from frame to frame, allowed is 0.3 s; is t in ms?"
        ))
    };
    // 20 Hz in ms, and 3 Hz in s. At 4 Hz there is nothing to tell.
    assert_eq!(told(1000), wanted("50.000"));
    assert_eq!(told(7), wanted("0.350"));
    assert_eq!(told(5), None);
    assert_eq!(told(1), None);
}

#[test]
fn recorded_runs_raise_no_doubt_before_their_faults() {
    let data = Data::read();
    let mut judged = 0;
    for (run, label) in data.runs.iter().zip(&data.labels) {
        assert_eq!(run.id, label.run);
        let until_s = label.onset_s.unwrap_or(f64::INFINITY);
        let check = RunCheck::new(run, &data.robot, until_s);
        assert_eq!(check.doubt, None);
        judged += usize::from(check.is_judged);
    }
    assert!(2 * judged > data.runs.len(), "{judged}");
}

#[test]
fn turns_to_one_side_are_refused_unless_the_mirror_supplies_the_other() {
    let mut data = Data::read();
    data.keep(|label| label.kind.is_empty() || label.kind == "stuck");
    data.keep(|label| label.is_nominal() || label.command_curvature_1_m > 0.0);
    assert_eq!(data.learn(), Ok(()));
    data.robot.wheels[3].x += 0.01;
    let wanted = "the runs of LF_STUCK turn only left, runs that turn to either side are needed";
    assert_eq!(data.learn().unwrap_err(), wanted);
    let mut data = Data::read();
    data.keep(|label| label.command_curvature_1_m < 0.0);
    let wanted = "the runs of ND turn only right, runs that turn to either side are needed";
    assert_eq!(data.learn().unwrap_err(), wanted);
}

#[test]
fn one_speed_is_refused() {
    let mut data = Data::read();
    // A robot whose motion does not depend on its speed, driven at another one.
    data.each(|run, label| {
        let slower = label.command_speed_m_s / 0.2;
        for frame in &mut run.frames {
            let t_ns = frame.header.t_capture_ns as f64 * slower;
            frame.header.t_capture_ns = t_ns.round() as u64;
            frame.command[1] = 0.2;
            frame.channel[3..9]
                .iter_mut()
                .for_each(|rate| *rate /= slower);
        }
        label.onset_s = label.onset_s.map(|onset_s| onset_s * slower);
    });
    let wanted = "the runs of ND drive at 0.200 to 0.200 m/s: the effect of speed needs speeds of \
                  which the highest is at least 1.2 times the lowest";
    assert_eq!(data.learn().unwrap_err(), wanted);
}

#[test]
fn little_nominal_driving_is_refused_with_what_there_is() {
    let mut data = Data::read();
    data.keep(|label| label.is_nominal() && label.run % 5 == 0 || label.kind == "stuck");
    data.each(|run, label| {
        let t_s = |frame: &SensorFrame| frame.header.t_capture_ns as f64 * 1e-9;
        match label.onset_s {
            None => run.frames.retain(|frame| t_s(frame) < 6.0),
            Some(onset_s) => run.frames.retain(|frame| t_s(frame) >= onset_s),
        }
    });
    let nominal = data
        .labels
        .iter()
        .filter(|label| label.is_nominal())
        .count();
    assert!((8..15).contains(&nominal), "{nominal}");
    // Two windows of 2 s from each.
    let wanted = format!(
        "{} s of nominal driving to calibrate the alarm, 60 s are needed",
        4 * nominal
    );
    assert_eq!(data.learn().unwrap_err(), wanted);
}

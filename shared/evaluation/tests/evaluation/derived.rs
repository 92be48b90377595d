//! Runs made from recorded ones.

use vigil_evaluation::derived::{dead_encoder, noisier, write_frames, write_labels};
use vigil_recording::frames::{self, Run};
use vigil_recording::labels::{self, Label};
use vigil_robot::learned::Model;
use vigil_robot::learned::model::Noise;

use crate::rover;

fn recorded() -> (Vec<Run>, Vec<Label>, Noise) {
    let robot = rover::robot();
    let data = rover::path("tests/data/rover");
    let runs = frames::read(&data.join("learn_frames.csv.gz"), &robot).unwrap();
    let labels = labels::read(&data.join("learn_runs.csv"), &robot).unwrap();
    let text = std::fs::read_to_string(rover::path("config/models/rover.toml")).unwrap();
    (runs, labels, Model::from_toml(&text).unwrap().noise)
}

fn first<'a>(runs: &'a [Run], labels: &'a [Label], kind: &str) -> (&'a Run, &'a Label) {
    let label = labels.iter().find(|label| label.kind == kind).unwrap();
    let run = runs.iter().find(|run| run.id == label.run).unwrap();
    (run, label)
}

/// Mean and standard deviation.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, (squares / n).sqrt())
}

#[test]
fn a_dead_encoder_reads_noise_from_its_onset_on_and_nothing_else_changes() {
    let (runs, labels, _) = recorded();
    let nominal = first(&runs, &labels, "");
    let make = |seed| dead_encoder(nominal, 9000, (4, "RM"), 4.0, (0.05, seed)).unwrap();
    let (run, label) = make(1);
    assert_eq!(run, make(1).0, "the same seed gives the same run");
    assert_ne!(run, make(2).0);
    assert_eq!((label.mode.as_str(), label.onset_s), ("RM_ENC", Some(4.0)));
    let mut dead = Vec::new();
    for (made, before) in run.frames.iter().zip(&nominal.0.frames) {
        let mut expected = *before;
        expected.run_id = 9001;
        if before.header.t_capture_ns >= 4_000_000_000 {
            dead.push(made.wheel_rate[4]);
            expected.wheel_rate[4] = made.wheel_rate[4];
        }
        assert_eq!(*made, expected);
    }
    let (mean, sd) = moments(&dead);
    // 221 samples: three standard errors.
    assert!(dead.len() == 221 && mean.abs() < 0.0101 && (sd - 0.05).abs() < 0.0072);
}

#[test]
fn doubled_noise_is_doubled_and_leaves_what_a_broken_encoder_reads() {
    let (runs, labels, noise) = recorded();
    let robot = rover::robot();
    let (run, label) = first(&runs, &labels, "frozen");
    let made = noisier((run, label), &noise, &robot, 2.0, 1).unwrap();
    let (wheel, onset_s) = (label.wheel.unwrap(), label.onset_s.unwrap());
    let (mut x, mut yaw, mut rate, mut steer) = (vec![], vec![], vec![], vec![]);
    for (after, before) in made.frames.iter().zip(&run.frames) {
        x.push(after.pose[0] - before.pose[0]);
        let turned = after.pose[2] - before.pose[2];
        yaw.push(turned.sin().atan2(turned.cos()));
        rate.push(after.wheel_rate[(wheel + 1) % 6] - before.wheel_rate[(wheel + 1) % 6]);
        steer.push(after.steer[0] - before.steer[0]);
        assert_eq!(
            after.steer[1], before.steer[1],
            "a fixed wheel has no angle"
        );
        if before.header.t_capture_ns as f64 * 1e-9 >= onset_s {
            assert_eq!(after.wheel_rate[wheel], before.wheel_rate[wheel]);
        }
    }
    let cases = [
        (x, noise.position_m),
        (yaw, noise.yaw_rad),
        (rate, noise.wheel_rate_rad_s),
        (steer, noise.steer_rad),
    ];
    for (added, sd) in cases {
        let (mean, found) = moments(&added);
        // Added in squares to once the noise: twice. 300 samples: three standard errors.
        let wanted = 3.0_f64.sqrt() * sd;
        assert!(mean.abs() < 0.174 * wanted, "{mean} {wanted}");
        assert!((found / wanted - 1.0).abs() < 0.123, "{found} {wanted}");
    }
    assert!(noisier((run, label), &noise, &robot, 0.5, 1).is_err());
}

#[test]
fn what_is_written_is_read_as_it_was() {
    let (runs, labels, _) = recorded();
    let robot = rover::robot();
    let folder = tempfile::tempdir().unwrap();
    let paths = ["frames.csv", "runs.csv"].map(|name| folder.path().join(name));
    let (mut frames_text, mut labels_text) = (Vec::new(), Vec::new());
    write_frames(&mut frames_text, &robot, &runs[..3]).unwrap();
    write_labels(&mut labels_text, &robot, &labels).unwrap();
    std::fs::write(&paths[0], frames_text).unwrap();
    std::fs::write(&paths[1], labels_text).unwrap();
    assert_eq!(frames::read(&paths[0], &robot).unwrap(), runs[..3]);
    assert_eq!(labels::read(&paths[1], &robot).unwrap(), labels);
}

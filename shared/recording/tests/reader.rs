//! Recorded frames and labels: what is read, what is refused and in which words.
#![cfg(test)]

use std::io::Write;
use std::path::PathBuf;

use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use tempfile::NamedTempFile;
use vigil_recording::{frames, labels};
use vigil_robot::Description;

/// Path from the root of the workspace.
fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(name)
}

/// The rover.
fn robot() -> Description {
    toml::from_str(&std::fs::read_to_string(path("config/robots/rover.toml")).unwrap()).unwrap()
}

const HEADER: &str = "run,t,x,y,yaw,enc_LF,enc_LM,enc_LR,enc_RF,enc_RM,enc_RR,steer_LF,steer_LR,\
                      steer_RF,steer_RR,cmd_curv,cmd_speed";

fn file(content: &[u8]) -> NamedTempFile {
    let mut file = NamedTempFile::new().unwrap();
    file.write_all(content).unwrap();
    file
}

fn gzip(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

/// A row; `yaw` and `steer` as text, so that they can be garbage.
fn row(run: &str, t: &str, x: &str, yaw: &str, steer: &str) -> String {
    format!("{run},{t},{x},0.5,{yaw},1,2,3,4,5,6,{steer},0.2,0.3,0.4,0.25,0.2\n")
}

fn table(rows: &[String]) -> String {
    format!("{HEADER}\n{}", rows.concat())
}

fn message(content: &str) -> String {
    let file = file(content.as_bytes());
    let error = frames::read(file.path(), &robot()).unwrap_err().to_string();
    let path = file.path().display().to_string();
    error
        .strip_prefix(&format!("{path}: "))
        .expect("the file is named")
        .to_owned()
}

fn good(t: &str) -> String {
    row("7", t, "1", "0.1", "0.05")
}

#[test]
fn columns_are_found_by_name_and_only_present_channels_are_valid() {
    let content = "extra,cmd_speed,cmd_curv,steer_RR,steer_RF,steer_LR,steer_LF,enc_RR,enc_RM,\
                   enc_RF,enc_LR,enc_LM,enc_LF,yaw,y,x,t,run\n\
                   hello,0.2,-0.5,4e-1,0.3,0.2,0.1,6,5,4,3,2,1,-3.1,2,1.5,0.05,41\n\
                   hello,0.2,-0.5,4e-1,0.3,0.2,0.1,6,5,4,3,2,1,-3.1,2,1.5,0.1,41\n";
    let runs = frames::read(file(content.as_bytes()).path(), &robot()).unwrap();
    assert_eq!((runs.len(), runs[0].id, runs[0].frames.len()), (1, 41, 2));
    let frame = &runs[0].frames[1];
    assert_eq!(
        (frame.run_id, frame.header.seq, frame.header.t_capture_ns),
        (42, 1, 100_000_000)
    );
    assert_eq!(frame.command[..3], [-0.5, 0.2, 0.0]);
    assert_eq!(frame.command_valid, 0b11);
    // Pose, wheel rates, steering angles; the columns of gyro and currents are not there.
    let channels = [
        1.5, 2.0, -3.1, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.1, 0.2, 0.3, 0.4, 0.0,
    ];
    assert_eq!(frame.channel[..14], channels);
    assert_eq!(frame.channel_valid, (1 << 13) - 1);
}

#[test]
fn gaps_of_more_than_a_second_are_refused_with_run_and_row() {
    let cases = [
        (
            [good("50"), good("100"), good("150")],
            "row 2: run 7: a gap of 50.000 s, allowed is 1 s: start a new run; or is t in ms?",
        ),
        (
            [good("0.5"), good("1"), good("2.5")],
            "row 3: run 7: a gap of 1.500 s, allowed is 1 s: start a new run; or is t in ms?",
        ),
    ];
    for (rows, wanted) in cases {
        assert_eq!(message(&table(&rows)), wanted);
    }
}

#[test]
fn a_gap_of_less_than_a_second_is_read_whatever_the_rate() {
    let rows = [good("0.05"), good("0.10"), good("0.90"), good("0.90001")];
    let runs = frames::read(file(table(&rows).as_bytes()).path(), &robot()).unwrap();
    assert_eq!(runs[0].frames.len(), 4);
}

#[test]
fn malformed_tables_are_refused_with_row_column_and_what_is_allowed() {
    let two = |second: String| table(&[good("0.05"), second]);
    let cases = [
        (
            "run,t,x,y,enc_LF,cmd_curv\n".to_owned(),
            "missing columns cmd_speed, yaw, enc_LM, enc_LR, enc_RF, enc_RM, enc_RR, steer_LF, \
             steer_LR, steer_RF, steer_RR; expected are run, t, cmd_curv, cmd_speed, x, y, yaw, \
             enc_LF, enc_LM, enc_LR, enc_RF, enc_RM, enc_RR, steer_LF, steer_LR, steer_RF, \
             steer_RR",
        ),
        (table(&[]), "row 1: there are no frames"),
        (
            two(row("7", "0.10", "NaN", "0", "0")),
            "row 2: x is 'NaN', allowed is a finite number",
        ),
        (
            two(row("7", "0.10", "inf", "0", "0")),
            "row 2: x is 'inf', allowed is a finite number",
        ),
        (
            two(row("7", "0.10", "", "0", "0")),
            "row 2: x is '', allowed is a finite number",
        ),
        (
            two(row("-1", "0.10", "1", "0", "0")),
            "row 2: run is '-1', allowed is a whole number from 0",
        ),
        (
            two(row("7", "-0.1", "1", "0", "0")),
            "row 2: t is -0.1, allowed is 0 to 1e9 s",
        ),
        (
            two(row("7", "0.04", "1", "0", "0")),
            "row 2: t is 0.04 after 0.05: time must rise within a run",
        ),
        (
            two(good("0.05")),
            "row 2: t is 0.05 after 0.05: time must rise within a run",
        ),
        (
            two(row("7", "0.10", "1", "90", "0")),
            "row 2: yaw is 90, allowed is -pi to pi rad; are these degrees?",
        ),
        (
            two(row("7", "0.10", "1", "0", "-12.5")),
            "row 2: steer_LF is -12.5, allowed is -pi to pi rad; are these degrees?",
        ),
        (
            two(row("7", "0.10", "1000", "0", "0")),
            "row 2: the pose jumps by 999.00 m; allowed are 2 m; 99900 times the commanded travel: \
             are x and y in mm?",
        ),
        (
            table(&[good("0.05"), row("8", "0.05", "1", "0", "0"), good("0.10")]),
            "row 3: run 7 appears again: the rows of a run are contiguous",
        ),
    ];
    for (content, wanted) in cases {
        assert_eq!(message(&content), wanted);
    }
    // The rest of this message is the CSV reader's.
    assert!(message(&two("7,0.10\n".into())).starts_with("row 2: "));
}

#[test]
fn a_missing_file_is_named() {
    let error = frames::read("no/such/frames.csv".as_ref(), &robot())
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("no/such/frames.csv: No such file"),
        "{error}"
    );
}

#[test]
fn labels_are_read_and_malformed_ones_refused() {
    let read = |rows: &str| {
        let header = "run,mode,kind,wheel,onset_s,cmd_curv,cmd_speed,dur_s,seed";
        let file = file(format!("{header}\n{rows}").as_bytes());
        labels::read(file.path(), &robot()).map_err(|error| error.to_string())
    };
    let good =
        read("0,ND,,,-1.000,0.5,0.2,15,x\n3,RM_STUCK,stuck,RM,4.25,-0.5,0.1,15,x\n").unwrap();
    assert!(good[0].is_nominal() && good[0].wheel.is_none());
    assert_eq!(
        (good[1].run, good[1].wheel, good[1].onset_s),
        (3, Some(4), Some(4.25))
    );
    assert_eq!(
        (good[1].mode.as_str(), good[1].kind.as_str()),
        ("RM_STUCK", "stuck")
    );
    for (rows, wanted) in [
        (
            "0,XX_STUCK,stuck,XX,4,0,0.2,15,x\n",
            "row 1: wheel is 'XX', allowed are LF LM LR RF RM RR or empty",
        ),
        (
            "0,RM_STUCK,stuck,RM,-1,0,0.2,15,x\n",
            "row 1: mode is 'RM_STUCK' but onset_s is -1: only ND has none (-1)",
        ),
        (
            "0,ND,,,3,0,0.2,15,x\n",
            "row 1: mode is 'ND' but onset_s is 3: only ND has none (-1)",
        ),
        (
            "0,ND,,,-1,0,0.2,15,x\n0,ND,,,-1,0,0.2,15,x\n",
            "row 2: run 0 appears twice",
        ),
        (
            "0,ND,,,-1,NaN,0.2,15,x\n",
            "row 1: cmd_curv is 'NaN', allowed is a finite number",
        ),
    ] {
        let error = read(rows).unwrap_err();
        assert!(error.ends_with(wanted), "{error}");
    }
}

#[test]
fn the_rover_data_is_read_whole() {
    let robot = robot();
    let runs = frames::read(&path("tests/data/rover/learn_frames.csv.gz"), &robot).unwrap();
    let labels = labels::read(&path("tests/data/rover/learn_runs.csv"), &robot).unwrap();
    assert_eq!((runs.len(), labels.len()), (492, 492));
    assert!(runs.iter().all(|run| run.frames.len() == 300));
    let ids = |ids: Vec<u32>| ids.into_iter().collect::<std::collections::BTreeSet<_>>();
    let of_runs = ids(runs.iter().map(|run| run.id).collect());
    assert_eq!(of_runs, ids(labels.iter().map(|label| label.run).collect()));
    let first = &runs[0].frames[0];
    assert_eq!(
        (first.header.t_capture_ns, &first.channel[..3]),
        (50_000_000, [-0.0074, 0.0014, -2.3416].as_slice())
    );
    assert_eq!(labels.iter().filter(|label| label.is_nominal()).count(), 60);
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_refused_or_read_but_never_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..400),
        headed in any::<bool>(),
        compressed in any::<bool>(),
    ) {
        let mut content = if headed { format!("{HEADER}\n").into_bytes() } else { Vec::new() };
        content.extend(bytes);
        if compressed {
            content = gzip(&content);
        }
        let file = file(&content);
        let _ = frames::read(file.path(), &robot());
        let _ = labels::read(file.path(), &robot());
    }

    #[test]
    fn arbitrary_fields_give_finite_frames_or_a_row(
        fields in prop::collection::vec(
            "-?[0-9]{0,3}(\\.[0-9]{1,3})?(e-?[0-9]{1,3})?|NaN|inf| ",
            17,
        ),
    ) {
        let file = file(format!("{HEADER}\n{}\n", fields.join(",")).as_bytes());
        match frames::read(file.path(), &robot()) {
            Ok(runs) => {
                let frame = &runs[0].frames[0];
                let mut values = frame.channel.iter().chain(&frame.command);
                prop_assert!(values.all(|value| value.is_finite()));
            }
            Err(error) => prop_assert!(error.to_string().contains("row 1: ")),
        }
    }

    #[test]
    fn compressed_tables_read_as_plain_ones(
        poses in prop::collection::vec((-1.0..1.0, -3.1..3.1_f64), 1..20),
    ) {
        let rows: Vec<String> = poses
            .iter()
            .enumerate()
            .map(|(i, (x, yaw))| {
                let t = format!("{:.3}", 0.05 * (i + 1) as f64);
                row("3", &t, &format!("{x}"), &format!("{yaw}"), "0.1")
            })
            .collect();
        let content = table(&rows);
        let plain = frames::read(file(content.as_bytes()).path(), &robot()).unwrap();
        let compressed = frames::read(file(&gzip(content.as_bytes())).path(), &robot()).unwrap();
        prop_assert_eq!(&plain, &compressed);
        prop_assert_eq!(plain[0].frames.len(), poses.len());
        for (frame, (x, yaw)) in plain[0].frames.iter().zip(&poses) {
            prop_assert_eq!(&frame.channel[..3], [*x, 0.5, *yaw]);
        }
    }
}

//! Runs that are labelled with a change that is no fault: learned from, scored as healthy, told.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

const ROBOT: &str = "name = \"cart\"\nkinematics = \"none\"\ncommand = []\n\
                     measured = { pose = false, wheel_rates = false, steer = false }\n\
                     channel = [{ name = \"a\" }, { name = \"b\" }]\n\
                     context = [{ name = \"ground\" }]\n";
const RUNS: u32 = 16;
const ONSET_S: f64 = 12.0;

fn vigil(folder: &Path, words: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    let words = words.split_whitespace();
    command.args(words).current_dir(folder).output().unwrap()
}

/// Frames of runs of 30 s at 50 Hz, whose channels step up or down by turns; in the last run
/// nothing does.
fn frames() -> String {
    let mut state = 1_u64;
    let mut noise = || {
        // Twelve uniform numbers make a normal one.
        let uniform = |_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        0.05 * ((0..12).map(uniform).sum::<f64>() - 6.0)
    };
    let mut out = "run,t,a,b\n".to_owned();
    for run in 0..=RUNS {
        let sign = if run % 2 == 0 { 1.0 } else { -1.0 };
        for i in 0..1500 {
            let t_s = f64::from(i) * 0.02;
            let step = if t_s >= ONSET_S && run < RUNS {
                0.04 * sign
            } else {
                0.0
            };
            let (a, b) = (1.0 + step + noise(), 1.0 + 0.8 * step + noise());
            out += &format!("{run},{t_s:.2},{a:.5},{b:.5}\n");
        }
    }
    out
}

fn workplace(mode: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let row = |run: u32| format!("{run},{mode},{ONSET_S},day {}\n", run % 4);
    let labels: String = (0..RUNS).map(row).collect();
    write(
        "labels.csv",
        &format!("run,mode,onset_s,group\n{labels}{RUNS},ND,-1,day 5\n"),
    );
    write("robot.toml", ROBOT);
    write("frames.csv", &frames());
    folder
}

const LEARN: &str = "learn --robot robot.toml --frames frames.csv --runs labels.csv \
                     --test-fraction 0 --out model.toml";

#[test]
fn a_labelled_change_is_learned_told_and_scored_as_healthy() {
    let folder = workplace("ground");
    let learned = vigil(folder.path(), LEARN);
    let text = String::from_utf8_lossy(&learned.stdout).into_owned();
    assert!(
        learned.status.success() && text.contains("ground: told by"),
        "{learned:?}"
    );
    let words = "diagnose --robot robot.toml --model model.toml --frames frames.csv --out v.csv";
    assert!(vigil(folder.path(), words).status.success());
    let verdicts = fs::read_to_string(folder.path().join("v.csv")).unwrap();
    let mut rows = verdicts.lines();
    assert!(rows.next().unwrap().ends_with(",size_kind,context"));
    let told: Vec<u32> = rows
        .filter(|row| row.ends_with(",ground"))
        .map(|row| row.split(',').next().unwrap().parse().unwrap())
        .collect();
    assert!(told.len() >= 12 && !told.contains(&RUNS), "{told:?}");
    let words = "evaluate --robot robot.toml --model model.toml --frames frames.csv \
                 --runs labels.csv --part all --json";
    let scored = vigil(folder.path(), words);
    let text = String::from_utf8_lossy(&scored.stdout).into_owned();
    assert!(scored.status.success(), "{scored:?}");
    assert!(!text.contains("ground"), "no fault of that name: {text}");
}

#[test]
fn a_label_that_is_neither_fault_nor_context_is_refused() {
    for wrong in ["water", "ground+ground"] {
        let folder = workplace(wrong);
        let refused = vigil(folder.path(), LEARN);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(
            said.contains(&format!("'{wrong}'")) && said.contains("it declares ground"),
            "{said}"
        );
    }
}

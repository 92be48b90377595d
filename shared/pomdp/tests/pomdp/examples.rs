//! The programs in `examples` print what they say they print.

use std::path::Path;
use std::process::Command;

/// The lines of the block `text` in a program's own documentation.
fn documented(source: &str) -> Vec<&str> {
    let lines = source.lines().map_while(|line| line.strip_prefix("//!"));
    let block = lines.skip_while(|line| *line != " ```text").skip(1);
    let block = block.take_while(|line| *line != " ```");
    block
        .map(|line| line.strip_prefix(' ').unwrap_or(line))
        .collect()
}

fn assert_documented(name: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let source = std::fs::read_to_string(folder.join(format!("{name}.rs"))).unwrap();
    let test = std::env::current_exe().unwrap();
    let built = test.parent().unwrap().with_file_name("examples");
    let program = built.join(name);
    assert!(
        program.exists(),
        "{} is not built: run `cargo build --package vigil-pomdp --examples`",
        program.display()
    );
    let output = Command::new(&program).output().unwrap();
    assert!(output.status.success(), "{name}: {output:?}");
    let printed = String::from_utf8(output.stdout).unwrap();
    let printed: Vec<&str> = printed.lines().map(str::trim_end).collect();
    assert!(!printed.is_empty(), "{name} prints nothing");
    assert_eq!(printed, documented(&source), "{name}");
}

#[test]
fn a_model_in_code_is_solved_and_acted_on() {
    assert_documented("model_in_code");
}

#[test]
fn a_control_loop_runs() {
    assert_documented("control_loop");
}

#[test]
fn inspecting_beats_q_mdp() {
    assert_documented("inspect_or_act");
}

#[test]
fn policies_are_written_and_read() {
    assert_documented("policy_files");
}

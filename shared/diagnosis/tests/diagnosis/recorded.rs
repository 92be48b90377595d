//! Recorded runs, the robot and the shipped model, for tests.

use std::path::PathBuf;
use std::sync::LazyLock;

use vigil_blocks::SensorFrame;
use vigil_recording::frames::{self, Run};
use vigil_recording::labels::{self, Label};
use vigil_robot::Description;
use vigil_robot::learned::Model;

/// A file of the project.
pub fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(name)
}

/// The rover.
pub fn robot() -> Description {
    vigil_setup::load_robot(&path("config/robots/rover.toml")).unwrap()
}

/// The shipped model.
pub fn model() -> Model {
    Model::from_toml(&std::fs::read_to_string(path("config/models/rover.toml")).unwrap()).unwrap()
}

/// All runs and their labels.
pub fn runs() -> (&'static [Run], &'static [Label]) {
    static READ: LazyLock<(Vec<Run>, Vec<Label>)> = LazyLock::new(|| {
        let robot = robot();
        let frames = path("tests/data/rover/learn_frames.csv.gz");
        let labels = path("tests/data/rover/learn_runs.csv");
        (
            frames::read(&frames, &robot).unwrap(),
            labels::read(&labels, &robot).unwrap(),
        )
    });
    (&READ.0, &READ.1)
}

/// The first run of a mode and kind among those that the model has not seen.
pub fn unseen(mode: &str, kind: &str) -> (Vec<SensorFrame>, Label) {
    let (runs, labels) = runs();
    let held_out = model().provenance.runs_held_out;
    let is_wanted = |l: &&Label| l.mode == mode && l.kind == kind && held_out.contains(&l.run);
    let label = labels.iter().find(is_wanted).unwrap().clone();
    let run = runs.iter().find(|run| run.id == label.run).unwrap();
    (run.frames.clone(), label)
}

/// A healthy run of 20 s with every channel, whose command changes.
pub fn healthy(id: u32) -> Vec<SensorFrame> {
    let file = path("tests/data/rover/healthy_frames.csv.gz");
    let runs = frames::read(&file, &robot()).unwrap();
    runs.into_iter().find(|run| run.id == id).unwrap().frames
}
